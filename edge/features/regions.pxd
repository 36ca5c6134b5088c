cimport cython


@cython.final
cdef class PeakFinder:
    cdef readonly Py_ssize_t width, n_active, n_peaks
    cdef readonly int[::1] place, active, mark, at, point
    cdef readonly float[::1] grid, height
    cdef int[::1] _around  # (8,) from a place to its neighbours
    cdef int[::1] _stack

    cpdef void set_field(self, const float[::1] field, const int[::1] active, Py_ssize_t n_active) noexcept
    cpdef Py_ssize_t find(self, const float[::1] noise, float noise_factor, float least) noexcept
    cpdef void forget_searches(self) noexcept
    cpdef Py_ssize_t first_connected(self, Py_ssize_t j, float given, bint any_will_do) noexcept
    cdef bint _is_peak(self, int place, Py_ssize_t n) noexcept
    cdef void _insert(self, Py_ssize_t p, float h) noexcept
    cdef bint _is_maximum(self, Py_ssize_t here) noexcept
    cdef void _mark_plateau(self, Py_ssize_t start) noexcept


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
    cdef PeakFinder _peaks
    cdef int[::1] _place, _active
    cdef short[::1] _column  # of each place in the padded grid
    cdef short[::1] _row
    cdef double _shallow_rel, _min_prominence_sigma

    cpdef Py_ssize_t merge(self, const float[::1] noise, double noise_px) noexcept
    cpdef void keep(self, const unsigned char[::1] kept) noexcept
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
