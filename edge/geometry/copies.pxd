cimport cython


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
    cdef _Copy _last, _next

    cpdef object take(self)
