cimport cython
from cpython.buffer cimport PyBUF_C_CONTIGUOUS, PyBUF_FORMAT, PyBuffer_Release, PyObject_GetBuffer


@cython.final
cdef class _Copy:
    cdef object array
    cdef unsigned char[::1] memory  # the same
    cdef Py_ssize_t own_n  # references to the array that are this object's

    cdef bint is_held(self) except -1


@cython.final
cdef class Copies:
    cdef object _array
    cdef const unsigned char[::1] _source  # the same
    cdef list _copies

    cpdef object take(self)


cdef inline const double *numbers_of(object array, Py_ssize_t n, bint are_complex=False) except NULL:
    cdef Py_buffer view
    PyObject_GetBuffer(array, &view, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT)
    cdef bint fits = view.format[0] == (c"Z" if are_complex else c"d") and view.len == (16 if are_complex else 8) * n
    PyBuffer_Release(&view)
    if not fits:
        raise ValueError(f"an array of {n} numbers is wanted")
    return <const double *>view.buf
