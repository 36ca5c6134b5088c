cimport cython


@cython.final
cdef class Vibration:
    cdef double _from_hz
    cdef double[:, ::1] _before
    cdef double[:, ::1] _once
    cdef double[:, ::1] _twice
    cdef long long[::1] _frame_of  # the frame in which each pin was followed last
    cdef long long _frame
    cdef long long _before_ns
    cdef double _lasted_s
    cdef double _power_px2

    cpdef void forget(self) noexcept
    cpdef object update(
        self, const double[:, ::1] motion, const int[::1] pins, Py_ssize_t n_pins, double sigma_px,
        long long capture_ns
    )
    cdef double _mean_square(
        self, const double[:, ::1] motion, const int[::1] pins, Py_ssize_t n_pins, double pole
    ) noexcept
    cdef void _join(
        self, const double[:, ::1] motion, const int[::1] pins, Py_ssize_t n_pins, Py_ssize_t held_n
    ) noexcept
