# The inner loops of `centroids` that baseline x86 runs too slowly as compiled Python, described in `windows.py`.
# A frame of 331 pins: 37 us with SSE2, 10 us with the AVX2 clone, chosen when the program loads.

cdef extern from *:
    """
    #include <string.h>
    #if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
    #define VT_WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
    #else
    #define VT_WIDE
    #endif

    /* a row in one move, where the processor has it */
    typedef unsigned char vt_row16 __attribute__((vector_size(16), aligned(1), may_alias));
    typedef unsigned char vt_row32 __attribute__((vector_size(32), aligned(1), may_alias));

    #define VT_ROWS(COPY) \
        _Pragma("GCC unroll 4") \
        for (; step < end; step += 2) row += step[0], COPY, to += step[1]

    #define VT_SUMS(SQUARE) \
        do { \
            const short *restrict td = t, *restrict tx = t + n, *restrict ty = tx + n; \
            const short *restrict in = common, *restrict pu = common + n, *restrict pv = pu + n; \
            int d = 0, ex = 0, ey = 0, one = 0, u = 0, v = 0; \
            SQUARE w2 = 0; \
            _Pragma("GCC unroll 2") \
            for (int i = 0; i < n; i++) { \
                const short w = pixels[i], within = (short)(w * in[i]); \
                d += w * td[i]; \
                ex += w * tx[i]; \
                ey += w * ty[i]; \
                one += w * in[i]; \
                u += w * pu[i]; \
                v += w * pv[i]; \
                w2 += w * within; \
            } \
            const int six[6] = {d, ex, ey, one, u, v}; \
            for (int k = 0; k < 6; k++) sums[k] = six[k]; \
            sums[6] = (double)w2; \
        } while (0)

    VT_WIDE static void vt_sums_of_bytes(const unsigned char *row, const Py_ssize_t *step, const Py_ssize_t *end,
                                         int bytes, unsigned char *restrict pixels, const short *t,
                                         const short *common, int n_, double *sums)
    {
        const int n = n_ & -32; /* n_ is a multiple of 32: tells the compiler that there is no remainder */
        unsigned char *to = pixels;
        switch (bytes) {
        case 16: VT_ROWS(*(vt_row16 *)to = *(const vt_row16 *)row); break;
        case 32: VT_ROWS(*(vt_row32 *)to = *(const vt_row32 *)row); break;
        default: VT_ROWS(memcpy(to, row, (size_t)bytes));
        }
        VT_SUMS(int);
    }

    VT_WIDE static void vt_sums_of_shorts(const short *restrict pixels, int wide, const short *t,
                                          const short *common, int n_, double *sums)
    {
        const int n = n_ & -32;
        if (wide) VT_SUMS(long long); /* squares of 12 bits overflow a sum of 32 bits */
        else VT_SUMS(int);
    }
    """
    void vt_sums_of_bytes(
        const unsigned char *, const Py_ssize_t *, const Py_ssize_t *, int, unsigned char *, const short *,
        const short *, int, double *
    ) noexcept nogil
    void vt_sums_of_shorts(const short *, int, const short *, const short *, int, double *) noexcept nogil


cdef inline void sums_of_bytes(
    const unsigned char[:, :] image, Py_ssize_t x, Py_ssize_t y, Py_ssize_t[:, ::1] steps, Py_ssize_t begin,
    Py_ssize_t end, int row_bytes, unsigned char[::1] pixels, short[::1] templates, Py_ssize_t at,
    Py_ssize_t common, int n, double[::1] sums
) noexcept nogil:
    vt_sums_of_bytes(
        &image[y, x], &steps[begin, 0], &steps[begin, 0] + 2 * (end - begin), row_bytes, &pixels[0],
        &templates[at], &templates[common], n, &sums[0]
    )


cdef inline void sums_of_shorts(
    short[::1] pixels, bint wide, short[::1] templates, Py_ssize_t at, Py_ssize_t common, int n, double[::1] sums
) noexcept nogil:
    vt_sums_of_shorts(&pixels[0], wide, &templates[at], &templates[common], n, &sums[0])
