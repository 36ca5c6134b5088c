# C types of what every sample takes; see body.py.
import cython

cdef object nan, status_of, crc32, _new
cdef int _AT, _END, _OURS, _ID, _SIZE
cdef bint _COMPILED
cdef unsigned short[256] _STEPS
cdef unsigned int[256] _CHECK_STEPS
cdef unsigned char[64] _FRAME
ctypedef const unsigned char* Bytes
ctypedef unsigned char* Writable

@cython.locals(at=Bytes, body=bytes, data_id=cython.int, is_ours=cython.bint)
cpdef bytes body_in(frame)
@cython.locals(at=Bytes, to=Writable, i=cython.int, check=cython.uint, register=cython.int)
cpdef bytes frame_of(bytes body, long long counter)
@cython.locals(at=Bytes, i=cython.int, register=cython.uint)
cdef int _check_of(bytes body) except -1
cdef int _crc_of(frame, int data_id) except -1
@cython.locals(i=cython.int, register=cython.int)
cdef int _register_of(Bytes frame, int data_id) noexcept

cdef class FromFrame:
    cdef readonly bytes body, exact

@cython.locals(state=FromFrame)
cpdef object received(kind, bytes body, bytes exact=*)

cdef class Decoded:
    cdef object _default
    cdef double _scale
    cdef bint _plain, _status
    cdef Py_ssize_t _place, _at, _size
    cdef long long _span, _top, _nan, _whole

    cdef object _of(self, FromFrame state)
    @cython.locals(raw=cython.longlong)
    cpdef object value(self, bytes body)
    @cython.locals(at=Py_ssize_t, read=Bytes, raw=cython.longlong, high=cython.longlong)
    cpdef long long raw(self, bytes body) except? -1
