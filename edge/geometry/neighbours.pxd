cdef void weighted_sums(
    const int[::1] start, const unsigned short[::1] near, const float[::1] weight, const float[::1] motion,
    float[::1] sums
) noexcept nogil


cdef class Separation:
    cdef Py_ssize_t n
    cdef double[:, ::1] at
    cdef double far2
    cdef double moved  # px, no point by more since they were compared

    cdef bint holds(self, const double[:, ::1] xy, double step) noexcept nogil
    cdef void renew(self, const double[:, ::1] xy, double gap) noexcept nogil
