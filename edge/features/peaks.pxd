cimport cython


@cython.final
cdef class PeakFinder:
    cdef readonly Py_ssize_t width
    cdef readonly int[::1] place
    cdef readonly float[::1] grid
    cdef readonly int[::1] active
    cdef readonly Py_ssize_t n_active
    cdef readonly signed char[::1] mark
    cdef readonly Py_ssize_t n_peaks
    cdef readonly int[::1] at
    cdef readonly int[::1] point
    cdef readonly float[::1] height
    cdef int[::1] _all_points
    cdef float[::1] _level  # at which `is_connected` searched from each peak
    cdef int[::1] _around  # (8,) from a place to its neighbours
    cdef int[::1] _stack

    cpdef void set_field(self, const float[::1] field, const int[::1] active=*, Py_ssize_t n_active=*) noexcept
    cpdef Py_ssize_t find(self, const float[::1] noise, float noise_factor, float least) noexcept
    cpdef void forget_searches(self) noexcept
    cpdef Py_ssize_t first_connected(self, Py_ssize_t j, float level) noexcept
    cpdef bint is_connected(self, Py_ssize_t j, float level) noexcept
    cdef bint _search(self, Py_ssize_t j, float given, bint soon) noexcept
    cdef bint _is_peak(self, int place, Py_ssize_t n) noexcept
    cdef void _insert(self, Py_ssize_t p, float h) noexcept
    cdef bint _is_maximum(self, Py_ssize_t here) noexcept
    cdef void _mark_plateau(self, Py_ssize_t start) noexcept
