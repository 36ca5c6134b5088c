# C types of what every sample takes; see sequence.py.
import cython

cdef int WINDOW, SUSPECT_N, _KNOWN_N, _COUNTERS
cdef unsigned long long _SEEN_ALL
cdef long long SENDER_SPAN_US

cdef class Sequence:
    cdef object _statistics
    cdef bint _is_begun
    cdef int _sample, _counter, _stride, _other_run, _other
    cdef unsigned long long _seen

    @cython.locals(ahead=cython.int, steps=cython.int)
    cpdef int accept(self, int sample, int counter, int modulus) except? -1000
    cpdef restart(self)
    cdef int _begin(self, int sample, int counter) noexcept
    @cython.locals(bit=cython.ulonglong, follows=cython.bint)
    cdef int _old(self, int sample, int counter, int age) except? -1000

cdef class _Track:
    cdef list _known
    cdef int _sample
    cdef long long _time_us

    @cython.locals(passed_us=cython.longlong, steps=cython.int)
    cdef bint is_near(self, int sample, long long time_us) noexcept
    @cython.locals(known=cython.longlong)
    cdef bint is_used(self, int sample, long long time_us) except -1
    @cython.locals(known=cython.longlong)
    cpdef add(self, int sample, long long time_us)
    cdef int _steps_to(self, int sample) noexcept

cdef class SenderWatch:
    cdef list _tracks
    cdef int _suspect_n, _quiet_n

    @cython.locals(track=_Track, i=cython.int, used=cython.bint)
    cpdef bint see(self, int sample, long long time_us) except -1
    cpdef restart(self)
    cdef bint _is_second(self, bint suspect) noexcept

cdef class Evidence:
    cdef int _needed
    cdef object _implied, _frames

    cpdef clear(self)
