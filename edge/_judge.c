/* The arithmetic of `edge.judge` and `edge.faults` that every frame asks for: each a pass over some hundred numbers.
 *
 * Meaning and limits stand there. NaN marks a lost pin; it is not far, and has no length.
 */
#include "_buffers.h"
#include "_select.h"
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

/* Sum of every step-th pixel of every step-th row, and how many of them reach `top`. */
static PyObject *levels(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *object;
    Py_ssize_t step;
    long top;
    Py_buffer view;
    if (!PyArg_ParseTuple(args, "Onl:levels", &object, &step, &top)) return NULL;
    if (PyObject_GetBuffer(object, &view, PyBUF_STRIDES | PyBUF_FORMAT) < 0) return NULL;
    const int wide = view.format && !strcmp(view.format, "H"), narrow = view.format && !strcmp(view.format, "B");
    if (view.ndim != 2 || !(wide || narrow) || step < 1) {
        PyErr_SetString(PyExc_ValueError, "levels: an image (h, w) of uint8 or uint16, and a step, are wanted");
        PyBuffer_Release(&view);
        return NULL;
    }
    long long sum = 0;
    Py_ssize_t full = 0, n = 0;
    for (Py_ssize_t y = 0; y < view.shape[0]; y += step) {
        const char *row = (const char *)view.buf + y * view.strides[0];
        for (Py_ssize_t x = 0; x < view.shape[1]; x += step) {
            const char *at = row + x * view.strides[1];
            const long level = wide ? *(const uint16_t *)at : *(const uint8_t *)at;
            sum += level;
            full += level >= top;
            n++;
        }
    }
    PyBuffer_Release(&view);
    return Py_BuildValue("(Lnn)", sum, full, n);
}

/* How many of the points lie further than a limit from where they were; of vectors (None), how many are longer. */
static PyObject *far(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *now, *before;
    double limit;
    Arrays a = {.n = 0};
    PyObject *result = NULL;
    if (!PyArg_ParseTuple(args, "OOd:far", &now, &before, &limit)) return NULL;
    const double *xy = take(&a, now, 'd', -1, 0, "now");
    const Py_ssize_t n = xy ? count(&a) / 2 : 0;
    const int vectors = before == Py_None;
    const double *was = !xy || vectors ? xy : take(&a, before, 'd', 2 * n, 0, "before");
    if (!was) goto done;
    Py_ssize_t many = 0;
    for (Py_ssize_t i = 0; i < n; i++) {
        const double dx = xy[2 * i] - (vectors ? 0 : was[2 * i]), dy = xy[2 * i + 1] - (vectors ? 0 : was[2 * i + 1]);
        many += dx * dx + dy * dy > limit * limit;
    }
    result = PyLong_FromSsize_t(many);
done:
    let_go(&a);
    return result;
}

/* Median length of the vectors, as numpy.nanmedian has it; 0 where there is none. */
static PyObject *middle_length(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *vectors, *room;
    Arrays a = {.n = 0};
    PyObject *result = NULL;
    if (!PyArg_ParseTuple(args, "OO:middle_length", &vectors, &room)) return NULL;
    const double *v = take(&a, vectors, 'd', -1, 0, "vectors");
    const Py_ssize_t n = v ? count(&a) / 2 : 0;
    double *length2 = v ? take(&a, room, 'd', n, 1, "scratch") : NULL;
    if (!length2) goto done;
    Py_ssize_t m = 0;
    for (Py_ssize_t i = 0; i < n; i++) {
        const double square = v[2 * i] * v[2 * i] + v[2 * i + 1] * v[2 * i + 1];
        if (!isnan(square)) length2[m++] = square;
    }
    double middle = 0;
    if (m) {
        middle = sqrt(select_kth(length2, m, m / 2));
        if (m % 2 == 0) middle = 0.5 * (middle + sqrt(select_kth(length2, m, m / 2 - 1)));
    }
    result = PyFloat_FromDouble(middle);
done:
    let_go(&a);
    return result;
}

/* From the k-th lowest of n levels to the k-th highest, counted from 0. */
static double span_of(uint16_t *level, Py_ssize_t n, Py_ssize_t k, int wide, double *room)
{
    if (wide) {
        for (Py_ssize_t i = 0; i < n; i++) room[i] = level[i];
        const double low = select_kth(room, n, k);
        return select_kth(room, n, n - 1 - k) - low;
    }
    Py_ssize_t many[256] = {0}, below = 0;
    for (Py_ssize_t i = 0; i < n; i++) many[level[i]]++;
    int low = 0, high = 255;
    while ((below += many[low]) <= k) low++;
    for (below = many[high]; below <= k; below += many[high]) high--;
    return high - low;
}

/* Of each window: mean square of the differences of neighbours, along x and along y together; and the span of its
 * levels without the lowest and the highest twentieth. Returns the mean level. */
static PyObject *windows(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *object, *places, *wanted;
    Py_ssize_t side;
    Py_buffer view;
    Arrays a = {.n = 0};
    PyObject *result = NULL;
    uint16_t *level = NULL;
    double *room = NULL;
    if (!PyArg_ParseTuple(args, "OOnO:windows", &object, &places, &side, &wanted)) return NULL;
    if (PyObject_GetBuffer(object, &view, PyBUF_STRIDES | PyBUF_FORMAT) < 0) return NULL;
    const int wide = view.format && !strcmp(view.format, "H"), narrow = view.format && !strcmp(view.format, "B");
    const int32_t *corner = take(&a, places, 'i', -1, 0, "corners");
    const Py_ssize_t m = corner ? count(&a) / 2 : 0;
    double *out = corner ? take(&a, wanted, 'd', 2 * m, 1, "out") : NULL;
    if (!out) goto done;
    int sound = view.ndim == 2 && (wide || narrow) && side > 1 && side < 1 << 14;
    for (Py_ssize_t w = 0; sound && w < m; w++)
        sound = corner[2 * w] >= 0 && corner[2 * w + 1] >= 0 && corner[2 * w] + side <= view.shape[1] &&
                corner[2 * w + 1] + side <= view.shape[0];
    if (!sound) {
        PyErr_SetString(PyExc_ValueError, "windows: an image (h, w) of uint8 or uint16, and windows within it");
        goto done;
    }
    const Py_ssize_t n = side * side;
    level = malloc((size_t)n * sizeof(*level));
    room = malloc((size_t)n * sizeof(*room));
    if (!level || !room) {
        PyErr_NoMemory();
        goto done;
    }
    double total = 0;
    for (Py_ssize_t w = 0; w < m; w++) {
        double sum = 0, energy = 0;
        for (Py_ssize_t y = 0; y < side; y++) {
            const char *row = (const char *)view.buf + (corner[2 * w + 1] + y) * view.strides[0];
            row += corner[2 * w] * view.strides[1];
            uint16_t *to = level + y * side;
            for (Py_ssize_t x = 0; x < side; x++, row += view.strides[1]) {
                to[x] = wide ? *(const uint16_t *)row : *(const uint8_t *)row;
                const double dx = x ? to[x] - to[x - 1] : 0, dy = y ? to[x] - to[x - side] : 0;
                energy += dx * dx + dy * dy;
                sum += to[x];
            }
        }
        out[2 * w] = energy / (double)(side * (side - 1));
        out[2 * w + 1] = span_of(level, n, n / 20, wide, room);
        total += sum / (double)n;
    }
    result = PyFloat_FromDouble(m ? total / (double)m : 0);
done:
    free(level);
    free(room);
    let_go(&a);
    PyBuffer_Release(&view);
    return result;
}

static PyMethodDef methods[] = {
    {"windows", windows, METH_VARARGS, "windows(image, corners, side, out) -> mean level; out: (energy, span) of each"},
    {"levels", levels, METH_VARARGS, "levels(image, step, top) -> (sum of samples, how many reach top, how many)"},
    {"far", far, METH_VARARGS, "far(now, before, limit) -> how many points lie further apart; None: are longer"},
    {"middle_length", middle_length, METH_VARARGS, "middle_length(vectors, scratch) -> median length of (n, 2)"},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "_judge", "The arithmetic of edge.judge.", 0, methods, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__judge(void) { return PyModuleDef_Init(&module); }
