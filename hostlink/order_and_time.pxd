# C types of what every sample takes; see order_and_time.py.
import cython

cdef int WINDOW, SUSPECT_N, _KNOWN_N, _COUNTERS
cdef unsigned long long _SEEN_ALL
cdef long long SENDER_SPAN_US, _TIME_BITS

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
    cdef long long[128] _known
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
    cdef _Track _present, _other
    cdef int _suspect_n, _quiet_n

    @cython.locals(present=_Track, other=_Track, used=cython.bint)
    cpdef bint see(self, int sample, long long time_us) except -1
    cpdef restart(self)
    cdef bint _is_second(self, bint suspect) noexcept

cdef class Evidence:
    cdef int _needed
    cdef object _implied, _frames

    cpdef clear(self)

cdef double BUCKET_S, LONG_US, DRIFTED_S, SETTLE_S, EARLY_S, LATE_S
cdef long long WRAP_US
cdef int SETTLE_N, LATE_N

cdef class ClockMap:
    cdef public double _transit_s
    cdef double _lowest_at_s, _lowest_offset_s, _closed_s, _newest_at_s, _newest_offset_s
    cdef double _bucket_start_s, _slope, _wander, _last_host_s, _settling_from_s, _on_time_s
    cdef double _settle_span_s, _late_since_s, _late_least_s, _uncertainty_s
    cdef readonly double lateness_s
    cdef readonly int restarts
    cdef object _lock, _acquire, _release, _buckets, _floors
    cdef bint _is_known
    cdef long long _last_us, _captured_us
    cdef int _settling_n, _late_n

    @cython.locals(captured_us=cython.longlong, delay_us=cython.longlong)
    cpdef object take(self, long long capture_us, double latency_us, double host_s)
    cdef _begin(self)
    cdef _restart(self)
    @cython.locals(upper=double, lower=double, error_s=double, at_s=double)
    cdef object _host_time(self, long long unwrapped_us)
    cdef _observe(self, long long unwrapped_us, double host_s)
    cdef _close_bucket(self)
    cdef bint _is_settled(self, double at_s) noexcept
    cdef bint _contradicts(self, double at_s, double offset_s, double host_s) except -1
    @cython.locals(passed_us=cython.longlong, expected_us=cython.longlong)
    cdef long long _unwrap(self, long long device_us, double host_s) noexcept
    @cython.locals(passed_s=double, bound=double, bucket_at_s=double, offset_s=double)
    cdef (double, double) _bounds(self, double at_s) except *
    cdef _fit(self)

cdef long long _signed(long long difference_us) noexcept
