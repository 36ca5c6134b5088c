cimport cython
from edge.features.contact_field cimport ContactField, PeakFinder
from edge.features.pin_motion cimport PinNoise
from edge.geometry.copies cimport Copies


@cython.final
cdef class Regions:
    cdef readonly Py_ssize_t n_contacts
    cdef readonly double[:, ::1] middle
    cdef readonly double[::1] semi_axis, elongation, direction
    cdef readonly double x0, y0, step_px
    cdef Py_ssize_t[::1] _n_points  # of each region
    cdef float[::1] _level  # a region's edge
    cdef double[:, ::1] _sums  # of each region: weight, first and second moments
    cdef Py_ssize_t _n_peaks
    cdef int[::1] _at  # of each peak: its place in the padded grid
    cdef float[::1] _height, _grid
    # the contact it belongs to, -1: one too many; a contact's first peak is its highest
    cdef int[::1] _contact
    cdef double[:, ::1] _ridge  # places of one contact's peaks
    cdef object _ridge_array  # the same memory
    cdef list _tops  # of each contact: its first row
    cdef PeakFinder _peaks
    cdef int[::1] _place, _active
    cdef short[::1] _column  # of each place in the padded grid
    cdef short[::1] _row
    cdef double _shallow_rel, _min_prominence_sigma

    cpdef Py_ssize_t merge(self, const float[::1] noise, double noise_px) noexcept
    cpdef void keep(self, const unsigned char[::1] kept) noexcept
    cpdef void join(self, Py_ssize_t i, Py_ssize_t j) noexcept
    cpdef double area_px2(self, Py_ssize_t i) noexcept
    cpdef double peak_height(self, Py_ssize_t i) noexcept
    cpdef object ridge(self, Py_ssize_t i)
    cdef Py_ssize_t _nearest_point(self, double x, double y) noexcept
    cdef Py_ssize_t _highest(self, Py_ssize_t i) noexcept
    cdef void _drop_peaks(self, int dropped) noexcept
    cdef void _measure(self) noexcept
    cdef void _collect(self) noexcept
    cdef Py_ssize_t _nearest(self, Py_ssize_t at) noexcept
    cdef void _find_shape(self, Py_ssize_t i) noexcept


@cython.final
cdef class ContactFinder:
    cdef readonly object surface, fitted
    cdef readonly ContactField field
    cdef readonly PeakFinder peaks
    cdef readonly Regions regions
    cdef readonly double[:, :] place, divergence_moment, curl_moment
    cdef PinNoise _pin_noise
    cdef const double[:, ::1] _rest, _xy
    cdef object _xy_array  # the same memory
    cdef const float[::1] _field_noise
    cdef int[::1] _near  # grid points round a contact, and their weights
    cdef double[::1] _weight
    cdef unsigned char[::1] _kept
    cdef double[:, :, ::1] _table  # of each contact: place less curl moment, these three, middle
    cdef list _copies  # of each contact: of each of these
    cdef Py_ssize_t _n_before  # regions of the last frame, before any was split or joined
    cdef double _pitch_px, _shallow_rel, _visibility_radius_px, _place_radius_px, _place_radius_axis, _contact_sigma
    cdef double _min_area_change, _min_oriented_elongation, _min_fitted_elongation, _min_cut_elongation

    cpdef void forget(self) except *
    cpdef tuple find(self, object seen, double sigma_px, bint moments=*, int fits=*)
    cdef void _look_closer(self, object seen, double sigma_px) except *
    cdef void _unite(self, object seen) except *
    cdef bint _are_neighbours(self, Py_ssize_t i, Py_ssize_t j) noexcept
    cdef double _distance(self, Py_ssize_t i, Py_ssize_t j) noexcept
    @cython.locals(inwards=double, size=double, total=double, motion=double)
    cdef double _rise(self, object seen, Py_ssize_t i, Py_ssize_t j) except *
    cdef object _describe(self, Py_ssize_t i, double direction, bint moments, list fitted)
    cpdef void drop_guesses(self, const unsigned char[::1] seen) noexcept
    cpdef double visible_share(self, const unsigned char[::1] seen, double x, double y) noexcept
    cpdef void find_moments(self) noexcept
    cdef Py_ssize_t _find_near(self, Py_ssize_t i) noexcept
    @cython.locals(total=double, divergence_x=double, divergence_y=double, curl_x=double, curl_y=double)
    cdef void _find_moments(self, Py_ssize_t i, Py_ssize_t n) noexcept
    cdef double _radius_px(self, Py_ssize_t i) noexcept
    @cython.locals(total=double, x=double, y=double)
    cdef void _find_place(self, Py_ssize_t i) noexcept
    cdef bint _is_nearer_to_another(self, double x, double y, double d2, Py_ssize_t i) noexcept
