# The three inner loops of `centroids` that baseline x86 runs too slowly as compiled Python, described in
# `windows.py`. The sums: 37 us a frame of 331 pins with SSE2, 10 us with the AVX2 clone, chosen when the
# program loads.

cdef extern from *:
    """
    #include <string.h>
    #if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
    #define VT_WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
    #else
    #define VT_WIDE
    #endif

    /* with a constant length a row compiles to two or four moves */
    #define VT_ROWS(BYTES) \
        for (; step < end; step += 2) row += step[0], memcpy(to, row, (size_t)(BYTES)), to += step[1]
    static inline void vt_copy_spans(const unsigned char *row, const Py_ssize_t *step, const Py_ssize_t *end,
                                     int bytes, unsigned char *to)
    {
        switch (bytes) {
        case 16: VT_ROWS(16); break;
        case 24: VT_ROWS(24); break;
        case 32: VT_ROWS(32); break;
        default: VT_ROWS(bytes);
        }
    }

    #define VT_SUMS(SQUARE) \
        do { \
            const short *restrict td = t, *restrict tx = t + n, *restrict ty = tx + n; \
            const short *restrict in = common, *restrict pu = common + n, *restrict pv = pu + n; \
            int d = 0, ex = 0, ey = 0, one = 0, u = 0, v = 0; \
            SQUARE w2 = 0; \
            for (int i = 0; i < n; i++) { \
                const short w = (short)(pixels[i] - low), within = (short)(w * in[i]); \
                d += w * td[i]; \
                ex += w * tx[i]; \
                ey += w * ty[i]; \
                one += w * in[i]; \
                u += w * pu[i]; \
                v += w * pv[i]; \
                w2 += w * within; \
            } \
            sums[0] = d, sums[1] = ex, sums[2] = ey, sums[3] = one, sums[4] = u, sums[5] = v, sums[6] = (double)w2; \
        } while (0)

    VT_WIDE static void vt_sums_of_bytes(const unsigned char *restrict pixels, short low, const short *t,
                                         const short *common, int n_, double *sums)
    {
        const int n = n_ & -32; /* n_ is a multiple of 32: tells the compiler that there is no remainder */
        VT_SUMS(int);
    }

    VT_WIDE static void vt_sums_of_shorts(const short *restrict pixels, int wide, const short *t,
                                          const short *common, int n_, double *sums)
    {
        const int n = n_ & -32;
        const short low = 0;
        if (wide) VT_SUMS(long long); /* squares of 12 bits overflow a sum of 32 bits */
        else VT_SUMS(int);
    }
    """
    void vt_copy_spans(const unsigned char *, const Py_ssize_t *, const Py_ssize_t *, int, unsigned char *) noexcept nogil
    void vt_sums_of_bytes(const unsigned char *, short, const short *, const short *, int, double *) noexcept nogil
    void vt_sums_of_shorts(const short *, int, const short *, const short *, int, double *) noexcept nogil


cdef inline void copy_spans(
    const unsigned char[:, :] image, Py_ssize_t x, Py_ssize_t y, Py_ssize_t[:, ::1] steps, Py_ssize_t begin,
    Py_ssize_t end, int row_bytes, unsigned char[::1] to
) noexcept nogil:
    vt_copy_spans(&image[y, x], &steps[begin, 0], &steps[begin, 0] + 2 * (end - begin), row_bytes, &to[0])


cdef inline void sums_of_bytes(
    unsigned char[::1] pixels, int level, short[::1] templates, Py_ssize_t at, Py_ssize_t common, int n, double[::1] sums
) noexcept nogil:
    vt_sums_of_bytes(&pixels[0], <short>level, &templates[at], &templates[common], n, &sums[0])


cdef inline void sums_of_shorts(
    short[::1] pixels, bint wide, short[::1] templates, Py_ssize_t at, Py_ssize_t common, int n, double[::1] sums
) noexcept nogil:
    vt_sums_of_shorts(&pixels[0], wide, &templates[at], &templates[common], n, &sums[0])
