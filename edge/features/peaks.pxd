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
    cdef const float[::1] _field  # given last
    cdef object _field_array  # the same memory
    cdef const int[::1] _given_active
    cdef object _active_array
    cdef object _all_points
    cdef const float[::1] _noise
    cdef object _noise_array
    cdef float[::1] _level  # at which `is_connected` searched from each peak
    cdef int[::1] _around  # (8,) from a place to its neighbours
    cdef int[::1] _stack

    cpdef void forget_searches(self) except *
    cpdef Py_ssize_t first_connected(self, Py_ssize_t j, float level) except -1
    cpdef bint is_connected(self, Py_ssize_t j, float level) except -1
    cdef bint _must_be_peak(self, Py_ssize_t j) except -1
    cdef bint _search(self, Py_ssize_t j, float given, bint soon) noexcept
    cdef bint _is_peak(self, int place, Py_ssize_t n) noexcept
    cdef void _insert(self, Py_ssize_t p, float h) noexcept
    cdef bint _is_maximum(self, Py_ssize_t here) noexcept
    cdef void _mark_plateau(self, Py_ssize_t start) noexcept
