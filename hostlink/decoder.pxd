# C types of what every sample takes; see decoder.py.
import cython

from hostlink.order_and_time cimport ClockMap, Evidence, SenderWatch, Sequence
from hostlink.wire.body cimport Bytes, Decoded, FromFrame, body_in, received

cdef int _CLOCK_STEP
cdef Decoded _SAMPLE, _STATUS, _TIME, _LATENCY
cdef object _new, _NO_TIME, _State, _Sample, _Corrupt
cdef int _OURS, _SIZE, _PART_SIZE, _AT

cdef class _Node:
    cdef readonly object node, statistics
    cdef readonly ClockMap clock
    cdef Sequence sequence
    cdef SenderWatch senders
    cdef object parts, segments
    cdef Evidence evidence_p5, evidence_p11
    cdef bint _bare, mismatch_raised, second_sender_given
    cdef double _late_s

    @cython.locals(is_part=cython.bint)
    cdef list can_frame(self, kind, int tpdo, data, double arrival_s)
    cdef object corrupt_can(self, kind, int tpdo, bytes data)
    @cython.locals(body=bytes, at=Bytes)
    cpdef list state_frame(self, frame, double arrival_s)
    @cython.locals(sample=cython.int, status=cython.int, time_us=cython.longlong, latency_us=cython.double, lost_n=cython.int, taken=tuple, events=list)
    cdef list _deliver(self, state, bytes body, int counter, int modulus, double arrival_s)
    cdef object _host_time(self, int status, long long time_us, double latency_us, double arrival_s)

cdef class _Decoder:
    cdef dict _nodes
    cdef bint _bare
    cdef double _late_s
    cdef list _held
    cdef dict __dict__

    cdef list _finish(self, list events, error)

cdef class CanDecoder(_Decoder):
    cdef public object ids
    cdef public object unknown_n
    cdef object _table
    cdef dict _ways, _alone

    @cython.locals(ways=dict, way=tuple, node=_Node, tpdo=cython.int, size=Py_ssize_t, events=list)
    cpdef list receive(self, can_id, data, double arrival_s=*, channel=*)

    @cython.locals(i=Py_ssize_t, at=Py_ssize_t, events=list)
    cpdef list receive_run(self, list times_s, list ids, list channels, bytes data, wanted=*)

cdef class SerialDecoder(_Decoder):
    cdef object _number
    cdef bytearray _block
    cdef bint _skipping, _in_step
