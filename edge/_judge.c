/* The arithmetic of `edge.judge` and `edge.faults` that every frame asks for: one pass over some hundred numbers each.
 *
 * Meaning and limits stand there. NaN marks a lost pin; it is not far, and has no length.
 */
#include "_buffers.h"
#include <math.h>
#include <stdint.h>

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

/* k-th smallest; reorders `v` */
static double select_kth(double *v, Py_ssize_t n, Py_ssize_t k)
{
    Py_ssize_t low = 0, high = n - 1;
    while (low < high) {
        const double pivot = v[(low + high) / 2];
        Py_ssize_t i = low, j = high;
        while (i <= j) {
            while (v[i] < pivot) i++;
            while (v[j] > pivot) j--;
            if (i <= j) {
                const double t = v[i];
                v[i++] = v[j];
                v[j--] = t;
            }
        }
        if (k <= j) high = j;
        else if (k >= i) low = i;
        else break;
    }
    return v[k];
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

static PyMethodDef methods[] = {
    {"levels", levels, METH_VARARGS, "levels(image, step, top) -> (sum of samples, how many reach top, how many)"},
    {"far", far, METH_VARARGS, "far(now, before, limit) -> how many points lie further apart; None: are longer"},
    {"middle_length", middle_length, METH_VARARGS, "middle_length(vectors, scratch) -> median length of (n, 2)"},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "_judge", "The arithmetic of edge.judge.", 0, methods, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__judge(void) { return PyModuleDef_Init(&module); }
