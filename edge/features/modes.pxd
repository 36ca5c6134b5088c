cimport cython


@cython.final
cdef class Modes:
    cdef Py_ssize_t _n
    cdef Py_ssize_t _k  # modes
    cdef double complex[::1] _result
    cdef object _result_array  # the same memory
    cdef double[:, ::1] _re  # (n, k), the basis
    cdef double[:, ::1] _im
    cdef int[::1] _mirror
    cdef const float[:, ::1] _rows  # basis times inverse Gram matrix, as `_in_rows` has it
    cdef float[:, ::1] _sums  # of rows times motion: of x, of y
    cdef double[:, ::1] _gram_re  # (k, k), of all pins
    cdef double[:, ::1] _gram_im
    cdef double[:, ::1] _factor_re  # (k, k), scratch
    cdef double[:, ::1] _factor_im
    cdef double[::1] _sum_re  # (k,) the sums, which become the coefficients
    cdef double[::1] _sum_im

    cpdef object fit(self, const double[:, ::1] motion, const unsigned char[::1] seen=*)
    cdef bint _are_all(self, const unsigned char[::1] seen) noexcept
    cdef void _fit_all(self, const double[:, ::1] motion) noexcept
    cdef void _sum_all(self, const double[:, ::1] motion) noexcept
    cdef void _sum_seen(self, const double[:, ::1] motion, const unsigned char[::1] seen) noexcept
    cdef void _subtract_lost(self, const unsigned char[::1] seen) noexcept
    cdef bint _solve(self) noexcept
