cdef void weighted_sums(
    const int[::1] start, const unsigned short[::1] near, const float[::1] weight, const float[::1] motion,
    float[::1] sums
) noexcept nogil
