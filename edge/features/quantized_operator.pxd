cimport cython


@cython.final
cdef class QuantizedOperator:
    cdef readonly float[::1] values, result
    cdef short[::1] _weights  # in whole steps, of groups of four rows, of their rows, of the group's blocks
    cdef int[::1] _start  # (groups + 1,) where the blocks of each group begin in the next
    cdef unsigned short[::1] _block  # which of a row's blocks they are
    cdef int[::1] _order  # (m,) the value of each column
    cdef float[::1] _row_step
    cdef short[::1] _vector  # (w,), the values in whole steps
    cdef short[::1] _taken  # (w,), scratch
    cdef int[::1] _sums  # (k,), filled up to a group
    cdef float _step

    cpdef void apply(self) except *
    cpdef void apply_rows(self, const int[::1] which, Py_ssize_t n) except *
    cdef void _quantize(self) noexcept nogil
    cdef void _scale(self, Py_ssize_t k) noexcept nogil
