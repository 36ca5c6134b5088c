cdef void weighted_sums(
    const int[::1] start, const unsigned short[::1] near, const float[::1] weight, const float[::1] motion,
    float[::1] sums
) noexcept nogil


cdef class Separation:
    cdef Py_ssize_t n
    cdef double[:, ::1] at
    cdef double far2

    cdef bint holds(self, const double[:, ::1] xy) noexcept nogil
    cdef void renew(self, const double[:, ::1] xy, double gap) noexcept nogil
