/* The arithmetic of `edge.features`: each function is what one of its verbs does to a frame's arrays.
 *
 * Idea. A frame's features are some twenty passes over a few hundred numbers. As array expressions each pass
 * costs a microsecond or two before it begins; here one call does what belongs together.
 *
 * Rules
 * - The meaning of everything (units, sources, constants) stands in the Python module named in each heading;
 *   constants come in from there.
 * - No allocation: results and scratch are the caller's arrays. The GIL is released where it takes long.
 * - NaN marks a lost pin, as everywhere.
 * - The surface's constant matrices are 16-bit integers with one step a row, as their sums are exact and they
 *   stream through the cache in half the time; the error is 1e-4 of the highest value (tests/edge/test_surface.py).
 */
#include "_buffers.h"
#include "_select.h"
#include <math.h>
#include <stdint.h>

/* As in _centroid.c: the wide clone needs glibc's help; elsewhere the baseline is the target anyway. */
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
#define WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
#else
#define WIDE
#endif

#define QUANTUM 32767.0f

/* Middle of the n values, as numpy.median has it; reorders them. NaN for none. */
static double median(double *v, Py_ssize_t n)
{
    if (n == 0) return NAN;
    const Py_ssize_t k = n / 2;
    const double middle = select_kth(v, n, k);
    if (n % 2) return middle;
    double below = v[0];
    for (Py_ssize_t i = 1; i < k; i++)
        if (v[i] > below) below = v[i];
    return 0.5 * (below + middle);
}

/* In place: a symmetric positive 3 x 3 system with two right sides; the answers are columns 3 and 4. */
static void solve_plane(double g[3][5])
{
    for (int r = 0; r < 3; r++) {
        for (int c = 4; c >= r; c--) g[r][c] /= g[r][r];
        for (int l = 0; l < 3; l++) {
            if (l == r) continue;
            const double f = g[l][r];
            for (int c = r; c < 5; c++) g[l][c] -= f * g[r][c];
        }
    }
}

/* ---- motion: since rest, and what the gate wants of it ------------------------------------------------- */

static PyObject *motion(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *o[5];
    Arrays a = {.n = 0};
    PyObject *result = NULL;
    if (!PyArg_ParseTuple(args, "OOOOO:motion", &o[0], &o[1], &o[2], &o[3], &o[4])) return NULL;
    const uint8_t *seen = take(&a, o[3], '?', -1, 0, "seen");
    if (!seen) goto done;
    const Py_ssize_t n = count(&a);
    const double *xy = take(&a, o[0], 'd', 2 * n, 0, "xy");
    const double *rest = xy ? take(&a, o[1], 'd', 2 * n, 0, "rest") : NULL;
    const double *sigma = rest ? take(&a, o[2], 'd', n, 0, "sigma") : NULL;
    double *out = sigma ? take(&a, o[4], 'd', 2 * n, 1, "out") : NULL;
    if (!out) goto done;
    double x = 0, y = 0, noise = 0;
    Py_ssize_t m = 0;
    for (Py_ssize_t i = 0; i < n; i++) {
        out[2 * i] = xy[2 * i] - rest[2 * i];
        out[2 * i + 1] = xy[2 * i + 1] - rest[2 * i + 1];
        if (!seen[i]) continue;
        x += out[2 * i];
        y += out[2 * i + 1];
        noise += sigma[i];
        m++;
    }
    result = m ? Py_BuildValue("(dddn)", x / m, y / m, noise / m, m) : Py_BuildValue("(dddn)", NAN, NAN, 0.0, m);
done:
    let_go(&a);
    return result;
}

#define RING_MAX 64

/* ---- gate ----------------------------------------------------------------------------------------------- */

/* Median of both components of the motion over a ring, of the pins that are known; how many these are, -1: no such. */
static int ring_median(const double *motion, const double *minus, const int32_t *ring, Py_ssize_t width, Py_ssize_t n,
                       double out[2])
{
    double v[2][RING_MAX];
    int m = 0;
    for (Py_ssize_t k = 0; k < width; k++) {
        const int32_t j = ring[k];
        if (j < 0 || j >= n) return -1;
        const double x = motion[2 * j] - (minus ? minus[2 * j] : 0), y = motion[2 * j + 1] - (minus ? minus[2 * j + 1] : 0);
        if (isnan(x)) continue;
        int i = m, l = m++;
        for (; i > 0 && v[0][i - 1] > x; i--) v[0][i] = v[0][i - 1];
        v[0][i] = x;
        for (; l > 0 && v[1][l - 1] > y; l--) v[1][l] = v[1][l - 1];
        v[1][l] = y;
    }
    for (int c = 0; c < 2 && m; c++) out[c] = 0.5 * (v[c][(m - 1) / 2] + v[c][m / 2]);
    return m;
}

static PyObject *ring_peak(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *o[2];
    Arrays a = {.n = 0};
    PyObject *result = NULL;
    Py_ssize_t columns;
    if (!PyArg_ParseTuple(args, "OnO:ring_peak", &o[0], &columns, &o[1])) return NULL;
    const double *value = take(&a, o[0], 'd', -1, 0, "value");
    if (!value) goto done;
    const Py_ssize_t n = columns == 1 || columns == 2 ? count(&a) / columns : 0;
    const int32_t *ring = take(&a, o[1], 'i', -1, 0, "ring");
    if (!ring) goto done;
    const Py_ssize_t width = n ? count(&a) / n : 0;
    if (!n || width < 1 || width > RING_MAX || width * n != count(&a)) {
        PyErr_SetString(PyExc_ValueError, "ring_peak: sizes do not match");
        goto done;
    }
    const int least = width < 4 ? (int)width : 4;
    double root[RING_MAX + 1], best = 0;
    for (int w = 0; w <= width; w++) root[w] = sqrt((double)w / (double)width);
    int any = 0;
    Py_ssize_t row = 0;
    for (Py_ssize_t i = 0; i < n; i++) {
        double size = 0;
        int weight = 0;
        if (columns == 2) {
            double middle[2];
            weight = ring_median(value, NULL, ring + i * width, width, n, middle);
            if (weight > 0) size = hypot(middle[0], middle[1]);
        } else {
            for (Py_ssize_t k = 0; k < width; k++) {
                const int32_t j = ring[i * width + k];
                if (j < 0 || j >= n) {
                    weight = -1;
                    break;
                }
                if (isnan(value[j])) continue;
                size += value[j];
                weight++;
            }
            if (weight > 0) size /= weight;
        }
        if (weight < 0) {
            PyErr_SetString(PyExc_ValueError, "ring_peak: no such neighbour");
            goto done;
        }
        if (!weight) continue;
        any = 1;
        if (weight < least) continue;
        size *= root[weight];
        if (size > best) {
            best = size;
            row = i;
        }
    }
    result = Py_BuildValue("(dn)", any ? best : NAN, row);
done:
    let_go(&a);
    return result;
}

/* Whether the skin grows by more than `limit` in the ring of `first`, or by more than `anywhere` in any other, when
 * each pin moves as the median of its ring does. */
static PyObject *coherent(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *o[5];
    Arrays a = {.n = 0};
    PyObject *result = NULL;
    double limit, anywhere;
    Py_ssize_t first;
    if (!PyArg_ParseTuple(args, "OOOOOddn:coherent", &o[0], &o[1], &o[2], &o[3], &o[4], &limit, &anywhere, &first))
        return NULL;
    const double *xy = take(&a, o[0], 'd', -1, 0, "xy");
    const Py_ssize_t n = xy ? count(&a) / 2 : 0;
    const double *rest = xy ? take(&a, o[1], 'd', 2 * n, 0, "rest") : NULL;
    const int32_t *ring = rest ? take(&a, o[2], 'i', -1, 0, "ring") : NULL;
    const Py_ssize_t width = ring && n ? count(&a) / n : 0;
    const double *slope = ring ? take(&a, o[3], 'd', 2 * n * width, 0, "slope") : NULL;
    double *middle = slope ? take(&a, o[4], 'd', 2 * n, 1, "scratch") : NULL;
    if (!middle) goto done;
    if (width < 1 || width > RING_MAX || first < 0 || first >= n) {
        PyErr_SetString(PyExc_ValueError, "coherent: sizes do not match");
        goto done;
    }
    for (Py_ssize_t i = 0; i < n; i++) middle[2 * i] = NAN; /* looked up where it is wanted */
    int found = 0;
    for (Py_ssize_t turn = 0; turn < width + n && !found; turn++) { /* where the cells have grown most, then anywhere */
        const Py_ssize_t i = turn < width ? ring[first * width + turn] : turn - width;
        double g[2][2] = {{0}};
        for (Py_ssize_t k = 0; k < width; k++) {
            const int32_t j = i < 0 || i >= n ? -1 : ring[i * width + k];
            if (j < 0 || j >= n ||
                (isnan(middle[2 * j]) && ring_median(xy, rest, ring + j * width, width, n, middle + 2 * j) < 0)) {
                PyErr_SetString(PyExc_ValueError, "coherent: no such neighbour");
                goto done;
            }
            for (int c = 0; c < 2; c++)
                for (int d = 0; d < 2; d++) g[c][d] += slope[2 * (i * width + k) + d] * middle[2 * j + c];
        }
        found = (1 + g[0][0]) * (1 + g[1][1]) - g[0][1] * g[1][0] - 1 > (turn < width ? limit : anywhere);
    }
    result = PyBool_FromLong(found);
done:
    let_go(&a);
    return result;
}

static PyObject *typical_size(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *o[2];
    Arrays a = {.n = 0};
    PyObject *result = NULL;
    if (!PyArg_ParseTuple(args, "OO:typical_size", &o[0], &o[1])) return NULL;
    const double *value = take(&a, o[0], 'd', -1, 0, "value");
    const Py_ssize_t n = value ? count(&a) : 0;
    double *scratch = value ? take(&a, o[1], 'd', n, 1, "scratch") : NULL;
    if (!scratch) goto done;
    Py_ssize_t m = 0;
    for (Py_ssize_t i = 0; i < n; i++)
        if (isfinite(value[i])) scratch[m++] = fabs(value[i]);
    result = PyFloat_FromDouble(median(scratch, m));
done:
    let_go(&a);
    return result;
}

static PyObject *centred(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *o[3];
    Arrays a = {.n = 0};
    PyObject *result = NULL;
    if (!PyArg_ParseTuple(args, "OOO:centred", &o[0], &o[1], &o[2])) return NULL;
    double *scratch = take(&a, o[1], 'd', -1, 1, "scratch");
    const Py_ssize_t n = scratch ? count(&a) : 0;
    const double *value = scratch ? take(&a, o[0], 'd', 2 * n, 0, "motion") : NULL;
    double *out = value ? take(&a, o[2], 'd', 2 * n, 1, "out") : NULL;
    if (!out) goto done;
    for (int c = 0; c < 2; c++) {
        Py_ssize_t m = 0;
        for (Py_ssize_t i = 0; i < n; i++)
            if (isfinite(value[2 * i + c])) scratch[m++] = value[2 * i + c];
        const double middle = median(scratch, m);
        for (Py_ssize_t i = 0; i < n; i++) out[2 * i + c] = value[2 * i + c] - middle;
    }
    result = Py_NewRef(Py_None);
done:
    let_go(&a);
    return result;
}

/* ---- modes ---------------------------------------------------------------------------------------------- */

#define MODES_MAX 64

typedef struct {
    double re, im;
} Complex;

/* In place: gram (hermitian, positive) becomes its lower Cholesky factor, right the solution. */
static int solve_hermitian(Complex *gram, Complex *right, int k)
{
    for (int j = 0; j < k; j++) {
        for (int i = j; i < k; i++) {
            Complex s = gram[i * k + j];
            for (int l = 0; l < j; l++) {
                const Complex p = gram[i * k + l], q = gram[j * k + l]; /* p conj(q) */
                s.re -= p.re * q.re + p.im * q.im;
                s.im -= p.im * q.re - p.re * q.im;
            }
            if (i == j) {
                if (!(s.re > 0)) return 0;
                gram[i * k + j].re = sqrt(s.re);
                gram[i * k + j].im = 0;
            } else {
                const double d = gram[j * k + j].re;
                gram[i * k + j].re = s.re / d;
                gram[i * k + j].im = s.im / d;
            }
        }
    }
    for (int i = 0; i < k; i++) {
        Complex s = right[i];
        for (int l = 0; l < i; l++) {
            const Complex p = gram[i * k + l], q = right[l];
            s.re -= p.re * q.re - p.im * q.im;
            s.im -= p.re * q.im + p.im * q.re;
        }
        right[i].re = s.re / gram[i * k + i].re;
        right[i].im = s.im / gram[i * k + i].re;
    }
    for (int i = k - 1; i >= 0; i--) {
        Complex s = right[i];
        for (int l = i + 1; l < k; l++) {
            const Complex p = gram[l * k + i], q = right[l]; /* conj(p) q */
            s.re -= p.re * q.re + p.im * q.im;
            s.im -= p.re * q.im - p.im * q.re;
        }
        right[i].re = s.re / gram[i * k + i].re;
        right[i].im = s.im / gram[i * k + i].re;
    }
    return 1;
}

/* `re`, `im`: (n, k) planes of the basis. Where no pin is lost, the equations are those of `inverse`. */
WIDE static int fit_modes(const double *restrict re, const double *restrict im, const Complex *gram, const Complex *inverse,
                          const double *value, const uint8_t *seen, Py_ssize_t n, int k, Complex *work, Complex *out)
{
    double sum_re[MODES_MAX] = {0}, sum_im[MODES_MAX] = {0};
    int lost = 0;
    for (Py_ssize_t i = 0; i < n; i++) {
        const double *restrict r = re + i * k, *restrict q = im + i * k;
        if (!seen[i]) {
            lost = 1;
            continue;
        }
        const double x = value[2 * i], y = value[2 * i + 1];
        for (int j = 0; j < k; j++) { /* conj(b) d */
            sum_re[j] += r[j] * x + q[j] * y;
            sum_im[j] += r[j] * y - q[j] * x;
        }
    }
    if (!lost) {
        for (int r = 0; r < k; r++) {
            Complex s = {0, 0};
            for (int c = 0; c < k; c++) {
                const Complex p = inverse[r * k + c];
                s.re += p.re * sum_re[c] - p.im * sum_im[c];
                s.im += p.re * sum_im[c] + p.im * sum_re[c];
            }
            out[r] = s;
        }
        return 1;
    }
    memcpy(work, gram, sizeof(Complex) * (size_t)k * (size_t)k);
    for (Py_ssize_t i = 0; i < n; i++) {
        if (seen[i]) continue;
        const double *p = re + i * k, *q = im + i * k;
        for (int r = 0; r < k; r++)
            for (int c = 0; c <= r; c++) { /* conj(b_r) b_c */
                work[r * k + c].re -= p[r] * p[c] + q[r] * q[c];
                work[r * k + c].im -= p[r] * q[c] - q[r] * p[c];
            }
    }
    for (int j = 0; j < k; j++) {
        out[j].re = sum_re[j];
        out[j].im = sum_im[j];
    }
    return solve_hermitian(work, out, k);
}

static PyObject *modes(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *o[8];
    Arrays a = {.n = 0};
    PyObject *result = NULL;
    if (!PyArg_ParseTuple(args, "OOOOOOOO:modes", &o[0], &o[1], &o[2], &o[3], &o[4], &o[5], &o[6], &o[7])) return NULL;
    const uint8_t *seen = take(&a, o[5], '?', -1, 0, "seen");
    const Py_ssize_t n = seen ? count(&a) : 0;
    Complex *out = seen ? take(&a, o[7], 'd', -1, 1, "out") : NULL;
    const Py_ssize_t k = out ? count(&a) / 2 : 0;
    const double *re = out ? take(&a, o[0], 'd', n * k, 0, "re") : NULL;
    const double *im = re ? take(&a, o[1], 'd', n * k, 0, "im") : NULL;
    const Complex *gram = im ? take(&a, o[2], 'd', 2 * k * k, 0, "gram") : NULL;
    const Complex *inverse = gram ? take(&a, o[3], 'd', 2 * k * k, 0, "inverse") : NULL;
    const double *value = inverse ? take(&a, o[4], 'd', 2 * n, 0, "motion") : NULL;
    Complex *work = value ? take(&a, o[6], 'd', 2 * k * k, 1, "work") : NULL;
    if (!work) goto done;
    if (k <= MODES_MAX && fit_modes(re, im, gram, inverse, value, seen, n, (int)k, work, out)) result = Py_NewRef(Py_None);
    else PyErr_SetString(PyExc_ValueError, "modes: the equations have no solution");
done:
    let_go(&a);
    return result;
}

/* ---- roughness ------------------------------------------------------------------------------------------ */

/* 1.4826 times the median size of what the pins are off their neighbours; -1: no such neighbour. */
static double rough(const double *xy, const double *rest, const uint8_t *seen, const int32_t *near, const double *weight,
                    Py_ssize_t n, Py_ssize_t width, double *scratch)
{
    Py_ssize_t m = 0;
    for (Py_ssize_t i = 0; i < n; i++) {
        if (!seen[i]) continue;
        double x = 0, y = 0;
        for (Py_ssize_t k = 0; k < width; k++) {
            const int32_t j = near[i * width + k];
            if (j < 0 || j >= n) return -1;
            x += weight[i * width + k] * (xy[2 * j] - rest[2 * j]);
            y += weight[i * width + k] * (xy[2 * j + 1] - rest[2 * j + 1]);
        }
        scratch[m++] = fabs(x);
        scratch[m++] = fabs(y);
    }
    return m ? 1.4826 * median(scratch, m) : 0;
}

static PyObject *roughness(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *o[6];
    Arrays a = {.n = 0};
    PyObject *result = NULL;
    if (!PyArg_ParseTuple(args, "OOOOOO:roughness", &o[0], &o[1], &o[2], &o[3], &o[4], &o[5])) return NULL;
    const uint8_t *seen = take(&a, o[2], '?', -1, 0, "seen");
    const Py_ssize_t n = seen ? count(&a) : 0;
    const double *xy = seen ? take(&a, o[0], 'd', 2 * n, 0, "xy") : NULL;
    const double *rest = xy ? take(&a, o[1], 'd', 2 * n, 0, "rest") : NULL;
    const int32_t *near = rest ? take(&a, o[3], 'i', -1, 0, "near") : NULL;
    const Py_ssize_t width = near && n ? count(&a) / n : 0;
    const double *weight = near ? take(&a, o[4], 'd', n * width, 0, "weight") : NULL;
    double *scratch = weight ? take(&a, o[5], 'd', 2 * n, 1, "scratch") : NULL;
    if (!scratch) goto done;
    const double sigma = rough(xy, rest, seen, near, weight, n, width, scratch);
    if (sigma < 0) PyErr_SetString(PyExc_ValueError, "roughness: no such neighbour");
    else result = PyFloat_FromDouble(sigma);
done:
    let_go(&a);
    return result;
}

/* ---- surface -------------------------------------------------------------------------------------------- */

/* A lost pin's cell grows by what the skin between its neighbours does: the determinant of the motion's slope. */
static int fill(const double *value, const double *xy, const double *rest, const int32_t *ring, const double *slope,
                Py_ssize_t n, Py_ssize_t width, float *out)
{
    for (Py_ssize_t i = 0; i < n; i++) {
        out[i] = (float)value[i];
        if (!isnan(value[i])) continue;
        double g[2][2] = {{0}}; /* [motion][direction] */
        for (Py_ssize_t k = 0; k < width; k++) {
            const int32_t j = ring[i * width + k];
            if (j < 0 || j >= n) return 0;
            for (int c = 0; c < 2; c++)
                for (int d = 0; d < 2; d++)
                    g[c][d] += slope[2 * (i * width + k) + d] * (xy[2 * j + c] - rest[2 * j + c]);
        }
        out[i] = (float)((1 + g[0][0]) * (1 + g[1][1]) - g[0][1] * g[1][0] - 1);
    }
    return 1;
}

/* Whole steps of the returned size; the rest of m is padding. */
static float quantise(const float *value, Py_ssize_t n, Py_ssize_t m, int16_t *out, float top)
{
    const float scale = top > 0 ? QUANTUM / top : 0;
    for (Py_ssize_t i = 0; i < n; i++) out[i] = (int16_t)lrintf(value[i] * scale);
    for (Py_ssize_t i = n; i < m; i++) out[i] = 0;
    return top / QUANTUM;
}

static float highest(const float *value, Py_ssize_t n)
{
    float top = 0;
    for (Py_ssize_t i = 0; i < n; i++)
        if (fabsf(value[i]) > top) top = fabsf(value[i]);
    return top;
}

/* Four rows at a time: the values are read once for the four, and their sums do not wait for each other. */
WIDE static void raise_heights(const int16_t *rows, const float *steps, Py_ssize_t k, Py_ssize_t m,
                               const int16_t *restrict value, float step, float *restrict heights)
{
    Py_ssize_t p = 0;
    for (; p + 4 <= k; p += 4) {
        const int16_t *restrict r0 = rows + p * m, *restrict r1 = r0 + m, *restrict r2 = r1 + m, *restrict r3 = r2 + m;
        int32_t s0 = 0, s1 = 0, s2 = 0, s3 = 0;
        for (Py_ssize_t i = 0; i < m; i++) {
            const int v = value[i];
            s0 += r0[i] * v;
            s1 += r1[i] * v;
            s2 += r2[i] * v;
            s3 += r3[i] * v;
        }
        heights[p] = (float)s0 * steps[p] * step;
        heights[p + 1] = (float)s1 * steps[p + 1] * step;
        heights[p + 2] = (float)s2 * steps[p + 2] * step;
        heights[p + 3] = (float)s3 * steps[p + 3] * step;
    }
    for (; p < k; p++) {
        const int16_t *row = rows + p * m;
        int32_t sum = 0;
        for (Py_ssize_t i = 0; i < m; i++) sum += row[i] * value[i];
        heights[p] = (float)sum * steps[p] * step;
    }
}

WIDE static double volume(const float *height, Py_ssize_t k, float level)
{
    double total = 0;
    for (Py_ssize_t p = 0; p < k; p++) { /* firm shrinkage */
        float ramp = height[p] - level;
        ramp = ramp > 0 ? ramp + ramp : 0;
        ramp = ramp < height[p] ? ramp : height[p];
        total += ramp > 0 ? ramp : 0;
    }
    return total;
}

static PyObject *heights(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *o[10];
    Arrays a = {.n = 0};
    PyObject *result = NULL;
    double level;
    if (!PyArg_ParseTuple(args, "O(OOOO)OOOOOd:heights", &o[0], &o[1], &o[2], &o[3], &o[4], &o[5], &o[6], &o[7], &o[8],
                          &o[9], &level))
        return NULL;
    const double *change = take(&a, o[0], 'd', -1, 0, "change");
    const Py_ssize_t n = change ? count(&a) : 0;
    const double *xy = change ? take(&a, o[1], 'd', 2 * n, 0, "xy") : NULL;
    const double *rest = xy ? take(&a, o[2], 'd', 2 * n, 0, "rest") : NULL;
    const int32_t *ring = rest ? take(&a, o[3], 'i', -1, 0, "ring") : NULL;
    const Py_ssize_t width = ring && n ? count(&a) / n : 0;
    const double *slope = ring ? take(&a, o[4], 'd', 2 * n * width, 0, "slope") : NULL;
    int16_t *work = slope ? take(&a, o[7], 'h', -1, 1, "work") : NULL;
    const Py_ssize_t m = work ? count(&a) : 0;
    const float *steps = work ? take(&a, o[6], 'f', -1, 0, "steps") : NULL;
    const Py_ssize_t k = steps ? count(&a) : 0;
    const int16_t *rows = steps ? take(&a, o[5], 'h', k * m, 0, "rows") : NULL;
    float *growth = rows ? take(&a, o[8], 'f', n, 1, "growth") : NULL;
    float *out = growth ? take(&a, o[9], 'f', k, 1, "heights") : NULL;
    if (!out) goto done;
    if (m < n || !fill(change, xy, rest, ring, slope, n, width, growth)) {
        PyErr_SetString(PyExc_ValueError, "heights: rows are shorter than there are pins, or no such neighbour");
        goto done;
    }
    double total;
    Py_BEGIN_ALLOW_THREADS
    const float step = quantise(growth, n, m, work, highest(growth, n));
    raise_heights(rows, steps, k, m, work, step, out);
    total = volume(out, k, (float)level);
    Py_END_ALLOW_THREADS
    result = PyFloat_FromDouble(total);
done:
    let_go(&a);
    return result;
}

static PyObject *stretch(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *o[7];
    Arrays a = {.n = 0};
    PyObject *result = NULL;
    if (!PyArg_ParseTuple(args, "OOOOOOO:stretch", &o[0], &o[1], &o[2], &o[3], &o[4], &o[5], &o[6])) return NULL;
    const double *xy = take(&a, o[0], 'd', -1, 0, "xy");
    const Py_ssize_t n = xy ? count(&a) / 2 : 0;
    const double *rest = xy ? take(&a, o[1], 'd', 2 * n, 0, "rest") : NULL;
    int16_t *work = rest ? take(&a, o[4], 'h', -1, 1, "work") : NULL;
    const Py_ssize_t m = work ? count(&a) : 0;
    const float *steps = work ? take(&a, o[3], 'f', -1, 0, "steps") : NULL;
    const Py_ssize_t k = steps ? count(&a) : 0;
    const int16_t *rows = steps ? take(&a, o[2], 'h', k * m, 0, "rows") : NULL;
    float *bent = rows ? take(&a, o[5], 'f', 2 * n, 1, "bent") : NULL;
    float *out = bent ? take(&a, o[6], 'f', k, 1, "stretch") : NULL;
    if (!out) goto done;
    if (m < 2 * n || !n) {
        PyErr_SetString(PyExc_ValueError, "stretch: rows are shorter than there are pins");
        goto done;
    }
    float step, even;
    Py_BEGIN_ALLOW_THREADS
    /* The part that is linear in the place stretches the same everywhere; without it the steps are finer. */
    double g[3][5] = {{0}};
    for (Py_ssize_t i = 0; i < n; i++) {
        const double basis[3] = {1, rest[2 * i] - rest[0], rest[2 * i + 1] - rest[1]};
        for (int r = 0; r < 3; r++) {
            for (int c = 0; c < 3; c++) g[r][c] += basis[r] * basis[c];
            for (int c = 0; c < 2; c++) g[r][3 + c] += basis[r] * (xy[2 * i + c] - rest[2 * i + c]);
        }
    }
    solve_plane(g);
    for (Py_ssize_t i = 0; i < 2 * n; i++) {
        const int c = i & 1;
        const double *at = rest + (i - c);
        bent[i] = (float)(xy[i] - rest[i] - g[0][3 + c] - g[1][3 + c] * (at[0] - rest[0]) - g[2][3 + c] * (at[1] - rest[1]));
    }
    step = quantise(bent, 2 * n, m, work, highest(bent, 2 * n));
    raise_heights(rows, steps, k, m, work, step, out);
    even = (float)(g[1][3] + g[2][4]);
    for (Py_ssize_t p = 0; p < k; p++) out[p] += even;
    Py_END_ALLOW_THREADS
    result = Py_BuildValue("(dd)", (double)step, (double)even);
done:
    let_go(&a);
    return result;
}

/* ---- contacts ------------------------------------------------------------------------------------------- */

#define MAXIMA_MAX 24
#define CONTACTS_MAX 8
#define FIELDS 7

enum { UNKNOWN, SLOPE, TOP };

typedef struct {
    const float *grid; /* padded by one point of -inf all round */
    Py_ssize_t width;  /* of a padded row */
    const int32_t *place;
    Py_ssize_t k;
    int32_t *mark, *stack; /* as long as the padded grid */
} Grid;

static void neighbours(Py_ssize_t width, Py_ssize_t step[8])
{
    const Py_ssize_t all[8] = {-width - 1, -width, -width + 1, -1, 1, width - 1, width, width + 1};
    memcpy(step, all, sizeof(all));
}

/* Marks every point TOP or SLOPE: regional maxima with plateaus, as skimage.morphology.local_maxima. */
static void mark_maxima(const Grid *g)
{
    Py_ssize_t step[8];
    neighbours(g->width, step);
    for (Py_ssize_t p = 0; p < g->k; p++) g->mark[g->place[p]] = UNKNOWN;
    for (Py_ssize_t p = 0; p < g->k; p++) {
        const int32_t start = g->place[p];
        if (g->mark[start] != UNKNOWN) continue;
        const float h = g->grid[start];
        int higher = !(h > -INFINITY), equal = 0;
        for (int d = 0; d < 8; d++) {
            const float other = g->grid[start + step[d]];
            higher |= other > h;
            equal |= other == h;
        }
        if (!equal) {
            g->mark[start] = higher ? SLOPE : TOP;
            continue;
        }
        if (!(h > -INFINITY)) {
            g->mark[start] = SLOPE;
            continue;
        }
        Py_ssize_t n = 0; /* the whole plateau, then its verdict */
        g->stack[n++] = start;
        g->mark[start] = SLOPE;
        higher = 0;
        for (Py_ssize_t i = 0; i < n; i++) {
            for (int d = 0; d < 8; d++) {
                const int32_t at = g->stack[i] + (int32_t)step[d];
                const float other = g->grid[at];
                higher |= other > h;
                if (other == h && g->mark[at] == UNKNOWN) {
                    g->mark[at] = SLOPE;
                    g->stack[n++] = at;
                }
            }
        }
        if (!higher)
            for (Py_ssize_t i = 0; i < n; i++) g->mark[g->stack[i]] = TOP;
    }
}

/* The first of the earlier maxima that is connected to maximum j above `level`; j itself if none is. */
static int leader_of(const Grid *g, const int32_t *at, int j, float level)
{
    Py_ssize_t step[8];
    neighbours(g->width, step);
    const int32_t visited = TOP + 1 + j;
    Py_ssize_t n = 0;
    int first = j;
    g->stack[n++] = at[j];
    g->mark[at[j]] = visited;
    for (Py_ssize_t i = 0; i < n; i++)
        for (int d = 0; d < 8; d++) {
            const int32_t to = g->stack[i] + (int32_t)step[d];
            if (g->grid[to] >= level && g->mark[to] != visited) {
                g->mark[to] = visited;
                g->stack[n++] = to;
            }
        }
    for (int i = j - 1; i >= 0; i--)
        if (g->mark[at[i]] == visited) first = i;
    return first;
}

typedef struct {
    double x0, y0, step, pitch, valley, edge, minor, reach; /* lengths in px */
    double part;                                            /* a valley's least depth in sigmas of the noise there */
    double round, witnesses; /* px; the least share of the pins within it that are seen */
    double fine_x0, fine_y0, fine_step, elongated, small, near, fine_valley, fine_part, aligned; /* of `part_in_two` */
} Rules;

/* Where the pins are, and what gives their noise. */
typedef struct {
    const float *growth;
    const double *rest, *xy;
    Py_ssize_t n;
    const uint8_t *seen;
    const int32_t *near;
    const double *weight;
    Py_ssize_t width;
    double *scratch;
    double sigma; /* of a pin, px; < 0: not known yet */
} Tip;

/* The pins' noise is looked up only where something hangs on it. */
static double noise_of(Tip *tip)
{
    if (tip->sigma < 0) {
        const double sigma = rough(tip->xy, tip->rest, tip->seen, tip->near, tip->weight, tip->n, tip->width, tip->scratch);
        tip->sigma = sigma > 0 ? sigma : 0;
    }
    return tip->sigma;
}

/* A sharper field on a finer grid. */
typedef struct {
    const int16_t *rows, *work; /* work: the motion in whole steps, as `stretch` left it */
    const float *steps, *gain;
    const int32_t *place, *coarse; /* where each point is in the fine grid; the coarse point that it lies at */
    Py_ssize_t n, m, width;
    float *grid;
    int32_t *mark, *stack, *live;
    float step, even;
} Fine;

typedef struct {
    double n, w, x, y, xx, xy, yy, level, axis, middle[2];
} Region;

static double summit(const Grid *g, int32_t at)
{
    const double top = g->grid[at];
    double height = top;
    const Py_ssize_t step[2] = {g->width, 1};
    for (int d = 0; d < 2; d++) {
        const double low = g->grid[at - step[d]], high = g->grid[at + step[d]];
        const double bend = 2 * top - low - high;
        if (low > top || high > top) continue; /* no maximum of this field: one of two that the sharper one has */
        if (bend > 0 && isfinite(bend)) height += (high - low) * (high - low) / (8 * bend);
    }
    return height;
}

/* Mean growth of the cells within about a pitch; pins beyond three pitches weigh 1e-4 and are left out. */
static double grown(const float *growth, const double *rest, Py_ssize_t n, double x, double y, double pitch)
{
    const double scale = -1 / (pitch * pitch);
    double sum = 0, weight = 0;
    for (Py_ssize_t i = 0; i < n; i++) {
        const double dx = rest[2 * i] - x, dy = rest[2 * i + 1] - y, d = (dx * dx + dy * dy) * scale;
        if (d < -9) continue;
        const double w = exp(d);
        sum += w * growth[i];
        weight += w;
    }
    return weight > 0 ? sum / weight : 0;
}

/* Share of the pins round a place that are seen. */
static double witnessed(const Tip *tip, double x, double y, double within)
{
    Py_ssize_t all = 0, seen = 0;
    for (Py_ssize_t i = 0; i < tip->n; i++) {
        const double dx = tip->rest[2 * i] - x, dy = tip->rest[2 * i + 1] - y;
        if (dx * dx + dy * dy > within * within) continue;
        all++;
        seen += tip->seen[i] != 0;
    }
    return all ? (double)seen / (double)all : 0;
}

/* Whether a region is one touch or two that lie too near each other for the coarse field: the sharp field is
 * looked at within the region alone, and must have two maxima, one on each side of the middle, along the region's
 * axis, parted by a valley that is deep against the lower one and against the pins' noise. 1: `at` are the two. */
WIDE static int part_in_two(const Grid *g, const Fine *f, const Rules *rule, Tip *tip, int label, const Region *r, double angle,
                       int32_t at[2])
{
    Py_ssize_t live = 0, step[8];
    neighbours(f->width, step);
    for (Py_ssize_t p = 0; p < f->n; p++) f->mark[f->place[p]] = g->mark[g->place[f->coarse[p]]] == label;
    for (Py_ssize_t p = 0; p < f->n; p++) { /* the region and what touches it */
        int near = f->mark[f->place[p]];
        for (int d = 0; d < 8 && !near; d++) near = f->mark[f->place[p] + step[d]];
        if (!near) continue;
        const int16_t *restrict row = f->rows + p * f->m;
        int32_t sum = 0;
        for (Py_ssize_t i = 0; i < f->m; i++) sum += row[i] * f->work[i];
        f->grid[f->place[p]] = (float)sum * f->steps[p] * f->step + f->even;
        f->live[live++] = (int32_t)p;
    }
    int found = 0, m = 0;
    int32_t top[MAXIMA_MAX], point[MAXIMA_MAX];
    for (Py_ssize_t i = 0; i < live; i++) { /* strict maxima in the region, highest first */
        const int32_t here = f->place[f->live[i]];
        const float h = f->grid[here];
        int below = f->mark[here];
        for (int d = 0; d < 8 && below; d++) below = f->grid[here + step[d]] < h;
        if (!below || (m == MAXIMA_MAX && !(h > f->grid[top[m - 1]]))) continue;
        int k = m < MAXIMA_MAX ? m++ : m - 1;
        for (; k > 0 && f->grid[top[k - 1]] < h; k--) {
            top[k] = top[k - 1];
            point[k] = point[k - 1];
        }
        top[k] = here;
        point[k] = f->live[i];
    }
    const Grid fine = {f->grid, f->width, NULL, 0, f->mark, f->stack};
    const double along[2] = {cos(angle), sin(angle)};
    for (Py_ssize_t i = 0; i < live; i++) f->mark[f->place[f->live[i]]] = UNKNOWN;
    for (int j = 1; j < m && !found; j++) {
        const float h = f->grid[top[j]];
        const double noise = rule->fine_part * noise_of(tip) * f->gain[point[j]];
        const double deep = rule->fine_valley * h > noise ? rule->fine_valley * h : noise;
        if (!(h > 0) || leader_of(&fine, top, j, (float)(h - deep)) != j) continue;
        for (int i = 0; i < j && !found; i++) {
            const double ax = rule->fine_x0 + rule->fine_step * (top[i] % f->width - 1) - r->middle[0];
            const double ay = rule->fine_y0 + rule->fine_step * (top[i] / f->width - 1) - r->middle[1];
            const double bx = rule->fine_x0 + rule->fine_step * (top[j] % f->width - 1) - r->middle[0];
            const double by = rule->fine_y0 + rule->fine_step * (top[j] / f->width - 1) - r->middle[1];
            const double s = ax * along[0] + ay * along[1], t = bx * along[0] + by * along[1];
            const double apart = hypot(bx - ax, by - ay);
            found = s * t < 0 && apart <= rule->near * rule->pitch && fabs(t - s) >= rule->aligned * apart;
            if (found) {
                at[0] = g->place[f->coarse[point[i]]];
                at[1] = g->place[f->coarse[point[j]]];
            }
        }
    }
    for (Py_ssize_t i = 0; i < live; i++) f->grid[f->place[f->live[i]]] = -INFINITY;
    return found && at[0] != at[1];
}

/* The maxima that count, each with the contact it belongs to (-1: one too many), and each contact's first. */
typedef struct {
    int32_t at[MAXIMA_MAX + CONTACTS_MAX];
    float height[MAXIMA_MAX + CONTACTS_MAX];
    int of[MAXIMA_MAX + CONTACTS_MAX], leader[CONTACTS_MAX], m, c;
} Tops;

/* Grid points above a share of their contact's highest belong to it: moments and shape. Marks them. */
static void measure(const Grid *g, const Rules *rule, const Tops *t, Region *region, double *out)
{
    const double origin[2] = {rule->x0 - rule->step, rule->y0 - rule->step}; /* of the padded grid */
    float lowest = INFINITY;
    for (int i = 0; i < t->c; i++) {
        memset(&region[i], 0, sizeof(Region));
        region[i].level = rule->edge * t->height[t->leader[i]];
        if (region[i].level < lowest) lowest = (float)region[i].level;
    }
    for (Py_ssize_t p = 0; p < g->k; p++) {
        const float h = g->grid[g->place[p]];
        g->mark[g->place[p]] = -1;
        if (!(h > lowest)) continue;
        const int x = g->place[p] % (int)g->width, y = g->place[p] / (int)g->width;
        int near = 0, least = INT32_MAX;
        for (int j = 0; t->c > 1 && j < t->m; j++) {
            const int dx = x - t->at[j] % (int)g->width, dy = y - t->at[j] / (int)g->width;
            const int d2 = dx * dx + dy * dy;
            if (d2 < least) {
                least = d2;
                near = j;
            }
        }
        if (t->of[near] < 0) continue;
        Region *r = &region[t->of[near]];
        if (!(h > (float)r->level)) continue;
        g->mark[g->place[p]] = t->of[near];
        const double w = h - (float)r->level;
        r->n++;
        r->w += w;
        r->x += w * x;
        r->y += w * y;
        r->xx += w * x * x;
        r->xy += w * x * y;
        r->yy += w * y * y;
    }
    for (int i = 0; i < t->c; i++) {
        Region *r = &region[i];
        double *to = out + i * FIELDS;
        const double x = r->x / r->w, y = r->y / r->w;
        /* 1/12: a grid point stands for a square of one step. */
        const double xx = r->xx / r->w - x * x + 1 / 12.0, yy = r->yy / r->w - y * y + 1 / 12.0, xy = r->xy / r->w - x * y;
        const double mean = 0.5 * (xx + yy), half = hypot(0.5 * (xx - yy), xy);
        r->middle[0] = origin[0] + rule->step * x;
        r->middle[1] = origin[1] + rule->step * y;
        r->axis = 2 * sqrt(mean + half) * rule->step; /* a uniform ellipse's semi-axis is two standard deviations */
        to[2] = summit(g, t->at[t->leader[i]]);
        to[3] = r->n * rule->step * rule->step;
        to[4] = 0.5 * atan2(2 * xy, xx - yy);
        to[5] = sqrt((mean + half) / (mean - half > 1e-9 ? mean - half : 1e-9));
    }
}

/* `fine`: NULL where it is not made yet; `wanted` says whether it would have been looked at. */
static int find(const Grid *g, const float *threshold, const float *gain, const Rules *rule, Tip *tip, const Fine *fine,
                double *out, double *ridge, int *maxima_n, int *wanted)
{
    Tops t = {.m = 0, .c = 0};
    int32_t *at = t.at;
    float *height = t.height, room[MAXIMA_MAX]; /* room: of the noise at each maximum */
    int group[MAXIMA_MAX];
    *wanted = 0;
    *maxima_n = 0;
    mark_maxima(g);
    for (Py_ssize_t p = 0; p < g->k; p++) { /* the highest, in order; of equals the first */
        if (g->mark[g->place[p]] != TOP) continue;
        const float h = g->grid[g->place[p]];
        if (!(h > threshold[p])) continue;
        if (t.m == MAXIMA_MAX && !(h > height[t.m - 1])) continue;
        int i = t.m < MAXIMA_MAX ? t.m++ : t.m - 1;
        for (; i > 0 && height[i - 1] < h; i--) {
            height[i] = height[i - 1];
            at[i] = at[i - 1];
            room[i] = room[i - 1];
        }
        height[i] = h;
        at[i] = g->place[p];
        room[i] = gain[p];
    }
    if (!t.m) return 0;
    int kept = 0;
    while (kept < t.m && height[kept] >= (float)(rule->minor * height[0])) kept++;
    t.m = kept;
    const double origin[2] = {rule->x0 - rule->step, rule->y0 - rule->step}; /* of the padded grid */
    if (t.m > 1) {
        double mean[MAXIMA_MAX], most = -INFINITY;
        for (int i = 0; i < t.m; i++) {
            const double x = origin[0] + rule->step * (at[i] % g->width), y = origin[1] + rule->step * (at[i] / g->width);
            mean[i] = grown(tip->growth, tip->rest, tip->n, x, y, rule->pitch);
            if (mean[i] > most) most = mean[i];
        }
        const double least = rule->minor * most < most ? rule->minor * most : most;
        kept = 0;
        for (int i = 0; i < t.m; i++) {
            if (!(mean[i] >= least)) continue;
            at[kept] = at[i];
            room[kept] = room[i];
            height[kept++] = height[i];
        }
        t.m = kept;
    }
    for (int j = 0; j < t.m; j++) {
        const float noise = j ? (float)(rule->part * noise_of(tip)) * room[j] : 0;
        const float valley = (float)rule->valley * height[j], deep = valley > noise ? valley : noise;
        const int to = j ? leader_of(g, at, j, height[j] - deep) : 0;
        group[j] = to;
        if (to == j && t.c < CONTACTS_MAX) t.leader[t.c++] = j;
    }
    for (int j = 0; j < t.m; j++) {
        t.of[j] = -1;
        for (int i = 0; i < t.c; i++)
            if (t.leader[i] == group[j]) t.of[j] = i;
    }
    Region region[CONTACTS_MAX];
    measure(g, rule, &t, region, out);
    if (t.c > 1) { /* where hardly a pin is seen a contact is a guess: its ground is the others', if there are any */
        int to[CONTACTS_MAX], seen = 0;
        for (int i = 0; i < t.c; i++) {
            const double x = region[i].middle[0], y = region[i].middle[1];
            to[i] = witnessed(tip, x, y, rule->round) < rule->witnesses ? -1 : seen++;
        }
        if (seen > 0 && seen < t.c) {
            kept = 0;
            for (int j = 0; j < t.m; j++) {
                const int of = t.of[j] < 0 ? -1 : to[t.of[j]];
                if (of < 0) continue;
                if (t.leader[t.of[j]] == j) t.leader[of] = kept;
                at[kept] = at[j];
                height[kept] = height[j];
                t.of[kept++] = of;
            }
            t.m = kept;
            t.c = seen;
            measure(g, rule, &t, region, out);
        }
    }
    const int whole = t.c;
    int parted = 0;
    for (int i = 0; i < whole && t.c < CONTACTS_MAX; i++) {
        if (!(out[i * FIELDS + 5] > rule->elongated) || !(region[i].axis < rule->small * rule->pitch)) continue;
        int32_t two[2];
        *wanted = 1;
        if (!fine || !part_in_two(g, fine, rule, tip, i, &region[i], out[i * FIELDS + 4], two)) continue;
        const int first = t.leader[i]; /* its chain of maxima makes way for the two */
        kept = 0;
        for (int j = 0; j < t.m; j++) {
            if (t.of[j] == i && j != first) continue;
            for (int l = 0; l < t.c; l++)
                if (t.leader[l] == j) t.leader[l] = kept;
            at[kept] = at[j];
            height[kept] = height[j];
            t.of[kept++] = t.of[j];
        }
        t.m = kept;
        for (int l = 0; l < 2; l++) {
            const int j = l ? t.m++ : t.leader[i];
            at[j] = two[l];
            height[j] = g->grid[two[l]];
            t.of[j] = l ? t.c : i;
            t.leader[t.of[j]] = j;
        }
        t.c++;
        parted = 1;
    }
    if (parted) {
        for (int i = 1; i < t.c; i++) /* strongest first, again */
            for (int j = i; j > 0 && height[t.leader[j]] > height[t.leader[j - 1]]; j--) {
                const int l = t.leader[j];
                t.leader[j] = t.leader[j - 1];
                t.leader[j - 1] = l;
                for (int k = 0; k < t.m; k++) t.of[k] = t.of[k] == j ? j - 1 : t.of[k] == j - 1 ? j : t.of[k];
            }
        measure(g, rule, &t, region, out);
    }
    const int c = t.c;
    for (int i = 0; i < c; i++) { /* place: the pins round the middle, weighted by their cells' growth */
        const Region *r = &region[i];
        double *to = out + i * FIELDS, sum = 0, x = 0, y = 0;
        const double wide = 1.25 * r->axis, reach = rule->reach * rule->pitch;
        const double limit = wide > reach ? wide * wide : reach * reach;
        for (Py_ssize_t p = 0; p < tip->n; p++) {
            const double px = tip->xy[2 * p], py = tip->xy[2 * p + 1];
            const double dx = px - r->middle[0], dy = py - r->middle[1], d2 = dx * dx + dy * dy;
            if (!(tip->growth[p] > 0) || !(d2 < limit)) continue;
            int other = 0;
            for (int j = 0; j < c && !other; j++) {
                const double ex = px - region[j].middle[0], ey = py - region[j].middle[1];
                other = j != i && ex * ex + ey * ey < d2;
            }
            if (other) continue;
            const double w = tip->growth[p] * (1 - d2 / limit);
            sum += w;
            x += w * px;
            y += w * py;
        }
        to[0] = sum > 0 ? x / sum : r->middle[0];
        to[1] = sum > 0 ? y / sum : r->middle[1];
        to[6] = 0;
    }
    /* ridges, contact by contact */
    int written = 0;
    for (int i = 0; i < c; i++)
        for (int j = 0; j < t.m && written < MAXIMA_MAX; j++)
            if (t.of[j] == i) {
                ridge[2 * written] = origin[0] + rule->step * (at[j] % g->width);
                ridge[2 * written + 1] = origin[1] + rule->step * (at[j] / g->width);
                written++;
                out[i * FIELDS + 6]++;
            }
    *maxima_n = written;
    return c;
}

/* The fine grid's arrays; 0: an exception is set. */
static int take_fine(Arrays *a, PyObject *tuple, Fine *f, Py_ssize_t k)
{
    PyObject *o[9];
    double step, even;
    if (!PyArg_ParseTuple(tuple, "OOOOOOOOOndd:fine", &o[0], &o[1], &o[2], &o[3], &o[4], &o[5], &o[6], &o[7], &o[8], &f->width,
                          &step, &even))
        return 0;
    f->step = (float)step;
    f->even = (float)even;
    f->work = take(a, o[1], 'h', -1, 0, "work");
    f->m = f->work ? count(a) : 0;
    f->steps = f->work ? take(a, o[2], 'f', -1, 0, "steps") : NULL;
    f->n = f->steps ? count(a) : 0;
    f->rows = f->steps ? take(a, o[0], 'h', f->n * f->m, 0, "rows") : NULL;
    f->gain = f->rows ? take(a, o[3], 'f', f->n, 0, "gain") : NULL;
    f->place = f->gain ? take(a, o[4], 'i', f->n, 0, "place") : NULL;
    f->coarse = f->place ? take(a, o[5], 'i', f->n, 0, "coarse") : NULL;
    f->grid = f->coarse ? take(a, o[6], 'f', -1, 1, "grid") : NULL;
    const Py_ssize_t cells = f->grid ? count(a) : 0;
    int32_t *marks = f->grid ? take(a, o[7], 'i', 2 * cells, 1, "mark and stack") : NULL;
    f->live = marks ? take(a, o[8], 'i', f->n, 1, "live") : NULL;
    if (!f->live) return 0;
    f->mark = marks;
    f->stack = marks + cells;
    for (Py_ssize_t p = 0; p < f->n; p++)
        if (f->coarse[p] < 0 || f->coarse[p] >= k || f->place[p] <= f->width || f->place[p] >= cells - f->width - 1) {
            PyErr_SetString(PyExc_ValueError, "contacts: a fine point lies on the grid's border");
            return 0;
        }
    return 1;
}

static PyObject *contacts(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *o[17], *sharp;
    Arrays a = {.n = 0}, b = {.n = 0}, c = {.n = 0}; /* one holds sixteen */
    PyObject *result = NULL;
    Py_ssize_t width;
    Tip tip = {.sigma = -1};
    Fine fine;
    if (!PyArg_ParseTuple(args, "OOO(OOOOn)O(OOOO)(OOO)O!OO:contacts", &o[0], &o[1], &o[2], &o[3], &o[4], &o[5], &o[6], &width,
                          &o[7], &o[8], &o[9], &o[10], &o[11], &o[12], &o[13], &o[14], &PyTuple_Type, &sharp, &o[15], &o[16]))
        return NULL;
    const float *relief = take(&a, o[0], 'f', -1, 0, "relief");
    const Py_ssize_t k = relief ? count(&a) : 0;
    const float *threshold = relief ? take(&a, o[1], 'f', k, 0, "threshold") : NULL;
    const float *gain = threshold ? take(&a, o[2], 'f', k, 0, "gain") : NULL;
    const int32_t *place = gain ? take(&a, o[3], 'i', k, 0, "place") : NULL;
    float *grid = place ? take(&a, o[4], 'f', -1, 1, "grid") : NULL;
    const Py_ssize_t cells = grid ? count(&a) : 0;
    int32_t *mark = grid ? take(&a, o[5], 'i', cells, 1, "mark") : NULL;
    int32_t *stack = mark ? take(&a, o[6], 'i', cells, 1, "stack") : NULL;
    const Rules *rule = stack ? take(&a, o[7], 'd', sizeof(Rules) / sizeof(double), 0, "rules") : NULL;
    tip.growth = rule ? take(&b, o[8], 'f', -1, 0, "growth") : NULL;
    tip.n = tip.growth ? count(&b) : 0;
    tip.rest = tip.growth ? take(&b, o[9], 'd', 2 * tip.n, 0, "rest") : NULL;
    tip.xy = tip.rest ? take(&b, o[10], 'd', 2 * tip.n, 0, "xy") : NULL;
    tip.seen = tip.xy ? take(&b, o[11], '?', tip.n, 0, "seen") : NULL;
    tip.near = tip.seen ? take(&b, o[12], 'i', -1, 0, "near") : NULL;
    tip.width = tip.near && tip.n ? count(&b) / tip.n : 0;
    tip.weight = tip.near ? take(&b, o[13], 'd', tip.n * tip.width, 0, "weight") : NULL;
    tip.scratch = tip.weight ? take(&b, o[14], 'd', 2 * tip.n, 1, "scratch") : NULL;
    double *out = tip.scratch ? take(&b, o[15], 'd', CONTACTS_MAX * FIELDS, 1, "out") : NULL;
    double *ridge = out ? take(&b, o[16], 'd', 2 * MAXIMA_MAX, 1, "ridge") : NULL;
    if (!ridge) goto done;
    for (Py_ssize_t p = 0; p < k; p++) {
        if (place[p] <= width || place[p] >= cells - width - 1) {
            PyErr_SetString(PyExc_ValueError, "contacts: a point lies on the grid's border");
            goto done;
        }
        grid[place[p]] = relief[p];
    }
    const int sharper = PyTuple_Size(sharp) > 0;
    if (sharper && !take_fine(&c, sharp, &fine, k)) goto done;
    const Grid g = {grid, width, place, k, mark, stack};
    int maxima_n, found, wanted;
    Py_BEGIN_ALLOW_THREADS
    found = find(&g, threshold, gain, rule, &tip, sharper ? &fine : NULL, out, ridge, &maxima_n, &wanted);
    Py_END_ALLOW_THREADS
    result = Py_BuildValue("(iii)", found, maxima_n, wanted);
done:
    let_go(&c);
    let_go(&b);
    let_go(&a);
    return result;
}

static PyObject *maxima(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *o[4];
    Arrays a = {.n = 0};
    PyObject *result = NULL;
    Py_ssize_t width;
    if (!PyArg_ParseTuple(args, "OnOOO:maxima", &o[0], &width, &o[1], &o[2], &o[3])) return NULL;
    const float *grid = take(&a, o[0], 'f', -1, 0, "grid");
    const Py_ssize_t cells = grid ? count(&a) : 0;
    const int32_t *place = grid ? take(&a, o[1], 'i', -1, 0, "place") : NULL;
    const Py_ssize_t k = place ? count(&a) : 0;
    int32_t *mark = place ? take(&a, o[2], 'i', cells, 1, "mark") : NULL;
    int32_t *stack = mark ? take(&a, o[3], 'i', cells, 1, "stack") : NULL;
    if (!stack) goto done;
    for (Py_ssize_t p = 0; p < k; p++)
        if (place[p] <= width || place[p] >= cells - width - 1) {
            PyErr_SetString(PyExc_ValueError, "maxima: a point lies on the grid's border");
            goto done;
        }
    const Grid g = {grid, width, place, k, mark, stack};
    mark_maxima(&g);
    result = Py_NewRef(Py_None);
done:
    let_go(&a);
    return result;
}

/* ---- motion within the contact ------------------------------------------------------------------------- */

static PyObject *contact_pins(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *o[3];
    Arrays a = {.n = 0};
    PyObject *result = NULL;
    double least;
    if (!PyArg_ParseTuple(args, "OdOO:contact_pins", &o[0], &least, &o[1], &o[2])) return NULL;
    const double *change = take(&a, o[0], 'd', -1, 0, "change");
    const Py_ssize_t n = change ? count(&a) : 0;
    const double *unit = change ? take(&a, o[1], 'd', 2 * n, 0, "unit") : NULL;
    int32_t *out = unit ? take(&a, o[2], 'i', n, 1, "out") : NULL;
    if (!out) goto done;
    double total = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
    for (Py_ssize_t i = 0; i < n; i++) {
        const double c = change[i];
        if (!(c > least) || !(c > 0)) continue;
        const double u = unit[2 * i], v = unit[2 * i + 1];
        total += c;
        x += c * u;
        y += c * v;
        xx += c * u * u;
        xy += c * u * v;
        yy += c * v * v;
    }
    Py_ssize_t m = 0;
    if (!(total > 0)) {
        for (Py_ssize_t i = 0; i < n; i++) out[m++] = (int32_t)i;
    } else {
        x /= total;
        y /= total;
        xx = xx / total - x * x;
        xy = xy / total - x * y;
        yy = yy / total - y * y;
        const double det = xx * yy - xy * xy, limit = 4 * det;
        for (Py_ssize_t i = 0; i < n; i++) {
            const double u = unit[2 * i] - x, v = unit[2 * i + 1] - y;
            const int in = det > 1e-12 ? u * u * yy - 2 * u * v * xy + v * v * xx <= limit
                                       : change[i] > least && change[i] > 0; /* one pin, or all on a line */
            if (in) out[m++] = (int32_t)i;
        }
    }
    result = PyLong_FromSsize_t(m);
done:
    let_go(&a);
    return result;
}

static PyObject *torsion(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *o[3];
    Arrays a = {.n = 0};
    PyObject *result = NULL;
    Py_ssize_t m;
    if (!PyArg_ParseTuple(args, "OOOn:torsion", &o[0], &o[1], &o[2], &m)) return NULL;
    const double *rest = take(&a, o[0], 'd', -1, 0, "rest");
    const Py_ssize_t n = rest ? count(&a) / 2 : 0;
    const double *value = rest ? take(&a, o[1], 'd', 2 * n, 0, "motion") : NULL;
    const int32_t *pins = value ? take(&a, o[2], 'i', -1, 0, "pins") : NULL;
    if (!pins) goto done;
    if (m > count(&a)) m = count(&a);
    double x = 0, y = 0, re = 0, im = 0;
    Py_ssize_t used = 0;
    for (int round = 0; round < 2; round++) {
        if (round && used) {
            x /= (double)used;
            y /= (double)used;
        }
        for (Py_ssize_t p = 0; p < m; p++) {
            const Py_ssize_t i = pins[p];
            if (i < 0 || i >= n || isnan(value[2 * i])) continue;
            if (!round) {
                x += rest[2 * i];
                y += rest[2 * i + 1];
                used++;
            } else { /* conj(before) after; a common shift of `after` drops out */
                const double bx = rest[2 * i] - x, by = rest[2 * i + 1] - y;
                const double ax = bx + value[2 * i], ay = by + value[2 * i + 1];
                re += bx * ax + by * ay;
                im += bx * ay - by * ax;
            }
        }
    }
    result = PyFloat_FromDouble(used < 2 ? NAN : atan2(im, re));
done:
    let_go(&a);
    return result;
}

static PyObject *slip_sums(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *o[4];
    Arrays a = {.n = 0};
    PyObject *result = NULL;
    Py_ssize_t m;
    double ridge;
    if (!PyArg_ParseTuple(args, "OOOOnd:slip_sums", &o[0], &o[1], &o[2], &o[3], &m, &ridge)) return NULL;
    const double *now = take(&a, o[0], 'd', -1, 0, "now");
    const Py_ssize_t n = now ? count(&a) / 2 : 0;
    const double *before = now ? take(&a, o[1], 'd', 2 * n, 0, "before") : NULL;
    const double *unit = before ? take(&a, o[2], 'd', 2 * n, 0, "unit") : NULL;
    const int32_t *pins = unit ? take(&a, o[3], 'i', -1, 0, "pins") : NULL;
    if (!pins) goto done;
    if (m > count(&a)) m = count(&a);
    /* Plane by least squares with a faint ridge, for each component of the step. */
    double g[3][5] = {{0}}, size = 0, left = 0;
    Py_ssize_t used = 0;
    for (int round = 0; round < 2; round++) {
        if (round) {
            for (int r = 0; r < 3; r++) g[r][r] += ridge;
            solve_plane(g);
        }
        for (Py_ssize_t p = 0; p < m; p++) {
            const Py_ssize_t i = pins[p];
            if (i < 0 || i >= n) continue;
            const double dx = now[2 * i] - before[2 * i], dy = now[2 * i + 1] - before[2 * i + 1];
            if (isnan(dx)) continue;
            const double basis[3] = {1, unit[2 * i], unit[2 * i + 1]};
            if (!round) {
                for (int r = 0; r < 3; r++) {
                    for (int c = 0; c < 3; c++) g[r][c] += basis[r] * basis[c];
                    g[r][3] += basis[r] * dx;
                    g[r][4] += basis[r] * dy;
                }
                size += dx * dx + dy * dy;
                used++;
            } else {
                const double ex = dx - g[0][3] - g[1][3] * basis[1] - g[2][3] * basis[2];
                const double ey = dy - g[0][4] - g[1][4] * basis[1] - g[2][4] * basis[2];
                left += ex * ex + ey * ey;
            }
        }
        if (!used) break;
    }
    result = Py_BuildValue("(ndd)", used, size, left);
done:
    let_go(&a);
    return result;
}

static PyMethodDef methods[] = {
    {"motion", motion, METH_VARARGS, "motion(xy, rest, sigma, seen, out) -> (mean x, mean y, mean sigma, seen)"},
    {"ring_peak", ring_peak, METH_VARARGS, "ring_peak(value, columns, ring) -> (highest mean over a ring, or median, its row)"},
    {"coherent", coherent, METH_VARARGS, "coherent(xy, rest, ring, slope, scratch, limit, anywhere, first) -> bool"},
    {"typical_size", typical_size, METH_VARARGS, "typical_size(value, scratch) -> float: median of |value|"},
    {"centred", centred, METH_VARARGS, "centred(motion, scratch, out): less each column's median"},
    {"modes", modes, METH_VARARGS, "modes(re, im, gram, inverse, motion, seen, work, out): complex as pairs of float64"},
    {"roughness", roughness, METH_VARARGS, "roughness(xy, rest, seen, near, weight, scratch) -> float: noise of a pin"},
    {"heights", heights, METH_VARARGS,
     "heights(change, (xy, rest, ring, slope), rows, steps, work, growth, heights, level) -> float"},
    {"stretch", stretch, METH_VARARGS, "stretch(xy, rest, rows, steps, work, bent, stretch) -> (step of work, part that is even)"},
    {"contacts", contacts, METH_VARARGS,
     "contacts(relief, threshold, gain, (place, grid, mark, stack, width), rules, (growth, rest, xy, seen),"
     " (near, weight, scratch), fine, out, ridge) -> (contacts, points of ridges, whether fine was wanted)"},
    {"maxima", maxima, METH_VARARGS, "maxima(grid, width, place, mark, stack): 2 in mark is a maximum"},
    {"contact_pins", contact_pins, METH_VARARGS, "contact_pins(change, least, unit, out) -> int"},
    {"torsion", torsion, METH_VARARGS, "torsion(rest, motion, pins, n) -> float"},
    {"slip_sums", slip_sums, METH_VARARGS, "slip_sums(now, before, unit, pins, n, ridge) -> (pins, size, left)"},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "_features", "The arithmetic of edge.features.", 0, methods, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__features(void) { return PyModuleDef_Init(&module); }
