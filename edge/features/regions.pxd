cimport cython
from edge.features.peaks cimport PeakFinder


@cython.final
cdef class Regions:
    cdef readonly Py_ssize_t n_contacts
    cdef readonly double[:, ::1] middle
    cdef readonly double[::1] semi_axis
    cdef readonly double[::1] elongation
    cdef readonly double[::1] direction
    cdef readonly double x0
    cdef readonly double y0
    cdef readonly double step_px
    cdef Py_ssize_t[::1] _n_points  # of each region
    cdef float[::1] _level  # a region's edge
    cdef double[:, ::1] _sums  # of each region: weight, first and second moments
    cdef Py_ssize_t _n_peaks
    cdef int[::1] _at  # of each peak: its place in the padded grid
    cdef float[::1] _height
    # the contact it belongs to, -1: one too many; a contact's first peak is its highest
    cdef int[::1] _contact
    cdef double[:, ::1] _ridge  # places of one contact's peaks
    cdef object _ridge_array  # the same memory
    cdef PeakFinder _peaks
    cdef int[::1] _found_at  # of `peaks`
    cdef int[::1] _found_point
    cdef float[::1] _found_height
    cdef float[::1] _grid
    cdef int[::1] _place
    cdef int[::1] _active
    cdef short[::1] _column  # of each place in the padded grid
    cdef short[::1] _row
    cdef double _shallow_rel
    cdef double _min_prominence_sigma

    cpdef Py_ssize_t merge(self, const float[::1] noise, double noise_px) noexcept
    cpdef void keep(self, const unsigned char[::1] kept) noexcept
    cpdef double area_px2(self, Py_ssize_t i) noexcept
    cpdef double peak_height(self, Py_ssize_t i) noexcept
    cpdef object ridge(self, Py_ssize_t i)
    cdef Py_ssize_t _highest(self, Py_ssize_t i) noexcept
    cdef void _drop_peaks(self, int dropped) noexcept
    cdef void _measure(self) noexcept
    cdef void _collect(self) noexcept
    cdef Py_ssize_t _nearest(self, Py_ssize_t at) noexcept
    cdef void _find_shape(self, Py_ssize_t i) noexcept
