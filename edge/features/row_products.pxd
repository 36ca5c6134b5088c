# The products of `quantized_operator`, which baseline x86 runs too slowly as compiled Python, described in
# `row_products.py`. Both surfaces of a frame of 331 pins: 37 us with SSE2, 10 us with the AVX2 clone, chosen
# when the program loads.

cdef extern from *:
    """
    #include <string.h>

    #if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
    #define VT_WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
    #else
    #define VT_WIDE
    #endif

    #define VT_BLOCK 16 /* columns */

    /* Of a vector what a group of four rows is multiplied with. */
    static inline void vt_take_blocks(const short *restrict vector, const unsigned short *block, Py_ssize_t n,
                                      short *restrict taken)
    {
        for (Py_ssize_t b = 0; b < n; b++)
            memcpy(taken + VT_BLOCK * b, vector + VT_BLOCK * block[b], VT_BLOCK * sizeof *taken);
    }

    /* Four rows at a time: the vector is read once for the four, and their sums are independent. */
    VT_WIDE static void vt_all_rows(const short *restrict weights, const int *restrict start,
                                    const unsigned short *restrict block, Py_ssize_t groups,
                                    const short *restrict vector, short *restrict taken, int *restrict sums)
    {
        for (Py_ssize_t g = 0; g < groups; g++) {
            const Py_ssize_t n = start[g + 1] - start[g], width = VT_BLOCK * n;
            const short *restrict r0 = weights + 4 * VT_BLOCK * (Py_ssize_t)start[g], *restrict r1 = r0 + width;
            const short *restrict r2 = r1 + width, *restrict r3 = r2 + width;
            int s0 = 0, s1 = 0, s2 = 0, s3 = 0;
            vt_take_blocks(vector, block + start[g], n, taken);
            for (Py_ssize_t i = 0; i < width; i++) {
                const int v = taken[i];
                s0 += r0[i] * v;
                s1 += r1[i] * v;
                s2 += r2[i] * v;
                s3 += r3[i] * v;
            }
            sums[4 * g] = s0, sums[4 * g + 1] = s1, sums[4 * g + 2] = s2, sums[4 * g + 3] = s3;
        }
    }

    VT_WIDE static void vt_some_rows(const short *restrict weights, const int *restrict start,
                                     const unsigned short *restrict block, const int *restrict which, Py_ssize_t n,
                                     const short *restrict vector, short *restrict taken, int *restrict sums)
    {
        Py_ssize_t last = -1;
        for (Py_ssize_t p = 0; p < n; p++) {
            const Py_ssize_t g = which[p] / 4, m = start[g + 1] - start[g], width = VT_BLOCK * m;
            const short *restrict row = weights + 4 * VT_BLOCK * (Py_ssize_t)start[g] + which[p] % 4 * width;
            int sum = 0;
            if (g != last) vt_take_blocks(vector, block + start[g], m, taken);
            last = g;
            for (Py_ssize_t i = 0; i < width; i++) sum += row[i] * taken[i];
            sums[p] = sum;
        }
    }
    """
    void vt_all_rows(
        const short *, const int *, const unsigned short *, Py_ssize_t, const short *, short *, int *
    ) noexcept nogil
    void vt_some_rows(
        const short *, const int *, const unsigned short *, const int *, Py_ssize_t, const short *, short *, int *
    ) noexcept nogil


cdef inline void all_rows(
    short[::1] weights, int[::1] start, unsigned short[::1] block, short[::1] vector, short[::1] taken, int[::1] sums
) noexcept nogil:
    vt_all_rows(&weights[0], &start[0], &block[0], start.shape[0] - 1, &vector[0], &taken[0], &sums[0])


cdef inline void some_rows(
    short[::1] weights, int[::1] start, unsigned short[::1] block, const int[::1] which, Py_ssize_t n,
    short[::1] vector, short[::1] taken, int[::1] sums
) noexcept nogil:
    if n:
        vt_some_rows(&weights[0], &start[0], &block[0], &which[0], n, &vector[0], &taken[0], &sums[0])
