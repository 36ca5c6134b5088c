/* Where each pin is now: one call over all pins, reading only their windows.
 *
 * Idea. A pin is a blurred disc of known radius d(r) on a local plane. Around a guess c the image is
 *
 *     I = b + g.(u,v) + A d + A (dx tx + dy ty) + noise,      tx = -d(d)/du: minus the disc's slope
 *
 * which is linear in b, g, A, A dx, A dy. tx and ty live on the disc's edge, where all knowledge about
 * its place is: their least-squares answer is the maximum-likelihood step and reaches the Cramer-Rao
 * bound, which a plain centroid misses by half. It is repeated until the step is below half a phase,
 * so where the window started leaves no trace.
 *
 * Rules
 * - No allocation and no Python object inside the loop; the GIL is released.
 * - Templates are made by the caller, for PHASES x PHASES subpixel offsets, in 16-bit integers, zero outside of
 *   the support circle, in rows of a multiple of LANES and planes of a multiple of BLOCK. d is orthogonal to 1;
 *   tx and ty to 1 and d.
 * - One pass over a window's pixels: nine pins in ten are answered by the first, and all sums cost what the
 *   pixels' way to the processor does. Divisions are of the pin alone; what is the template's stands in `norms`.
 * - Levels are taken relative to the window's middle, so that all sums are exact integers.
 * - Two pins never answer from one blob: of a pair closer than their clash distance the one that went
 *   further from its prediction is lost.
 */
#include <Python.h>
#include "_select.h"
#include <math.h>
#include <string.h>

#define LANES 8
#define BLOCK 32 /* planes are padded to a multiple of it: no remainder to do one by one */
#define PLANE_MAX (((2 * HALF_MAX + 1) * STRIDE_MAX + BLOCK - 1) / BLOCK * BLOCK)
#define AHEAD 3 /* pins between the one in hand and the one whose window is on its way */
#define PHASES 4
#define HALF_MAX 39
#define STRIDE_MAX 80
#define STEP_MAX 4095 /* 12 bits; the caller scales the templates so that no sum of 32 bits overflows */
#define STEPS_MAX 8
#define NORMS 22
#define NEAR (0.75 / PHASES) /* px: a step this short is the last */
#define FAR 0.35             /* px: the slopes alone are enough for a step this long */
#define KINDS_MAX 128

/* The wide clone needs the dynamic linker's help, which glibc gives; elsewhere the baseline (NEON on
 * aarch64) is what the compiler targets anyway. */
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
#define WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
#else
#define WIDE
#endif
#define INLINE static inline __attribute__((always_inline))

typedef struct {
    const unsigned char *data;
    Py_ssize_t rows, columns, row_bytes;
    int bytes; /* 1 or 2 a pixel */
} Picture;

typedef struct {
    int half, stride;       /* window is (2 half + 1) rows of `stride` */
    Py_ssize_t first, step; /* from the start of the table to this kind; from three planes to the next three */
} Kind;

typedef struct {
    double sd, stx, sty, s1, su, sv, s2; /* sums over the support: I d, I tx, I ty, I, I u, I v, I^2 */
} Sums;

INLINE double square(double x, double y) /* of the length */
{
    return x * x + y * y;
}

INLINE int pixel(const Picture *p, Py_ssize_t x, Py_ssize_t y)
{
    const unsigned char *row = p->data + y * p->row_bytes;
    return p->bytes == 1 ? row[x] : ((const unsigned short *)row)[x];
}

/* The rows of a window that lies within an 8-bit image, one after the other; `stride` is a constant where it is
 * called, so that a row is two or three moves. */
INLINE void take_rows(const unsigned char *from, Py_ssize_t row_bytes, int size, int stride, unsigned char *to)
{
    for (int j = 0; j < size; j++) {
        memcpy(to, from, (size_t)stride);
        from += row_bytes;
        to += stride;
    }
}

/* The window round (cx, cy) as it lies in an 8-bit image; 0 where it does not lie within it. */
INLINE int take_bytes(const Picture *p, int cx, int cy, const Kind *k, unsigned char *to)
{
    const int size = 2 * k->half + 1;
    const int x0 = cx - k->half, y0 = cy - k->half;
    if (p->bytes != 1 || x0 < 0 || y0 < 0 || x0 + k->stride > p->columns || y0 + size > p->rows) return 0;
    const unsigned char *from = p->data + y0 * p->row_bytes + x0;
    switch (k->stride) { /* the usual ones, unrolled */
    case 16: take_rows(from, p->row_bytes, size, 16, to); break;
    case 24: take_rows(from, p->row_bytes, size, 24, to); break;
    case 32: take_rows(from, p->row_bytes, size, 32, to); break;
    default: take_rows(from, p->row_bytes, size, k->stride, to);
    }
    return 1;
}

/* Have the memory bring the window round (x, y): the processor does not guess which rows come next. */
INLINE void fetch_window(const Picture *p, double x, double y, const Kind *k)
{
    if (!(x >= k->half && y >= k->half && x < (double)(p->columns - k->half) && y < (double)(p->rows - k->half - 1)))
        return;
    const int size = 2 * k->half + 1;
    const unsigned char *row =
        p->data + ((int)(y + 0.5) - k->half) * p->row_bytes + ((int)(x + 0.5) - k->half) * p->bytes;
    for (int j = 0; j < size; j++, row += p->row_bytes) {
        __builtin_prefetch(row);
        __builtin_prefetch(row + size * p->bytes - 1);
    }
}

/* Pixels of the window round (cx, cy) less `level`, zero outside of the support and of the image; 1 if the
 * window lies within the image. */
INLINE int take_window(const Picture *p, int cx, int cy, const Kind *k, const short *support, int level, int shift,
                       short *window)
{
    const int size = 2 * k->half + 1;
    const int x0 = cx - k->half, y0 = cy - k->half;
    for (int j = 0; j < size; j++) {
        short *to = window + j * k->stride;
        const short *in = support + j * k->stride;
        const Py_ssize_t y = y0 + j;
        for (int i = 0; i < k->stride; i++) {
            const Py_ssize_t x = x0 + i;
            const int there = in[i] && y >= 0 && y < p->rows && x >= 0 && x < p->columns;
            const int step = there ? (pixel(p, x, y) - level) >> shift : 0;
            to[i] = (short)(step > STEP_MAX ? STEP_MAX : (step < -STEP_MAX ? -STEP_MAX : step));
        }
    }
    return x0 >= 0 && y0 >= 0 && x0 + size <= p->columns && y0 + size <= p->rows;
}

/* All that the answer needs of a window, in one pass: sums of integer products, which compilers vectorise without
 * being asked. `t` holds d, tx, ty of one phase, `common` support, u, v. `wide`: squares of 12 bits do not fit a
 * sum of 32. */
#define SUM_UP(PIXELS, LEVEL, SQUARE)                                                                          \
    do {                                                                                                       \
        const short *restrict td = t, *restrict tx = t + n, *restrict ty = tx + n;                             \
        const short *restrict in = common, *restrict pu = common + n, *restrict pv = pu + n;                   \
        int d = 0, ex = 0, ey = 0, one = 0, u = 0, v = 0;                                                      \
        SQUARE w2 = 0;                                                                                         \
        for (int i = 0; i < n; i++) {                                                                          \
            const short w = (short)((PIXELS)[i] - (LEVEL)), within = (short)(w * in[i]);                       \
            d += w * td[i];                                                                                    \
            ex += w * tx[i];                                                                                   \
            ey += w * ty[i];                                                                                   \
            one += w * in[i];                                                                                  \
            u += w * pu[i];                                                                                    \
            v += w * pv[i];                                                                                    \
            w2 += w * within;                                                                                  \
        }                                                                                                      \
        *s = (Sums){d * norms[13], ex * norms[14], ey * norms[14], one, u, v, (double)w2};                 \
    } while (0)

INLINE void sums_of_bytes(const unsigned char *restrict pixels, int level, const short *t, const short *common,
                          const Kind *k, const double *norms, Sums *s)
{
    const int n = (int)(k->step / 3) & -BLOCK; /* it is a multiple */
    const short low = (short)level;
    SUM_UP(pixels, low, int);
}

INLINE void sums_of_shorts(const short *restrict pixels, int wide, const short *t, const short *common, const Kind *k,
                           const double *norms, Sums *s)
{
    const int n = (int)(k->step / 3) & -BLOCK;
    if (wide) SUM_UP(pixels, 0, long long);
    else SUM_UP(pixels, 0, int);
}

typedef struct {
    double x, y, sigma, amplitude, fit;
} Answer;

typedef struct {
    double fit_min, amplitude_share, reach, clash, noise;
    int shift; /* bits that 16-bit images have too many */
} Limits;

INLINE int phase_of(double fraction) /* of (-0.5, 0.5] */
{
    int p = (int)floor((fraction + 0.5) * PHASES);
    return p < 0 ? 0 : (p >= PHASES ? PHASES - 1 : p);
}

/* Sigma of a coordinate: the noise as the fit leaves it, and what a blob that is no disc may hide. The
 * share m of the variation that the disc leaves unexplained counts as radius x m^2. Measured on rendered discs that
 * a straight edge hides in part: the middle moves by about 0.9 radius x m at worst, so a pin hidden by half is off
 * by 1 to 5 of these sigmas; radius x m would be right for it, and would call every pin that is not quite round
 * (m of 0.08 on real tips) uncertain by half a pixel, which it is not. */
INLINE double sigma_of(double noise_variance, double rest, double freedom, double energy, double noise, double radius)
{
    const double missing = rest - freedom * (noise + 1.0 / 12.0);
    const double m = missing > 0 && energy > 0 ? missing / energy : 0;
    const double hidden = radius * m * m;
    return sqrt(noise_variance + hidden * hidden);
}

/* A pin that the image's border cuts: the same fit over the pixels there are, of 1, d, tx, ty alone. `ex`, `ey`
 * are the step from the phase's centre. 0 where less than a third of the pin's variation is in view. */
static int fit_cut(const Picture *p, const short *window, const short *common, const short *t, const Kind *k, int cx,
                   int cy, const double *norms, double noise, Answer *out, double *ex, double *ey)
{
    enum { SIZE = 4 };
    double m[SIZE][SIZE + 1] = {{0}}, energy = 0, sum = 0, seen = 0, inverse_trace = 0;
    const int size = 2 * k->half + 1;
    const Py_ssize_t plane = k->step / 3;
    for (int j = 0; j < size; j++) {
        for (int i = 0; i < size; i++) {
            const Py_ssize_t at = (Py_ssize_t)j * k->stride + i;
            const int x = cx - k->half + i, y = cy - k->half + j;
            if (!common[at] || x < 0 || y < 0 || x >= p->columns || y >= p->rows) continue;
            const double basis[SIZE] = {1, norms[13] * t[at], norms[14] * t[plane + at], norms[14] * t[2 * plane + at]};
            for (int r = 0; r < SIZE; r++) {
                for (int c = 0; c < SIZE; c++) m[r][c] += basis[r] * basis[c];
                m[r][SIZE] += basis[r] * window[at];
            }
            energy += (double)window[at] * window[at];
            seen++;
        }
    }
    sum = m[0][SIZE];
    if (m[1][1] < 0.3 * norms[1] || seen < 12) return 0;
    energy -= sum * sum / seen;
    double right[SIZE], solved[SIZE][SIZE];
    for (int r = 0; r < SIZE; r++) right[r] = m[r][SIZE];
    /* Gauss-Jordan on a small symmetric positive matrix: its inverse is wanted for sigma */
    for (int r = 0; r < SIZE; r++)
        for (int c = 0; c < SIZE; c++) solved[r][c] = r == c;
    for (int r = 0; r < SIZE; r++) {
        const double pivot = m[r][r];
        if (!(pivot > 1e-9)) return 0;
        for (int c = 0; c < SIZE; c++) {
            m[r][c] /= pivot;
            solved[r][c] /= pivot;
        }
        for (int o = 0; o < SIZE; o++) {
            if (o == r) continue;
            const double f = m[o][r];
            for (int c = 0; c < SIZE; c++) {
                m[o][c] -= f * m[r][c];
                solved[o][c] -= f * solved[r][c];
            }
        }
    }
    double answer[SIZE] = {0}, explained = -sum * sum / seen;
    for (int r = 0; r < SIZE; r++) {
        for (int c = 0; c < SIZE; c++) answer[r] += solved[r][c] * right[c];
        explained += answer[r] * right[r];
    }
    if (!(answer[1] > 0) || !(energy > 0)) return 0;
    inverse_trace = 0.5 * (solved[2][2] + solved[3][3]);
    const double rest = energy - explained;
    const double variance = (rest > 0 ? rest : 0) / (seen - SIZE) + 1.0 / 12.0;
    *ex = answer[2] / answer[1];
    *ey = answer[3] / answer[1];
    out->amplitude = answer[1];
    out->sigma = sigma_of(variance * inverse_trace / (answer[1] * answer[1]), rest, seen - SIZE, energy, noise, norms[12]);
    out->fit = explained / energy;
    return 1;
}

/* norms of one phase: 0 pixels in the support, 1 sum d^2, 2 sum tx^2, 3 sum ty^2, 4 sum tx u, 5 sum ty v,
 * 6 sum u^2, 7 sum v^2, where u and v are freed of 1 and d by taking off 8, 9 (their means) and 10, 11
 * (their share of d); 12 the radius; 13, 14 what one step of the integers in d and in tx, ty is worth; 15..18
 * one over 0..3; 19, 20 one over the determinants of (tx, u) and (ty, v); 21 one over the degrees of freedom */
INLINE Answer follow(const Picture *p, double x, double y, const Limits *limit, const Kind *k, const short *templates,
                     const double *norms)
{
    short window[PLANE_MAX];
    unsigned char bytes[PLANE_MAX];
    const short *common = templates + k->first, *phases = common + k->step;
    Answer a = {x, y, NAN, 0, 0};
    const double x0 = x, y0 = y;
    const double step_max = 0.5 * (k->half > 4 ? k->half - 2 : 2), reach2 = limit->reach * limit->reach;
    if (!isfinite(x) || !isfinite(y)) return a;
    int had_x = -1, had_y = -1;
    int level = 0, inside = 0, whole = 0;
    const int plane = (int)(k->step / 3), used = (2 * k->half + 1) * k->stride;
    memset(window + used, 0, (size_t)(plane - used) * sizeof(short));
    memset(bytes + used, 0, (size_t)(plane - used));
    for (int turn = 0; turn < STEPS_MAX; turn++) {
        if (x < 0 || y < 0 || x > (double)(p->columns - 1) || y > (double)(p->rows - 1)) return a;
        const int cx = (int)(x + 0.5), cy = (int)(y + 0.5);
        const int px = phase_of(x - cx), py = phase_of(y - cy);
        if (cx != had_x || cy != had_y) {
            level = pixel(p, cx, cy);
            inside = take_bytes(p, cx, cy, k, bytes);
            whole = inside || take_window(p, cx, cy, k, common, level, limit->shift, window);
            had_x = cx;
            had_y = cy;
        }
        const int phase = py * PHASES + px;
        const double *n = norms + (Py_ssize_t)phase * NORMS;
        const double ox = (px + 0.5) / PHASES - 0.5, oy = (py + 0.5) / PHASES - 0.5;
        const short *t = phases + phase * k->step;
        if (!whole) {
            Answer cut;
            double ex, ey;
            if (!fit_cut(p, window, common, t, k, cx, cy, n, limit->noise, &cut, &ex, &ey)) return a;
            const double far = sqrt(square(ex, ey)), shorten = far > step_max ? step_max / far : 1;
            x = cx + ox + shorten * ex;
            y = cy + oy + shorten * ey;
            if (square(x - x0, y - y0) > reach2) return a;
            if (far < NEAR || turn == STEPS_MAX - 1) {
                a = cut;
                a.x = x;
                a.y = y;
                a.amplitude = ldexp(cut.amplitude, limit->shift);
                return a;
            }
            continue;
        }
        Sums s;
        if (inside) sums_of_bytes(bytes, level, t, common, k, n, &s);
        else sums_of_shorts(window, p->bytes == 2, t, common, k, n, &s);
        const double amplitude = s.sd * n[16], inverse = 1 / amplitude;
        if (!(amplitude > 0)) return a;
        if (turn < STEPS_MAX - 3) { /* far off: go nearer first, by the slopes alone */
            const double ex = s.stx * n[17] * inverse, ey = s.sty * n[18] * inverse, far2 = square(ex, ey);
            if (far2 > FAR * FAR) {
                const double shorten = far2 > step_max * step_max ? step_max / sqrt(far2) : 1;
                x = cx + ox + shorten * ex;
                y = cy + oy + shorten * ey;
                if (square(x - x0, y - y0) > reach2) return a;
                continue;
            }
        }
        const double su = s.su - n[8] * s.s1 - n[10] * s.sd, sv = s.sv - n[9] * s.s1 - n[11] * s.sd;
        const double energy = s.s2 - s.s1 * s.s1 * n[15];
        /* The slope of the surroundings and the step, together; then the slope shrunk by how sure it is:
         * where it is within its own noise, leaving it out costs nothing and saves a fifth of the noise. */
        double gx = (n[2] * su - n[4] * s.stx) * n[19], gy = (n[3] * sv - n[5] * s.sty) * n[20];
        double ex = (n[6] * s.stx - n[4] * su) * n[19], ey = (n[7] * s.sty - n[5] * sv) * n[20];
        const double rest = energy - s.sd * amplitude - (gx * su + ex * s.stx) - (gy * sv + ey * s.sty);
        const double variance = (rest > 0 ? rest : 0) * n[21] + 1.0 / 12.0;
        const double two_sigmas2 = 4 * variance;
        const double limit_x = two_sigmas2 * n[2] * n[19], limit_y = two_sigmas2 * n[3] * n[20];
        const double keep_x = gx * gx > limit_x ? 1 - limit_x / (gx * gx) : 0;
        const double keep_y = gy * gy > limit_y ? 1 - limit_y / (gy * gy) : 0;
        /* what a slope of the surroundings explains is no evidence against the disc */
        const double level_energy = energy - gx * su - gy * sv;
        gx *= keep_x;
        gy *= keep_y;
        ex = (s.stx - n[4] * gx) * n[17] * inverse;
        ey = (s.sty - n[5] * gy) * n[18] * inverse;
        double dx = ox + cx + ex - x, dy = oy + cy + ey - y;
        const double step2 = square(dx, dy);
        if (step2 > step_max * step_max) {
            const double shorten = step_max / sqrt(step2);
            dx *= shorten;
            dy *= shorten;
        }
        x += dx;
        y += dy;
        if (square(x - x0, y - y0) > reach2) return a;
        if (square(ex, ey) < NEAR * NEAR || turn == STEPS_MAX - 1) {
            const double loss_x = 1 + keep_x * n[4] * n[4] * n[19], loss_y = 1 + keep_y * n[5] * n[5] * n[20];
            const double spread = 0.5 * (loss_x * n[17] + loss_y * n[18]);
            a.x = x;
            a.y = y;
            a.amplitude = limit->shift ? ldexp(amplitude, limit->shift) : amplitude;
            a.sigma = sigma_of(variance * spread * inverse * inverse, rest, n[0] - 6, level_energy, limit->noise, n[12]);
            a.fit = level_energy > 0 ? s.sd * amplitude / level_energy : 0;
            return a;
        }
    }
    return a;
}

WIDE static void follow_all(const Picture *p, const double *predicted, Py_ssize_t n, const int *kind_of,
                            const Kind *kinds, const short *templates, const double *norms, const Limits *limit,
                            Answer *out)
{
    for (Py_ssize_t i = 0; i < n; i++) {
        const Py_ssize_t next = i + AHEAD < n ? i + AHEAD : i;
        fetch_window(p, predicted[2 * next], predicted[2 * next + 1], kinds + kind_of[next]);
        out[i] = follow(p, predicted[2 * i], predicted[2 * i + 1], limit, kinds + kind_of[i], templates,
                        norms + (Py_ssize_t)kind_of[i] * PHASES * PHASES * NORMS);
    }
}

static void judge(const double *predicted, Py_ssize_t n, const double *rest_amplitude, const Limits *limit,
                  Answer *out, double *scratch, int *order)
{
    /* The light may have changed for all pins at once: amplitudes are compared after the common gain. */
    Py_ssize_t m = 0;
    for (Py_ssize_t i = 0; i < n; i++)
        if (out[i].fit > limit->fit_min) scratch[m++] = out[i].amplitude / rest_amplitude[i];
    const double gain = m ? select_kth(scratch, m, m / 2) : 1;
    for (Py_ssize_t i = 0; i < n; i++)
        if (!(out[i].fit > limit->fit_min) || out[i].amplitude < limit->amplitude_share * gain * rest_amplitude[i])
            out[i].x = out[i].y = out[i].sigma = NAN;
    /* Sweep over x. `order` stays with the caller from frame to frame, so the sort finds it nearly sorted. */
    for (Py_ssize_t i = 1; i < n; i++) {
        const int who = order[i];
        const double key = isnan(out[who].x) ? HUGE_VAL : out[who].x;
        Py_ssize_t j = i;
        for (; j > 0; j--) {
            const double before = isnan(out[order[j - 1]].x) ? HUGE_VAL : out[order[j - 1]].x;
            if (!(before > key)) break;
            order[j] = order[j - 1];
        }
        order[j] = who;
    }
    const double clash2 = limit->clash * limit->clash;
    for (Py_ssize_t i = 0; i < n; i++) {
        Answer *a = out + order[i];
        for (Py_ssize_t j = i + 1; j < n && !isnan(a->x); j++) {
            Answer *b = out + order[j];
            if (isnan(b->x)) continue;
            if (b->x - a->x > limit->clash) break;
            if (square(b->x - a->x, b->y - a->y) > clash2) continue;
            const double *pa = predicted + 2 * order[i], *pb = predicted + 2 * order[j];
            Answer *loser = square(a->x - pa[0], a->y - pa[1]) > square(b->x - pb[0], b->y - pb[1]) ? a : b;
            loser->x = loser->y = loser->sigma = NAN;
        }
    }
}

static PyObject *complain(const char *what)
{
    PyErr_SetString(PyExc_ValueError, what);
    return NULL;
}

PyDoc_STRVAR(refine_doc,
             "refine(image, predicted, kind_of, kinds, templates, norms, rest_amplitude, limits, order, scratch,"
             " out)\n\n"
             "image           (h, w) uint8 or uint16, rows contiguous\n"
             "predicted       (n, 2) float64, px\n"
             "kind_of         (n,) int32, which of the kinds each pin is\n"
             "kinds           (k, 4) int64: half width, row stride, first template, length of three planes\n"
             "templates       int16: per kind: support, u, v, then per phase d, tx, ty\n"
             "norms           (k, 16, 22) float64\n"
             "rest_amplitude  (n,) float64\n"
             "limits          (6,) float64: fit_min, amplitude_share, reach_px, clash_px, noise variance of a pixel,\n"
             "                spare bits\n"
             "order           (n,) int32, a permutation, kept from call to call\n"
             "scratch         (n,) float64\n"
             "out             (n, 5) float64: x, y, sigma, amplitude, fit; NaN in x, y, sigma where lost");

enum { IMAGE, PREDICTED, KIND_OF, KINDS, TEMPLATES, NORMS_, REST, LIMITS, ORDER, SCRATCH, OUT, BUFFERS };

static PyObject *refine(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *given[BUFFERS];
    Py_buffer view[BUFFERS];
    PyObject *result = NULL;
    int had = 0;
    if (!PyArg_ParseTuple(args, "OOOOOOOOOOO:refine", &given[0], &given[1], &given[2], &given[3], &given[4],
                          &given[5], &given[6], &given[7], &given[8], &given[9], &given[10]))
        return NULL;
    for (; had < BUFFERS; had++) {
        int flags = had == IMAGE ? PyBUF_STRIDES | PyBUF_FORMAT : PyBUF_C_CONTIGUOUS | PyBUF_FORMAT;
        if (had >= ORDER) flags |= PyBUF_WRITABLE;
        if (PyObject_GetBuffer(given[had], &view[had], flags) < 0) goto done;
    }
    {
        static const char *format[BUFFERS] = {NULL, "d", "i", "l", "h", "d", "d", "d", "i", "d", "d"};
        for (int i = 1; i < BUFFERS; i++)
            if (strcmp(view[i].format, format[i]) && !(i == KINDS && !strcmp(view[i].format, "q"))) {
                complain("refine: an array of the wrong type");
                goto done;
            }
        const Py_buffer *image = &view[IMAGE];
        const int bytes = !strcmp(image->format, "B") ? 1 : (!strcmp(image->format, "H") ? 2 : 0);
        if (image->ndim != 2 || !bytes || image->strides[1] != bytes || image->shape[0] < 1 || image->shape[1] < 1) {
            complain("refine: the image must be (h, w) uint8 or uint16 with contiguous rows");
            goto done;
        }
        const Picture picture = {image->buf, image->shape[0], image->shape[1], image->strides[0], bytes};
        const Py_ssize_t n = view[KIND_OF].len / 4, k = view[KINDS].len / 32;
        if (view[PREDICTED].len != 16 * n || view[REST].len != 8 * n || view[ORDER].len != 4 * n ||
            view[SCRATCH].len != 8 * n || view[OUT].len != 40 * n || view[LIMITS].len != 48 ||
            view[NORMS_].len != k * PHASES * PHASES * NORMS * 8 || k < 1 || k > KINDS_MAX) {
            complain("refine: arrays that do not belong together");
            goto done;
        }
        Kind kinds[KINDS_MAX];
        const long long *row = view[KINDS].buf;
        for (Py_ssize_t i = 0; i < k; i++, row += 4) {
            kinds[i] = (Kind){(int)row[0], (int)row[1], (Py_ssize_t)row[2], (Py_ssize_t)row[3]};
            const Py_ssize_t plane = (Py_ssize_t)(2 * row[0] + 1) * row[1];
            const Py_ssize_t need = (plane + BLOCK - 1) / BLOCK * BLOCK * 3;
            if (row[0] < 1 || row[0] > HALF_MAX || row[1] % LANES || row[1] < 2 * row[0] + 1 || row[1] > STRIDE_MAX ||
                row[2] < 0 || row[3] != need || (row[2] + row[3] * (PHASES * PHASES + 1)) * 2 > view[TEMPLATES].len) {
                complain("refine: a template that does not fit its table");
                goto done;
            }
        }
        const int *kind_of = view[KIND_OF].buf, *order = view[ORDER].buf;
        for (Py_ssize_t i = 0; i < n; i++)
            if (kind_of[i] < 0 || kind_of[i] >= k || order[i] < 0 || order[i] >= n) {
                complain("refine: an index out of range");
                goto done;
            }
        const double *l = view[LIMITS].buf;
        const Limits limits = {l[0], l[1], l[2], l[3], ldexp(l[4], -2 * (int)l[5]), (int)l[5]};
        Py_BEGIN_ALLOW_THREADS
        follow_all(&picture, view[PREDICTED].buf, n, kind_of, kinds, view[TEMPLATES].buf, view[NORMS_].buf,
                   &limits, view[OUT].buf);
        judge(view[PREDICTED].buf, n, view[REST].buf, &limits, view[OUT].buf, view[SCRATCH].buf, view[ORDER].buf);
        Py_END_ALLOW_THREADS
    }
    result = Py_None;
    Py_INCREF(result);
done:
    while (had > 0) PyBuffer_Release(&view[--had]);
    return result;
}

static PyMethodDef methods[] = {{"refine", refine, METH_VARARGS, refine_doc}, {NULL, NULL, 0, NULL}};
static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "_centroid", "Window centroids of all pins in one call.", -1, methods, NULL, NULL, NULL,
    NULL};
PyMODINIT_FUNC PyInit__centroid(void) { return PyModule_Create(&module); }
