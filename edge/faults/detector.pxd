cimport cython


@cython.final
cdef class Facts:
    cdef public double level, level_rel, newly_saturated, sharpness, far_share, off_pitches, drifted_share
    cdef public bint black, camera_lost, camera_stalled, clock_stepped, unidentified, failed, pins_missing
    cdef public double rest_level, rest_saturated, saturated, clock_jump_s, off_px, limit_px
    cdef public int far_n
    cdef public str camera, failure, why_missing

    cpdef int reached(self, object limits) except -1
    cpdef object see(self, object frame)


@cython.final
cdef class FaultDetector:
    cdef readonly object without_values, last
    cdef public bint frozen
    cdef readonly bint after_gap
    cdef readonly long long gaps_n
    cdef object _source, _registry, _clock_ns, _live, _pins, _verdict, _image, _motion_px, _offset_px, _xy_img
    cdef Facts _facts
    cdef list _limits
    cdef str _condition
    cdef bint _is_live, _calibrated, _repeated, _is_due
    cdef int _reached, _spoilt
    cdef Py_ssize_t _n, _calm_n  # pins; frames since one in which they were looked at
    cdef long long _limits_n, _reported_n, _skipped_n, _capture_ns, _sequence, _begun_ns, _due_ns, _period_ns
    cdef double _load_pitches, _pitch_px, _far_px, _limit_px, _least_px, _near_px, _baseline_px, _enough_n, _gap_ns
    cdef double _least_age_ns  # of an image when work on it begins, since the capture clock last stepped

    cpdef object judge_image(self, object frame, bint look_closer=*)
    cdef str _condition_now(self)
    cdef bint _are_calm(self, object tracks, object features) except -1
    cdef bint _is_noisy(self, double sigma_px) except -1
    cdef object _end(self)
    cdef int _now_reached(self) except -1
    cdef object _note_motion(self, object features, double drifted_share)
