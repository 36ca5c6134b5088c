# Sums over neighbours, which baseline x86 runs too slowly as compiled Python, described in `pair_sums.py`. 331 pins of
# 18 neighbours: 35,000 instructions; 52,000 in double precision.

cdef extern from *:
    """
    /* x and y of two neighbours in one vector, of SSE2 and NEON alike */
    typedef float vt_pairs __attribute__((vector_size(16)));
    typedef double vt_both __attribute__((vector_size(16)));
    typedef double vt_pair __attribute__((may_alias, aligned(4)));

    static void vt_pair_sums(const unsigned short *restrict near_, const float *restrict weight, Py_ssize_t n,
                             Py_ssize_t width, const float *restrict motion, float *restrict sums)
    {
        const vt_pair *const xy = (const vt_pair *)motion;
        for (Py_ssize_t i = 0; i < n; i++) {
            const unsigned short *const end = near_ + width;
            vt_pairs sum = {0};
            for (; near_ < end; near_ += 6, weight += 6) /* no remainder: width is a multiple of 6 */
                for (int k = 0; k < 6; k += 2) {
                    const vt_both of = {xy[near_[k]], xy[near_[k + 1]]};
                    const float first = weight[k], second = weight[k + 1];
                    sum += (vt_pairs){first, first, second, second} * (vt_pairs)of;
                }
            sums[2 * i] = sum[0] + sum[2];
            sums[2 * i + 1] = sum[1] + sum[3];
        }
    }
    """
    void vt_pair_sums(
        const unsigned short *, const float *, Py_ssize_t, Py_ssize_t, const float *, float *
    ) noexcept nogil


cdef inline void pair_sums(
    const unsigned short[:, ::1] near, const float[:, ::1] weight, const float[:, ::1] motion, float[:, ::1] sums
) noexcept nogil:
    if near.shape[0]:
        vt_pair_sums(&near[0, 0], &weight[0, 0], near.shape[0], near.shape[1], &motion[0, 0], &sums[0, 0])
