# The products of `quantized_operator`, which baseline x86 runs too slowly as compiled Python, described in
# `row_products.py`. Both surfaces of a frame of 331 pins: 37 us with SSE2, 10 us with the AVX2 clone, chosen
# when the program loads.

cdef extern from *:
    """
    #if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
    #define VT_WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
    #else
    #define VT_WIDE
    #endif

    /* Four rows at a time: the vector is read once for the four, and their sums are independent. */
    VT_WIDE static void vt_all_rows(const short *restrict weights, const int *restrict start, const int *restrict first,
                                    Py_ssize_t groups, const short *restrict vector_, int *restrict sums)
    {
        for (Py_ssize_t g = 0; g < groups; g++) {
            const Py_ssize_t width = (start[g + 1] - start[g]) / 4 & -16; /* no remainder: a multiple of 16 */
            const short *restrict r0 = weights + start[g], *restrict r1 = r0 + width;
            const short *restrict r2 = r1 + width, *restrict r3 = r2 + width, *restrict vector = vector_ + first[g];
            int s0 = 0, s1 = 0, s2 = 0, s3 = 0;
            for (Py_ssize_t i = 0; i < width; i++) {
                const int v = vector[i];
                s0 += r0[i] * v;
                s1 += r1[i] * v;
                s2 += r2[i] * v;
                s3 += r3[i] * v;
            }
            sums[4 * g] = s0, sums[4 * g + 1] = s1, sums[4 * g + 2] = s2, sums[4 * g + 3] = s3;
        }
    }

    VT_WIDE static void vt_some_rows(const short *restrict weights, const int *restrict start,
                                     const int *restrict first, const int *restrict which, Py_ssize_t n,
                                     const short *restrict vector_, int *restrict sums)
    {
        for (Py_ssize_t p = 0; p < n; p++) {
            const unsigned row = (unsigned)which[p], g = row / 4;
            const Py_ssize_t width = (start[g + 1] - start[g]) / 4 & -16;
            const short *restrict weight = weights + start[g] + row % 4 * width, *restrict vector = vector_ + first[g];
            int sum = 0;
            for (Py_ssize_t i = 0; i < width; i++) sum += weight[i] * vector[i];
            sums[p] = sum;
        }
    }
    """
    void vt_all_rows(const short *, const int *, const int *, Py_ssize_t, const short *, int *) noexcept nogil
    void vt_some_rows(
        const short *, const int *, const int *, const int *, Py_ssize_t, const short *, int *
    ) noexcept nogil


cdef inline void all_rows(
    short[::1] weights, int[::1] start, int[::1] first, short[::1] vector, int[::1] sums
) noexcept nogil:
    vt_all_rows(&weights[0], &start[0], &first[0], first.shape[0], &vector[0], &sums[0])


cdef inline void some_rows(
    short[::1] weights, int[::1] start, int[::1] first, const int[::1] which, Py_ssize_t n, short[::1] vector,
    int[::1] sums
) noexcept nogil:
    if n:
        vt_some_rows(&weights[0], &start[0], &first[0], &which[0], n, &vector[0], &sums[0])
