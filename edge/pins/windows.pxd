# The inner loops of `centroids` that baseline x86 runs too slowly as compiled Python, described in `windows.py`. A
# frame of 331 pins: 512,000 instructions of plain C with SSE2, 128,000 with AVX2, chosen at run time. That has a loop
# of its own, since GCC 12 makes 237,000 of the plain one with AVX2.

cdef extern from *:
    """
    #include <string.h>
    #if defined(__x86_64__) && defined(__GNUC__)
    #define VT_AVX2
    #include <immintrin.h>
    #endif
    #if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
    #define VT_WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
    #else
    #define VT_WIDE
    #endif

    typedef struct {
        Py_ssize_t half, first_span, end_span, first_step, end_step, row_bytes, first, first_uv, plane, pixels;
    } vt_kind;
    typedef struct {
        Py_ssize_t row, end, stride, first, beyond, rows, ahead;
    } vt_fetch;

    #define VT_PHASES 4
    #define VT_ROWS 6 /* copied at once; LANES steps behind a kind's are zero */
    #define VT_LINE 64 /* bytes that memory gives at a time */
    #define VT_SUM 8 /* numbers of a window */
    #define VT_NORM 24 /* and of a phase, in the order of NORM */

    /* a row in one move, where the processor has it */
    typedef unsigned char vt_row16 __attribute__((vector_size(16), aligned(1), may_alias));
    typedef unsigned char vt_row32 __attribute__((vector_size(32), aligned(1), may_alias));

    #define VT_COPY_ROWS(COPY) \
        do { \
            _Pragma("GCC unroll 6") \
            for (int k = 0; k < VT_ROWS; k++, step += 2) row += step[0], COPY, to += step[1]; \
        } while (step < end)

    #define VT_SUMS(SQUARE) \
        do { \
            const short *restrict td = t, *restrict tx = t + n, *restrict ty = tx + n; \
            const signed char *restrict pu = uv, *restrict pv = uv + n; \
            int d = 0, ex = 0, ey = 0, one = 0, u = 0, v = 0; \
            SQUARE w2 = 0; \
            _Pragma("GCC unroll 2") \
            for (Py_ssize_t i = 0; i < n; i++) { \
                const short w = pixels[i], u2 = 2 * pu[i], v2 = 2 * pv[i]; /* 16 bits: multiplied in pairs */ \
                d += w * td[i]; \
                ex += w * tx[i]; \
                ey += w * ty[i]; \
                one += w; \
                u += w * u2; \
                v += w * v2; \
                w2 += w * w; \
            } \
            const double whole[8] = {d, ex, ey, one, u / 2, v / 2, (double)w2, 1}; \
            for (int k = 0; k < 8; k++) sums[k] = whole[k] * norm[k]; \
        } while (0)

    typedef void vt_sums_of(const unsigned char *restrict pixels, const short *t, const signed char *uv,
                            Py_ssize_t n_, const double *norm, double *sums);

    static inline void vt_sums_plain(const unsigned char *restrict pixels, const short *t, const signed char *uv,
                                     Py_ssize_t n_, const double *norm, double *sums)
    {
        const Py_ssize_t n = n_ & -32; /* n_ is a multiple of 32: tells the compiler that there is no remainder */
        VT_SUMS(int);
    }

    VT_WIDE static void vt_sum_shorts(const short *restrict pixels, int wide, const short *t, const signed char *uv,
                              Py_ssize_t n_, const double *norm, double *sums)
    {
        const Py_ssize_t n = n_ & -32;
        if (wide) VT_SUMS(long long); /* squares of 12 bits overflow a sum of 32 bits */
        else VT_SUMS(int);
    }

    #ifdef VT_AVX2
    typedef int vt_ints __attribute__((vector_size(32)));
    #define VT_LOAD(p) _mm256_loadu_si256((const __m256i *)(p))
    #define VT_WIDEN(p) _mm256_cvtepu8_epi16(_mm_loadu_si128((const __m128i *)(p)))
    #define VT_PAIRS(a, b) ((vt_ints)_mm256_madd_epi16(a, b))

    __attribute__((target("avx2")))
    static inline void vt_sums_avx2(const unsigned char *restrict pixels, const short *t, const signed char *uv,
                                    Py_ssize_t n, const double *norm, double *sums)
    {
        const __m256i zero = _mm256_setzero_si256(), ones = _mm256_set1_epi16(1);
        const short *const tx = t + n, *const ty = tx + n;
        const signed char *const pv = uv + n;
        vt_ints d = {0}, ex = {0}, ey = {0}, one = {0}, u = {0}, v = {0}, w2 = {0};
        Py_ssize_t i = 0;
        _Pragma("GCC unroll 2")
        do {
            const __m256i w = VT_LOAD(pixels + i), a = VT_WIDEN(pixels + i), b = VT_WIDEN(pixels + i + 16);
            d += VT_PAIRS(a, VT_LOAD(t + i)) + VT_PAIRS(b, VT_LOAD(t + i + 16));
            ex += VT_PAIRS(a, VT_LOAD(tx + i)) + VT_PAIRS(b, VT_LOAD(tx + i + 16));
            ey += VT_PAIRS(a, VT_LOAD(ty + i)) + VT_PAIRS(b, VT_LOAD(ty + i + 16));
            one += (vt_ints)_mm256_sad_epu8(w, zero);
            u += VT_PAIRS(_mm256_maddubs_epi16(w, VT_LOAD(uv + i)), ones); /* 2 x 255 x 39 are 16 bits */
            v += VT_PAIRS(_mm256_maddubs_epi16(w, VT_LOAD(pv + i)), ones);
            w2 += VT_PAIRS(a, a) + VT_PAIRS(b, b);
        } while ((i += 32) < n);
        #define VT_HADD(a, b) _mm256_hadd_epi32((__m256i)(a), (__m256i)(b))
        const __m256i four = VT_HADD(VT_HADD(d, ex), VT_HADD(ey, one));
        const __m256i three = VT_HADD(VT_HADD(u, v), VT_HADD(w2, zero));
        const __m128i low = _mm_add_epi32(_mm256_castsi256_si128(four), _mm256_extracti128_si256(four, 1));
        const __m128i high = _mm_add_epi32(_mm256_castsi256_si128(three), _mm256_extracti128_si256(three, 1))
                             | _mm_set_epi32(1, 0, 0, 0);
        _mm256_storeu_pd(sums, _mm256_mul_pd(_mm256_cvtepi32_pd(low), _mm256_loadu_pd(norm)));
        _mm256_storeu_pd(sums + 4, _mm256_mul_pd(_mm256_cvtepi32_pd(high), _mm256_loadu_pd(norm + 4)));
    }
    #endif

    static inline unsigned char *vt_take_rows(const unsigned char *row, const Py_ssize_t *step,
                                              const Py_ssize_t *end, Py_ssize_t bytes, unsigned char *to)
    {
        switch (bytes) {
        case 16: VT_COPY_ROWS(*(vt_row16 *)to = *(const vt_row16 *)row); break;
        case 32: VT_COPY_ROWS(*(vt_row32 *)to = *(const vt_row32 *)row); break;
        default: VT_COPY_ROWS(memcpy(to, row, (size_t)bytes));
        }
        return to;
    }

    /* the next rows of the image into the cache */
    static inline void vt_fetch_rows(const unsigned char *image, vt_fetch *f, Py_ssize_t begin)
    {
        const Py_ssize_t most = f->row + f->rows * f->stride, ahead = begin + f->ahead;
        const Py_ssize_t until = most < ahead ? most : ahead, end = until < f->end ? until : f->end;
        for (; f->row < end; f->row += f->stride) {
            const unsigned char *line = image + f->row + f->first, *const beyond = image + f->row + f->beyond;
            for (; line < beyond; line += VT_LINE) __builtin_prefetch(line);
        }
    }

    /* one number of each of four pins */
    typedef double vt_four __attribute__((vector_size(32)));
    typedef long long vt_mask __attribute__((vector_size(32)));
    typedef int vt_four_ints __attribute__((vector_size(16)));
    #define VT_GATHER(of, i) {of[i[0]], of[i[1]], of[i[2]], of[i[3]]}

    VT_WIDE static Py_ssize_t vt_place(const int *norm_of, const double *inner, int stride, const double *xy, int *who,
                                       Py_ssize_t n, int *others, int *at, int *begin, double *x_of, double *y_of)
    {
        vt_four_ints beyond = {0};
        for (Py_ssize_t j = n; j < (n + 3) / 4 * 4; j++) who[j] = who[n - 1];
        for (Py_ssize_t j = 0; j < n; j += 4) {
            const Py_ssize_t i[4] = {who[j], who[j + 1], who[j + 2], who[j + 3]};
            const vt_four px = {xy[2 * i[0]], xy[2 * i[1]], xy[2 * i[2]], xy[2 * i[3]]};
            const vt_four py = {xy[2 * i[0] + 1], xy[2 * i[1] + 1], xy[2 * i[2] + 1], xy[2 * i[3] + 1]};
            const vt_four x4 = px * (double)VT_PHASES + 2.0, y4 = py * (double)VT_PHASES + 2.0;
            const vt_mask within = (x4 >= inner[0]) & (y4 >= inner[1]) & (x4 < inner[2]) & (y4 < inner[3]);
            /* elsewhere, and there only, they are 0 */
            const vt_four_ints x = __builtin_convertvector((vt_four)((vt_mask)x4 & within), vt_four_ints);
            const vt_four_ints y = __builtin_convertvector((vt_four)((vt_mask)y4 & within), vt_four_ints);
            const vt_four_ints row = (y & 3) * VT_PHASES + (x & 3) + (vt_four_ints)VT_GATHER(norm_of, i);
            const vt_four_ints rows = row | (x == 0), begins = (y >> 2) * stride + (x >> 2);
            const vt_four middle_x = __builtin_convertvector(x, vt_four) * 0.25 - 0.375;
            const vt_four middle_y = __builtin_convertvector(y, vt_four) * 0.25 - 0.375;
            beyond |= rows;
            memcpy(at + j, &rows, sizeof rows);
            memcpy(begin + j, &begins, sizeof begins);
            memcpy(x_of + j, &middle_x, sizeof middle_x);
            memcpy(y_of + j, &middle_y, sizeof middle_y);
        }
        if ((beyond[0] | beyond[1] | beyond[2] | beyond[3]) >= 0) return n;
        Py_ssize_t taken = 0;
        for (Py_ssize_t j = 0; j < n; j++) {
            if (at[j] < 0) {
                *others++ = who[j];
                continue;
            }
            who[taken] = who[j], at[taken] = at[j], begin[taken] = begin[j];
            x_of[taken] = x_of[j], y_of[taken++] = y_of[j];
        }
        return taken;
    }

    #define VT_WINDOWS_ARGUMENTS \
        const unsigned char *image, vt_fetch *fetch, const int *begin, const int *at, Py_ssize_t n, \
        const vt_kind *kinds, const Py_ssize_t *steps, const short *values, const signed char *uv, \
        const double *norms, unsigned char *pixels, int dark, double *sums

    __attribute__((always_inline))
    static inline void vt_sum_windows_by(vt_sums_of *sums_of, VT_WINDOWS_ARGUMENTS)
    {
        for (Py_ssize_t j = 0; j < n; j++, sums += VT_SUM) {
            const unsigned phase = (unsigned)at[j] % (VT_PHASES * VT_PHASES);
            const vt_kind *const k = kinds + (unsigned)at[j] / (VT_PHASES * VT_PHASES);
            vt_fetch_rows(image, fetch, begin[j]);
            memset(vt_take_rows(image + begin[j], steps + 2 * k->first_step, steps + 2 * k->end_step, k->row_bytes,
                                pixels), 0, 32);
            sums_of(pixels, values + k->first + 3 * k->plane * phase, uv + k->first_uv, k->plane,
                    norms + VT_NORM * (Py_ssize_t)at[j], sums);
            if (dark) { /* of 255 less each level; the sums of the other templates are 0 */
                const double white = 255.0 * (double)k->pixels;
                sums[6] += 255.0 * (white - 2.0 * sums[3]);
                sums[3] = white - sums[3];
                for (int m = 0; m < 6; m++) if (m != 3) sums[m] = -sums[m];
            }
        }
    }

    #define VT_WINDOWS image, fetch, begin, at, n, kinds, steps, values, uv, norms, pixels, dark, sums

    #ifdef VT_AVX2
    __attribute__((target("avx2"))) static void vt_sum_windows_avx2(VT_WINDOWS_ARGUMENTS)
    {
        vt_sum_windows_by(vt_sums_avx2, VT_WINDOWS);
    }
    #endif

    static void vt_sum_windows(VT_WINDOWS_ARGUMENTS)
    {
    #ifdef VT_AVX2
        if (__builtin_cpu_supports("avx2")) vt_sum_windows_avx2(VT_WINDOWS);
        else
    #endif
        vt_sum_windows_by(vt_sums_plain, VT_WINDOWS);
    }
    """
    ctypedef struct Kind "vt_kind":
        Py_ssize_t half, first_span, end_span, first_step, end_step, row_bytes, first, first_uv, plane, pixels
    ctypedef struct Fetch "vt_fetch":
        Py_ssize_t row, end, stride, first, beyond, rows, ahead

    Py_ssize_t vt_place(
        const int *, const double *, int, const double *, int *, Py_ssize_t, int *, int *, int *, double *, double *
    ) noexcept nogil
    void vt_sum_windows(
        const unsigned char *, Fetch *, const int *, const int *, Py_ssize_t, const Kind *, const Py_ssize_t *,
        const short *, const signed char *, const double *, unsigned char *, bint, double *
    ) noexcept nogil
    void vt_sum_shorts(
        const short *, int, const short *, const signed char *, Py_ssize_t, const double *, double *
    ) noexcept nogil


cdef inline Py_ssize_t place(
    int[::1] norm_of, double[::1] inner, int stride, double[:, ::1] xy, int[::1] who, Py_ssize_t n,
    int[::1] others, int[::1] at, int[::1] begin, double[:, ::1] middle
) noexcept nogil:
    return vt_place(
        &norm_of[0], &inner[0], stride, &xy[0, 0], &who[0], n, &others[0], &at[0], &begin[0], &middle[0, 0],
        &middle[1, 0]
    )


cdef inline void sum_windows(
    const unsigned char[:, :] image, Fetch[::1] fetch, int[::1] begin, int[::1] at, Py_ssize_t n,
    Kind[::1] kinds, Py_ssize_t[:, ::1] steps, short[::1] values, signed char[::1] uv, double[:, ::1] norms,
    unsigned char[::1] pixels, bint dark, double[:, ::1] sums
) noexcept nogil:
    vt_sum_windows(
        &image[0, 0], &fetch[0], &begin[0], &at[0], n, &kinds[0], &steps[0, 0], &values[0], &uv[0], &norms[0, 0],
        &pixels[0], dark, &sums[0, 0]
    )


cdef inline void sum_shorts(
    short[::1] window, bint wide, short[::1] values, Py_ssize_t first, signed char[::1] uv, Py_ssize_t first_uv,
    Py_ssize_t plane, double[::1] norm, double[::1] sums
) noexcept nogil:
    vt_sum_shorts(&window[0], wide, &values[first], &uv[first_uv], plane, &norm[0], &sums[0])
