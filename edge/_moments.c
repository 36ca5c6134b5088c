/* A polynomial in complex inputs: `edge.calibration` evaluates one model of its file with one call.
 *
 * terms are products of inputs, given as columns of the row (inputs, conjugates of inputs, 1).
 */
#include "_buffers.h"
#include <stdint.h>

typedef struct {
    double re, im;
} Complex;

static Complex product(const Complex *z, Py_ssize_t k, const int32_t *columns, Py_ssize_t longest)
{
    Complex p = {1, 0};
    for (Py_ssize_t i = 0; i < longest; i++) {
        const int32_t c = columns[i];
        if (c >= 2 * k) continue; /* the one */
        const Complex q = {z[c % k].re, c < k ? z[c].im : -z[c - k].im};
        const Complex r = {p.re * q.re - p.im * q.im, p.re * q.im + p.im * q.re};
        p = r;
    }
    return p;
}

static PyObject *run(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *o[5];
    Arrays a = {.n = 0};
    PyObject *result = NULL;
    if (!PyArg_ParseTuple(args, "OOOOO:run", &o[0], &o[1], &o[2], &o[3], &o[4])) return NULL;
    const Complex *z = take(&a, o[0], 'd', -1, 0, "inputs");
    const Py_ssize_t k = z ? count(&a) / 2 : 0;
    const Complex *weights = z ? take(&a, o[2], 'd', -1, 0, "weights") : NULL;
    const Py_ssize_t n = weights ? count(&a) / 2 : 0;
    const int32_t *terms = weights ? take(&a, o[1], 'i', -1, 0, "terms") : NULL;
    const Py_ssize_t longest = terms && n ? count(&a) / n : 0;
    const Py_ssize_t cells = terms ? count(&a) : 0;
    const Complex *spread = terms ? take(&a, o[3], 'd', -1, 0, "spread") : NULL;
    const Py_ssize_t rows = spread && n ? count(&a) / 2 / n : 0;
    Complex *psi = spread ? take(&a, o[4], 'd', 2 * n, 1, "scratch") : NULL;
    if (!psi) goto done;
    for (Py_ssize_t i = 0; i < cells; i++)
        if (terms[i] < 0 || terms[i] > 2 * k) {
            PyErr_SetString(PyExc_ValueError, "run: a term names an input that there is not");
            goto done;
        }
    Complex y = {0, 0};
    double away = 0;
    for (Py_ssize_t i = 0; i < n; i++) {
        psi[i] = product(z, k, terms + i * longest, longest);
        y.re += weights[i].re * psi[i].re - weights[i].im * psi[i].im;
        y.im += weights[i].re * psi[i].im + weights[i].im * psi[i].re;
    }
    for (Py_ssize_t r = 0; r < rows; r++) {
        const Complex *row = spread + r * n;
        double re = 0, im = 0;
        for (Py_ssize_t i = 0; i < n; i++) {
            re += row[i].re * psi[i].re - row[i].im * psi[i].im;
            im += row[i].re * psi[i].im + row[i].im * psi[i].re;
        }
        away += re * re + im * im;
    }
    result = Py_BuildValue("(ddd)", y.re, y.im, away);
done:
    let_go(&a);
    return result;
}

static PyMethodDef methods[] = {
    {"run", run, METH_VARARGS, "run(inputs, terms, weights, spread, scratch) -> (real, imaginary, |L psi|^2)"},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "_moments", "Polynomials in complex inputs.", 0, methods, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__moments(void) { return PyModuleDef_Init(&module); }
