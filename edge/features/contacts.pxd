cimport cython
from edge.features.contact_field cimport ContactField
from edge.features.pin_motion cimport PinNoise
from edge.features.regions cimport PeakFinder, Regions


@cython.final
cdef class ContactFinder:
    cdef readonly object surface, fitted
    cdef readonly ContactField field
    cdef readonly PeakFinder peaks
    cdef readonly Regions regions
    cdef readonly double[:, ::1] place, divergence_moment, curl_moment
    cdef PinNoise _pin_noise
    cdef const double[:, ::1] _rest, _xy
    cdef object _xy_array  # the same memory
    cdef const float[::1] _field_noise
    cdef int[::1] _near  # grid points round a contact, and their weights
    cdef double[::1] _weight
    cdef unsigned char[::1] _kept
    cdef object _tables  # place, divergence_moment and curl_moment
    cdef object _middles
    cdef Py_ssize_t _n_before  # regions of the last frame, before any was split or joined
    cdef double _visibility_radius_px, _place_radius_px, _place_radius_axis, _contact_sigma
    cdef double _min_area_change, _min_oriented_elongation

    cpdef void forget(self) except *
    cpdef tuple find(self, object seen, double sigma_px, bint moments=*, int fits=*)
    cdef void _look_closer(self, object seen, double sigma_px) except *
    cdef object _describe(self, Py_ssize_t i, double direction, bint moments, list fitted)
    cpdef void drop_guesses(self, const unsigned char[::1] seen) noexcept
    cpdef double visible_share(self, const unsigned char[::1] seen, double x, double y) noexcept
    cpdef void find_places(self) noexcept
    cpdef void find_moments(self) noexcept
    cdef Py_ssize_t _find_near(self, Py_ssize_t i) noexcept
    cdef void _find_moments(self, Py_ssize_t i, Py_ssize_t n) noexcept
    cdef double _radius_px(self, Py_ssize_t i) noexcept
    cdef void _find_place(self, Py_ssize_t i, Py_ssize_t n_contacts) noexcept
    cdef bint _is_nearer_to_another(
        self, double x, double y, double d2, Py_ssize_t i, Py_ssize_t n_contacts
    ) noexcept
