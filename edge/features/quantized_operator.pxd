cimport cython


@cython.final
cdef class QuantizedOperator:
    cdef readonly float[::1] values, result
    cdef short[::1] _weights  # in whole steps, of each row's blocks, row after row
    cdef int[::1] _start  # (k + 1,) where the blocks of each row begin in the next
    cdef unsigned short[::1] _block  # which of the columns' blocks they are
    cdef float[::1] _row_step
    cdef short[::1] _vector  # (w,), the values in whole steps
    cdef int[::1] _sums  # (k,)
    cdef int[::1] _all  # (k,), every row

    cpdef void apply(self) except *
    cpdef void apply_rows(self, const int[::1] which, Py_ssize_t n) except *
    cdef void _multiply(self, const int[::1] which, Py_ssize_t n) noexcept
    cdef float _quantize(self) noexcept
