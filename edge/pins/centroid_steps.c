/* Sums over pins' windows of an 8-bit image, a fifth to a quarter of a whole step, and `centroids`' steps from them;
 * `centroid_steps.py` describes both, and is the same for uncompiled runs to the last bit.
 *
 * All sums are exact integers. The support's pixels are copied together, row after row, which takes a fifth of the
 * instructions; then seven sums are formed in one pass. AVX2, chosen at run time, and NEON have loops of their own: GCC
 * needs 2 and 1.3 times as many instructions for the plain one. Steps are of as many pins at a time as vectors hold.
 */
#include <math.h>
#include <string.h>
#if defined(__x86_64__) && defined(__GNUC__)
#define VT_AVX2
#define VT_PINS 4 /* numbers that a vector holds; steps are of as many pins at once */
#include <immintrin.h>
#else
#define VT_PINS 2
#endif
#if defined(__aarch64__) && defined(__ARM_NEON)
#define VT_NEON
#include <arm_neon.h>
#endif

typedef struct {
    Py_ssize_t first_span, end_span, first_step, end_step, first, first_uv, plane, pixels;
} vt_kind;
typedef struct {
    Py_ssize_t row, end, stride, first, beyond, rows, ahead;
} vt_fetch;

/* The reading of an image shares this, as `reading_of` describes it. */
typedef struct {
    const unsigned char *image;
    vt_fetch *fetch;
    const vt_kind *kinds;
    const Py_ssize_t *steps;
    const short *values;
    const signed char *uv;
    const double *norms;
    unsigned char *pixels;
    double *sums;
    const double *predicted, *inner;
    const int *norm_of;
    Py_ssize_t stride, side;
    double reach2, noise2, gain;
    int dark;
    double *xy, *sigma, *amplitude, *fit;
} vt_reading;

#define VT_PHASES 16
#define VT_NORM 24 /* numbers of a phase, in the order of NORM */
#define VT_UNROLL 6 /* steps at once: each kind has a multiple of it */
#define VT_LANES (8 * VT_PINS) /* bytes of a vector, which are copied at once */
#define VT_LINE 64 /* bytes that memory gives at a time */

typedef unsigned char vt_lanes __attribute__((vector_size(VT_LANES), aligned(1), may_alias));

/* Copy the rows of a window one after the other, in pieces, of which the next one overwrites what is too many. */
static inline void vt_take_rows(const unsigned char *middle, const Py_ssize_t *step, const Py_ssize_t *end,
                                unsigned char *to)
{
    do {
        _Pragma("GCC unroll 6")
        for (int k = 0; k < VT_UNROLL; k++, step += 2) {
            Py_ssize_t from = step[0];
            __asm__("" : "+r"(from)); /* else GCC adds it to the address by an instruction of its own */
            *(vt_lanes *)(to + step[1]) = *(const vt_lanes *)(middle + from);
        }
    } while (step < end);
}

#define VT_SIDE 4 /* px, of a block */
#define VT_MIDDLE (128 * VT_SIDE * VT_SIDE) /* of a block's sum: less it, squares fit 32 bits */
typedef unsigned short vt_pairs __attribute__((vector_size(32), aligned(1), may_alias));
typedef unsigned vt_words __attribute__((vector_size(32)));
typedef short vt_blocks __attribute__((vector_size(16), aligned(1), may_alias));

/* This does the same with blocks, eight at once: each pixel is the sum of one. */
static inline void vt_add_rows(const unsigned char *middle, const Py_ssize_t *step, const Py_ssize_t *end,
                               Py_ssize_t stride, short *to)
{
    for (; step < end; step += 2) {
        vt_pairs sum = {0};
        for (int k = 0; k < VT_SIDE; k++) {
            const vt_pairs pairs = *(const vt_pairs *)(middle + step[0] + k * stride);
            sum += (pairs & 255) + (pairs >> 8);
        }
        const vt_words four = ((vt_words)sum & 65535) + ((vt_words)sum >> 16);
        *(vt_blocks *)(to + step[1]) = __builtin_convertvector(four - VT_MIDDLE, vt_blocks);
    }
}

/* The next rows of the image into the cache. */
static inline void vt_fetch_rows(const unsigned char *image, vt_fetch *f, Py_ssize_t begin)
{
    const Py_ssize_t most = f->row + f->rows * f->stride, ahead = begin + f->ahead;
    const Py_ssize_t until = most < ahead ? most : ahead, end = until < f->end ? until : f->end;
    for (; f->row < end; f->row += f->stride) {
        const unsigned char *line = image + f->row + f->first, *const beyond = image + f->row + f->beyond;
        for (; line < beyond; line += 4 * VT_LINE)
            for (int k = 0; k < 4; k++) __builtin_prefetch(line + k * VT_LINE);
    }
}

/* Loops are compiled for each processor: AVX2 needs a fifth less instructions, as it overwrites no operand. */
#define VT_INLINE __attribute__((always_inline))

typedef void vt_sums_of(const unsigned char *restrict pixels, const short *t, const signed char *uv, const vt_kind *k,
                        const double *norm, double *sums);

/* The sums of bytes, or of blocks less their `middle`. */
VT_INLINE static inline void vt_sums_by(const unsigned char *restrict bytes, const short *restrict blocks, int middle,
                                        const short *t, const signed char *uv, const vt_kind *kind,
                                        const double *norm, double *sums)
{
    const Py_ssize_t n = kind->plane & -32; /* is a multiple of 32: tells the compiler that there is no remainder */
    const short *restrict td = t, *restrict tx = t + n, *restrict ty = tx + n;
    const signed char *restrict pu = uv, *restrict pv = uv + n;
    int d = 0, ex = 0, ey = 0, one = 0, u = 0, v = 0;
    unsigned w2 = 0;
    _Pragma("GCC unroll 2")
    for (Py_ssize_t i = 0; i < n; i++) {
        const short w = bytes ? bytes[i] : blocks[i], u1 = pu[i], v1 = pv[i]; /* 16 bits: multiplied in pairs */
        d += w * td[i];
        ex += w * tx[i];
        ey += w * ty[i];
        one += w;
        u += w * u1;
        v += w * v1;
        w2 += (unsigned)(w * w);
    }
    const double all = middle * (double)kind->pixels; /* the sums of the other templates are 0 */
    const double whole[8] = {d, ex, ey, one + all, u, v, w2 + middle * (2.0 * one + all), 1};
    for (int k = 0; k < 8; k++) sums[k] = whole[k] * norm[k];
}

static inline void vt_sums_plain(const unsigned char *restrict pixels, const short *t, const signed char *uv,
                                 const vt_kind *k, const double *norm, double *sums)
{
    vt_sums_by(pixels, 0, 0, t, uv, k, norm, sums);
}

#ifdef VT_AVX2
typedef int vt_ints __attribute__((vector_size(32)));
#define VT_LOAD(p) _mm256_loadu_si256((const __m256i *)(p))
#define VT_WIDEN(p) _mm256_cvtepu8_epi16(_mm_loadu_si128((const __m128i *)(p)))
#define VT_PAIRS(a, b) ((vt_ints)_mm256_madd_epi16(a, b))
#define VT_HADD(a, b) _mm256_hadd_epi32((__m256i)(a), (__m256i)(b))

__attribute__((target("avx2"))) static inline void vt_sums_avx2(const unsigned char *restrict pixels,
                                                                const short *t, const signed char *uv,
                                                                const vt_kind *k, const double *norm, double *sums)
{
    const Py_ssize_t n = k->plane;
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
        u += VT_PAIRS(_mm256_maddubs_epi16(w, VT_LOAD(uv + i)), ones); /* 2 x 255 x 64 are 16 bits */
        v += VT_PAIRS(_mm256_maddubs_epi16(w, VT_LOAD(pv + i)), ones);
        w2 += VT_PAIRS(a, a) + VT_PAIRS(b, b);
    } while ((i += 32) < n);
    const __m256i four = VT_HADD(VT_HADD(d, ex), VT_HADD(ey, one));
    const __m256i three = VT_HADD(VT_HADD(u, v), VT_HADD(w2, zero));
    const __m128i low = _mm_add_epi32(_mm256_castsi256_si128(four), _mm256_extracti128_si256(four, 1));
    const __m128i high = _mm_add_epi32(_mm256_castsi256_si128(three), _mm256_extracti128_si256(three, 1))
                         | _mm_set_epi32(1, 0, 0, 0);
    _mm256_storeu_pd(sums, _mm256_mul_pd(_mm256_cvtepi32_pd(low), _mm256_loadu_pd(norm)));
    _mm256_storeu_pd(sums + 4, _mm256_mul_pd(_mm256_cvtepi32_pd(high), _mm256_loadu_pd(norm + 4)));
}
#endif

#ifdef VT_NEON
#define VT_STAY __asm__ volatile("" ::: "memory") /* no load before it: there are too few registers for all at once */
#define VT_ADD(sum, p) \
    do { \
        VT_STAY; \
        const int16x8x4_t q = vld1q_s16_x4(p); \
        for (int m = 0; m < 4; m++) \
            sum = vmlal_high_s16(vmlal_s16(sum, vget_low_s16(a[m]), vget_low_s16(q.val[m])), a[m], q.val[m]); \
        p += 32; \
    } while (0)
#define VT_ADD_SIGNED(sum, p) /* 4 x 128 x half is 16 bits */ \
    do { \
        VT_STAY; \
        const int8x16x2_t q = vld1q_s8_x2(p); \
        const int16x8_t two = vmlal_high_s8(vmull_s8(vget_low_s8(s[0]), vget_low_s8(q.val[0])), s[0], q.val[0]); \
        const int16x8_t three = vmlal_s8(two, vget_low_s8(s[1]), vget_low_s8(q.val[1])); \
        sum = vpadalq_s16(sum, vmlal_high_s8(three, s[1], q.val[1])); \
        p += 32; \
    } while (0)
#define VT_SQUARES(s) vreinterpretq_u16_s16(vmlal_high_s8(vmull_s8(vget_low_s8(s), vget_low_s8(s)), s, s))
#define VT_DOUBLES(a) vcvtq_f64_s64(vmovl_s32(a))

/* Subtracting 128 from each pixel changes no sum with columns or rows, as theirs are 0. The sum of squares follows from
 * that of its squares, of which two are 16 bits, and that of the pixels. */
static inline void vt_sums_neon(const unsigned char *restrict w, const short *t, const signed char *uv, const vt_kind *k,
                                const double *norm, double *sums)
{
    const Py_ssize_t n = k->plane;
    const short *tx = t + n, *ty = tx + n;
    const signed char *pv = uv + n;
    const unsigned char *const end = w + n;
    int32x4_t d = {0}, ex = {0}, ey = {0}, u = {0}, v = {0};
    uint32x4_t one = {0}, w2 = vdupq_n_u32(-4096 * (unsigned)n); /* a quarter of 128 x 128 */
    const uint8x16_t middle = vdupq_n_u8(128);
    do {
        const uint8x16x2_t p = vld1q_u8_x2(w);
        int16x8_t a[4];
        int8x16_t s[2];
        for (int m = 0; m < 2; m++) {
            a[2 * m] = vreinterpretq_s16_u16(vmovl_u8(vget_low_u8(p.val[m])));
            a[2 * m + 1] = vreinterpretq_s16_u16(vmovl_high_u8(p.val[m]));
            s[m] = vreinterpretq_s8_u8(veorq_u8(p.val[m], middle));
        }
        one = vpadalq_u16(one, vpadalq_u8(vpaddlq_u8(p.val[0]), p.val[1]));
        w2 = vpadalq_u16(vpadalq_u16(w2, VT_SQUARES(s[0])), VT_SQUARES(s[1]));
        VT_ADD(d, t);
        VT_ADD(ex, tx);
        VT_ADD(ey, ty);
        VT_ADD_SIGNED(u, uv);
        VT_ADD_SIGNED(v, pv);
    } while ((w += 32) < end);
    const int32x4_t level = vreinterpretq_s32_u32(one), square = vreinterpretq_s32_u32(vmlaq_n_u32(w2, one, 256));
    const int32x4_t four = vpaddq_s32(vpaddq_s32(d, ex), vpaddq_s32(ey, level));
    const int32x4_t rest = vpaddq_s32(vpaddq_s32(u, v), vpaddq_s32(square, (int32x4_t){1}));
    vst1q_f64(sums, vmulq_f64(VT_DOUBLES(vget_low_s32(four)), vld1q_f64(norm)));
    vst1q_f64(sums + 2, vmulq_f64(VT_DOUBLES(vget_high_s32(four)), vld1q_f64(norm + 2)));
    vst1q_f64(sums + 4, vmulq_f64(VT_DOUBLES(vget_low_s32(rest)), vld1q_f64(norm + 4)));
    vst1q_f64(sums + 6, vmulq_f64(VT_DOUBLES(vget_high_s32(rest)), vld1q_f64(norm + 6)));
}
#define VT_SUMS vt_sums_neon
#else
#define VT_SUMS vt_sums_plain
#endif

/* A pin's window, and where its step begins, px. */
typedef struct {
    double x, y;
    size_t pin, norm, begin;
    const double *norms; /* the row `norm` of them */
} vt_start;

/* The sums of n windows, 8 each; sums_of: of bytes; none: of blocks. */
VT_INLINE static inline void vt_sum_windows_by(vt_sums_of *sums_of, const vt_reading *reading, const vt_start *from,
                                               Py_ssize_t n, double *sums)
{
    const vt_reading w = *reading;
    for (; n > 0; n--, from++, sums += 8) {
        const vt_kind *const k = w.kinds + from->norm / VT_PHASES;
        const unsigned char *const middle = w.image + from->begin;
        const Py_ssize_t *const step = w.steps + 2 * k->first_step, *const end = w.steps + 2 * k->end_step;
        const short *const t = w.values + k->first + 3 * k->plane * (from->norm % VT_PHASES);
        const signed char *const uv = w.uv + k->first_uv;
        if (n % 4 == 0) vt_fetch_rows(w.image, w.fetch, (Py_ssize_t)from->begin);
        if (sums_of) {
            vt_take_rows(middle, step, end, w.pixels);
            memset(w.pixels + k->pixels, 0, 32);
            sums_of(w.pixels, t, uv, k, from->norms, sums);
        } else {
            short *const blocks = (short *)w.pixels;
            vt_add_rows(middle, step, end, w.stride, blocks);
            memset(blocks + k->pixels, 0, 64);
            vt_sums_by(0, blocks, VT_MIDDLE, t, uv, k, from->norms, sums);
        }
        if (w.dark) { /* of the brightest less each level; the sums of the other templates are 0 */
            const double most = sums_of ? 255.0 : 255.0 * VT_SIDE * VT_SIDE, white = most * (double)k->pixels;
            sums[6] += most * (white - 2.0 * sums[3]);
            sums[3] = white - sums[3];
            for (int m = 0; m < 6; m++) if (m != 3) sums[m] = -sums[m];
        }
    }
}

#define VT_SUM_WINDOWS(name, sums_of, target) \
    target static void name(const vt_reading *w, const vt_start *from, Py_ssize_t n, double *sums) \
    { \
        vt_sum_windows_by(sums_of, w, from, n, sums); \
    }
VT_SUM_WINDOWS(vt_sum_windows_plain, VT_SUMS, )
VT_SUM_WINDOWS(vt_sum_blocks, 0, )
#ifdef VT_AVX2
VT_SUM_WINDOWS(vt_sum_windows_avx2, vt_sums_avx2, __attribute__((target("avx2"))))
VT_SUM_WINDOWS(vt_sum_blocks_avx2, 0, __attribute__((target("avx2"))))
#endif

static void vt_sum_windows(const vt_reading *w, const vt_start *from, Py_ssize_t n, double *sums)
{
#ifdef VT_AVX2
    if (__builtin_cpu_supports("avx2")) {
        (w->side > 1 ? vt_sum_blocks_avx2 : vt_sum_windows_avx2)(w, from, n, sums);
        return;
    }
#endif
    (w->side > 1 ? vt_sum_blocks : vt_sum_windows_plain)(w, from, n, sums);
}

typedef double vt_two __attribute__((vector_size(16)));
typedef double vt_any_two __attribute__((vector_size(16), aligned(8), may_alias));
typedef long long vt_mask_two __attribute__((vector_size(16)));
typedef double vt_pins __attribute__((vector_size(VT_LANES)));
typedef double vt_any_pins __attribute__((vector_size(VT_LANES), aligned(8), may_alias));
typedef long long vt_mask __attribute__((vector_size(VT_LANES)));

#define VT_WHERE(mask, a) ((vt_pins)((vt_mask)(a) & (mask)))
/* The numbers k to k + 3 of each pin's row. */
#ifdef __clang__
#define VT_MIX __builtin_shufflevector
#else
#define VT_MIX(p, q, ...) __builtin_shuffle(p, q, (vt_mask){__VA_ARGS__})
#endif
#if VT_PINS == 4
#define VT_COLUMNS(row, k, a, b, c, d) \
    const vt_pins a##_0 = *(const vt_any_pins *)(row[0] + k), a##_1 = *(const vt_any_pins *)(row[1] + k); \
    const vt_pins a##_2 = *(const vt_any_pins *)(row[2] + k), a##_3 = *(const vt_any_pins *)(row[3] + k); \
    const vt_pins a##_ = VT_MIX(a##_0, a##_1, 0, 4, 2, 6), b##_ = VT_MIX(a##_0, a##_1, 1, 5, 3, 7); \
    const vt_pins c##_ = VT_MIX(a##_2, a##_3, 0, 4, 2, 6), d##_ = VT_MIX(a##_2, a##_3, 1, 5, 3, 7); \
    const vt_pins a = VT_MIX(a##_, c##_, 0, 1, 4, 5), b = VT_MIX(b##_, d##_, 0, 1, 4, 5); \
    const vt_pins c = VT_MIX(a##_, c##_, 2, 3, 6, 7), d = VT_MIX(b##_, d##_, 2, 3, 6, 7)
#else
#define VT_COLUMNS(row, k, a, b, c, d) \
    const vt_pins a##_0 = *(const vt_any_pins *)(row[0] + k), a##_1 = *(const vt_any_pins *)(row[1] + k); \
    const vt_pins a##_2 = *(const vt_any_pins *)(row[0] + k + 2), a##_3 = *(const vt_any_pins *)(row[1] + k + 2); \
    const vt_pins a = VT_MIX(a##_0, a##_1, 0, 2), b = VT_MIX(a##_0, a##_1, 1, 3); \
    const vt_pins c = VT_MIX(a##_2, a##_3, 0, 2), d = VT_MIX(a##_2, a##_3, 1, 3)
#endif

/* Shorten a step that is too long; whether it ends near enough to the prediction. */
static int vt_is_within_reach(const vt_reading *s, const vt_start *from, double ex, double ey)
{
    double *const xy = s->xy + 2 * from->pin;
    const double *const at = s->predicted + 2 * from->pin;
    const double length = sqrt(ex * ex + ey * ey), longest = from->norms[20];
    if (length > longest) xy[0] = from->x + longest / length * ex, xy[1] = from->y + longest / length * ey;
    const double dx = xy[0] - at[0], dy = xy[1] - at[1];
    return dx * dx + dy * dy <= s->reach2;
}

/* A step of VT_PINS pins from their sums. Returns the sum of 1 << k of each k-th one that has to go on. */
VT_INLINE static inline int vt_step_some(const vt_reading *s, const double *sums, const vt_start *from, double near2,
                                         double far2, int first)
{
    const double *sum[VT_PINS], *norm[VT_PINS];
    for (int k = 0; k < VT_PINS; k++) sum[k] = sums + 8 * k, norm[k] = from[k].norms;
    /* The numbers are taken where they are used, as there are few registers; they are numbered as in NORM. */
    VT_COLUMNS(sum, 0, a, tx, ty, level);
    VT_COLUMNS(norm, 8, inv_d, x_d, y_d, x_u);
    const vt_pins inverse = 1.0 / a, a2 = a * a, near_ex = tx * x_d, near_ey = ty * y_d;
    const vt_mask seen = a > 0.0, is_near = near_ex * near_ex + near_ey * near_ey <= far2 * a2;
    const vt_pins amplitude = VT_WHERE(seen, a * inv_d * s->gain), disc = x_d * x_d + y_d * y_d;
    VT_COLUMNS(sum, 4, u, v, square, inv_pixels);
    VT_COLUMNS(norm, 12, y_v, d_u, tx_u, d_v);
    VT_COLUMNS(norm, 16, ty_v, freedom, inv_freedom, radius);
    const vt_pins su = u + d_u * a, sv = v + d_v * a, gu = su + tx_u * tx, gv = sv + ty_v * ty;
    const vt_pins gu2 = gu * gu, gv2 = gv * gv;
    const vt_pins energy = square - level * level * inv_pixels, left = energy - gu * su - gv * sv;
    const vt_pins rest = energy - a2 - tx * tx - ty * ty - gu2 - gv2;
    const vt_pins missing = rest - freedom * (s->noise2 + 1.0 / 12.0);
    const vt_pins m = VT_WHERE((missing > 0.0) & (left > 0.0), missing / left), hidden = radius * m * m;
    vt_pins variance = VT_WHERE(rest > 0.0, rest) * inv_freedom;
    if (s->side > 1) { /* The residual beyond the noise is alike in all pixels of a block. */
        const vt_pins more = variance - s->noise2;
        variance -= (1.0 - 1.0 / (double)(s->side * s->side)) * VT_WHERE(more > 0.0, more);
    }
    variance += 1.0 / 12.0;
    const vt_pins limit = 4.0 * variance;
    const vt_pins keep_x = VT_WHERE((gu2 > limit) & is_near, 1.0 - limit / gu2);
    const vt_pins keep_y = VT_WHERE((gv2 > limit) & is_near, 1.0 - limit / gv2);
    const vt_pins spread = disc + keep_x * (x_u * x_u) + keep_y * (y_v * y_v);
    const vt_pins variances = 0.5 * variance * spread * inverse * inverse + hidden * hidden;
    const vt_pins ex = near_ex - keep_x * gu * x_u, ey = near_ey - keep_y * gv * y_v;
    const vt_mask on = (ex * ex + ey * ey >= near2 * a2) & seen;
    const vt_pins step_x = ex * inverse, step_y = ey * inverse, fit = VT_WHERE((left > 0.0) & seen, a2 / left);

    int goes_on = 0, any = 0;
    for (int k = 0; k < VT_PINS; k++) { /* of a pin that is not seen the place does not count */
        const size_t i = from[k].pin;
        s->amplitude[i] = amplitude[k], s->fit[i] = fit[k], s->sigma[i] = sqrt(variances[k]);
        *(vt_any_two *)(s->xy + 2 * i) = *(const vt_any_two *)&from[k].x + (vt_two){step_x[k], step_y[k]};
        any |= (int)on[k];
    }
    if (first && !any) return 0; /* so short that they are within reach */
    for (int k = 0; k < VT_PINS; k++) {
        const size_t i = from[k].pin;
        if (!on[k] && first) continue;
        if (!vt_is_within_reach(s, from + k, step_x[k], step_y[k])) s->amplitude[i] = s->fit[i] = 0.0;
        else if (on[k]) goes_on |= 1 << k;
    }
    return goes_on;
}

/* Behind n pins repeat the last one, as steps are of VT_PINS of them. */
static inline void vt_fill(vt_start *from, double *sums, Py_ssize_t n)
{
    for (; n % VT_PINS; n++) from[n] = from[n - 1], memcpy(sums + 8 * n, sums + 8 * (n - 1), 8 * sizeof *sums);
}

VT_INLINE static inline int vt_step_by(const vt_reading *s, Py_ssize_t i, Py_ssize_t norm, double x, double y,
                                       double near2, double far2, int first)
{
    double some[8 * VT_PINS];
    vt_start from[VT_PINS] = {{x, y, (size_t)i, (size_t)norm, 0, s->norms + VT_NORM * norm}};
    memcpy(some, s->sums, 8 * sizeof *some);
    vt_fill(from, some, 1);
    return vt_step_some(s, some, from, near2, far2, first) & 1;
}

#define VT_MANY 32 /* windows in a row: each of the three loops has the registers for itself */
VT_INLINE static inline Py_ssize_t vt_take_steps_by(const vt_reading *reading, int *who, Py_ssize_t n, double near2,
                                                    double far2, int first)
{
    double sums[8 * VT_MANY];
    vt_start from[VT_MANY];
    const vt_reading s = *reading;
    Py_ssize_t asked = 0, j = 0;
    const vt_two least = {s.inner[0], s.inner[1]}, beyond = {s.inner[2], s.inner[3]};
    const double *const begin = first ? s.predicted : s.xy, to_middle = s.side > 1 ? 0.0 : 2.0; /* phases */
    const double to_place = 0.125 - 0.25 * to_middle;
    while (j < n) {
        vt_start *to = from;
        for (const Py_ssize_t end = n - j < VT_MANY ? n : j + VT_MANY; j < end; j++) {
            const unsigned i = (unsigned)who[j];
            const vt_two at = 4.0 * *(const vt_any_two *)(begin + 2 * i) + to_middle; /* phases */
            const vt_mask_two inside = (at >= least) & (at < beyond);
            if (!(inside[0] & inside[1])) {
                who[asked++] = (int)(2 * i);
                continue;
            }
            const int x = (int)at[0], y = (int)at[1];
            const unsigned column = (unsigned)x, row = (unsigned)y;
            const size_t norm = (unsigned)s.norm_of[i] + row % 4 * 4 + column % 4;
            *to++ = (vt_start){0.25 * x + to_place, 0.25 * y + to_place, i, norm,
                               row / 4 * (size_t)s.stride + column / 4, s.norms + VT_NORM * norm};
        }
        const Py_ssize_t taken = to - from;
        vt_sum_windows(reading, from, taken, sums);
        vt_fill(from, sums, taken);
        for (Py_ssize_t k = 0; k < taken; k += VT_PINS) {
            const int goes_on = vt_step_some(&s, sums + 8 * k, from + k, near2, far2, first);
            for (Py_ssize_t m = k; goes_on >> (m - k) && m < taken; m++)
                if (goes_on >> (m - k) & 1) who[asked++] = (int)(2 * from[m].pin + 1);
        }
    }
    return asked;
}

/* The function `name`, which takes its form for AVX2 where there is that. */
#ifdef VT_AVX2
#define VT_CHOOSE(type, name, parameters, arguments) \
    __attribute__((target("avx2"))) static type name##_avx2 parameters { return name##_by arguments; } \
    static type name parameters \
    { \
        return __builtin_cpu_supports("avx2") ? name##_avx2 arguments : name##_by arguments; \
    }
#else
#define VT_CHOOSE(type, name, parameters, arguments) static type name parameters { return name##_by arguments; }
#endif
VT_CHOOSE(int, vt_step, (const vt_reading *s, Py_ssize_t i, Py_ssize_t norm, double x, double y, double near2,
                         double far2, int first), (s, i, norm, x, y, near2, far2, first))
VT_CHOOSE(Py_ssize_t, vt_take_steps, (const vt_reading *reading, int *who, Py_ssize_t n, double near2, double far2,
                                      int first), (reading, who, n, near2, far2, first))
