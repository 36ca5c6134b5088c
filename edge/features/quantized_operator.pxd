cimport cython


@cython.final
cdef class QuantizedOperator:
    cdef readonly float[::1] values, result
    cdef short[:, ::1] _rows  # (k, w), whole steps
    cdef float[::1] _row_step
    cdef short[::1] _vector  # (w,), the values in whole steps
    cdef int[::1] _sums  # (k,)
    cdef float _step

    cpdef void apply(self) except *
    cpdef void apply_rows(self, const int[::1] which, Py_ssize_t n) except *
    cdef void _quantize(self) noexcept nogil
    cdef void _scale(self, Py_ssize_t k) noexcept nogil
