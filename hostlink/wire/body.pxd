# C types of what every sample takes; see body.py.
import cython

cdef object _KEY, nan, status_of, crc32, crc_hqx, _ID
cdef int _AT, _END, _OURS

@cython.locals(body=bytes, crc=int)
cpdef bytes body_in(bytes frame)

cdef class Decoded:
    cdef object _default, _scale
    cdef bint _plain, _status
    cdef Py_ssize_t _at, _size
    cdef long long _span, _top, _nan

    @cython.locals(body=bytes)
    cdef object _of(self, dict values)
    cpdef object value(self, bytes body)
    @cython.locals(at=Py_ssize_t, raw=cython.longlong, high=cython.longlong)
    cpdef long long raw(self, bytes body) except? -1
