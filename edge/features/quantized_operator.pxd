cimport cython


@cython.final
cdef class QuantizedOperator:
    cdef readonly float[::1] values, result
    cdef short[::1] _weights  # of `_in_runs`, as the next three
    cdef int[::1] _start
    cdef int[::1] _begin
    cdef int[::1] _ahead
    cdef float[::1] _row_step
    cdef short[::1] _vector  # (w,), the values in whole steps
    cdef int[::1] _all  # (k,), every row

    cpdef void apply(self) except *
    cpdef void apply_rows(self, const int[::1] which, Py_ssize_t n) except *
    cdef void _multiply(self, const int[::1] which, Py_ssize_t n) noexcept
    cdef int _product(self, Py_ssize_t row) noexcept
    cdef float _quantize(self) noexcept
