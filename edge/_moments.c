/* The models of a calibration file, evaluated with one call: `edge.calibration` says what they mean.
 *
 * Idea. A file has half a dozen models of some sixty terms each, and asks for their values once a frame. The
 * arithmetic is a microsecond; what costs is every visit from Python. So all models are handed over once, checked
 * and copied, and answer together.
 *
 * Rules
 * - The terms of a polynomial are products of inputs, given as columns of the row (inputs, their conjugates, 1).
 * - A NaN among a model's inputs gives NaN, within its range.
 * - The GIL is held: the scratch belongs to the object, and the work is short.
 */
#include "_buffers.h"
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#define OUTPUTS_MAX 2
#define FIELDS 3 /* value, sigma, outside of the range (0 or 1) */

typedef struct {
    double re, im;
} Complex;

typedef struct {
    int outputs;                       /* 0: a curve, which has one */
    Py_ssize_t terms, longest, spread; /* numbers of terms, of inputs in each, of rows of the spread's factor */
    int32_t *columns;                  /* (terms, longest) */
    Complex *weights, *factor;         /* (terms,), (spread, terms) */
    double low[OUTPUTS_MAX], high[OUTPUTS_MAX], sigma[OUTPUTS_MAX];
    Py_ssize_t input, knots;
    double *knot; /* (knots, 2) */
} Model;

typedef struct {
    PyObject_HEAD
    Py_ssize_t n, inputs, outputs; /* models, inputs, outputs of all */
    Model *model;
    Complex *row, *psi; /* scratch: inputs, conjugates and 1; values of the terms */
} Models;

static void forget(Models *self)
{
    for (Py_ssize_t i = 0; self->model && i < self->n; i++) {
        free(self->model[i].columns);
        free(self->model[i].weights);
        free(self->model[i].factor);
        free(self->model[i].knot);
    }
    free(self->model);
    free(self->row);
    free(self->psi);
}

static void *copied(const void *from, Py_ssize_t items, size_t size)
{
    void *to = malloc(items ? (size_t)items * size : 1);
    if (!to) PyErr_NoMemory();
    else if (items) memcpy(to, from, (size_t)items * size);
    return to;
}

static int wrong(const char *what)
{
    PyErr_SetString(PyExc_ValueError, what);
    return 0;
}

/* (input's column, knots (m, 2), sigma) */
static int take_curve(Models *self, Model *m, PyObject *item)
{
    PyObject *knots;
    Arrays a = {.n = 0};
    int ok = 0;
    if (!PyArg_ParseTuple(item, "nOd:curve", &m->input, &knots, &m->sigma[0])) return 0;
    const double *knot = take(&a, knots, 'd', -1, 0, "knots");
    if (!knot) goto done;
    m->knots = count(&a) / 2;
    if (m->knots < 2 || m->input < 0 || m->input > 2 * self->inputs) {
        wrong("a curve needs two knots and an input that there is");
        goto done;
    }
    m->knot = copied(knot, 2 * m->knots, sizeof(double));
    ok = m->knot != NULL;
done:
    let_go(&a);
    return ok;
}

/* (terms (n, longest) int32, weights (n) and spread (rows, n) complex as pairs, valid (outputs, 2), sigma (outputs)) */
static int take_polynomial(Models *self, Model *m, PyObject *item)
{
    PyObject *o[5];
    Arrays a = {.n = 0};
    int ok = 0;
    if (!PyArg_ParseTuple(item, "OOOOO:moments", &o[0], &o[1], &o[2], &o[3], &o[4])) return 0;
    const double *sigma = take(&a, o[4], 'd', -1, 0, "sigma");
    if (!sigma) goto done;
    m->outputs = (int)count(&a);
    const double *valid = take(&a, o[3], 'd', 2 * (Py_ssize_t)m->outputs, 0, "valid");
    const Complex *weights = valid ? take(&a, o[1], 'd', -1, 0, "weights") : NULL;
    const Py_ssize_t pairs = weights ? count(&a) : 0;
    m->terms = pairs / 2;
    const int32_t *columns = weights ? take(&a, o[0], 'i', -1, 0, "terms") : NULL;
    const Py_ssize_t cells = columns ? count(&a) : 0;
    const Complex *factor = columns ? take(&a, o[2], 'd', -1, 0, "spread") : NULL;
    if (!factor) goto done;
    const Py_ssize_t factors = count(&a) / 2, odd = (pairs | count(&a)) & 1;
    m->longest = m->terms ? cells / m->terms : 0;
    m->spread = m->terms ? factors / m->terms : 0;
    if (odd || m->outputs < 1 || m->outputs > OUTPUTS_MAX || m->longest * m->terms != cells ||
        m->spread * m->terms != factors) {
        wrong("a polynomial's arrays do not belong together");
        goto done;
    }
    for (Py_ssize_t i = 0; i < cells; i++)
        if (columns[i] < 0 || columns[i] > 2 * self->inputs) {
            wrong("a term names an input that there is not");
            goto done;
        }
    for (int i = 0; i < m->outputs; i++) {
        m->low[i] = valid[2 * i];
        m->high[i] = valid[2 * i + 1];
        m->sigma[i] = sigma[i];
    }
    m->columns = copied(columns, cells, sizeof(int32_t));
    m->weights = copied(weights, m->terms, sizeof(Complex));
    m->factor = copied(factor, factors, sizeof(Complex));
    ok = m->columns && m->weights && m->factor;
done:
    let_go(&a);
    return ok;
}

static PyObject *models_new(PyTypeObject *type, PyObject *args, PyObject *kwargs)
{
    static char *names[] = {"inputs", "models", NULL};
    Py_ssize_t inputs, most = 1;
    PyObject *list;
    if (!PyArg_ParseTupleAndKeywords(args, kwargs, "nO:Models", names, &inputs, &list)) return NULL;
    if (inputs < 0 || inputs > 1 << 20 || !PyTuple_Check(list)) {
        wrong("Models: a number of inputs and a tuple of models are wanted");
        return NULL;
    }
    const allocfunc alloc = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
    Models *self = (Models *)alloc(type, 0);
    if (!self) return NULL;
    self->n = PyTuple_Size(list);
    self->inputs = inputs;
    self->model = calloc(self->n ? (size_t)self->n : 1, sizeof(Model));
    if (!self->model) {
        PyErr_NoMemory();
        goto failed;
    }
    for (Py_ssize_t i = 0; i < self->n; i++) {
        PyObject *item = PyTuple_GetItem(list, i);
        Model *m = &self->model[i];
        if (!PyTuple_Check(item)) {
            wrong("Models: each model is a tuple");
            goto failed;
        }
        if (!(PyTuple_Size(item) == 3 ? take_curve(self, m, item) : take_polynomial(self, m, item))) goto failed;
        self->outputs += m->knots ? 1 : m->outputs;
        if (m->terms > most) most = m->terms;
    }
    self->row = malloc((size_t)(2 * inputs + 1) * sizeof(Complex));
    self->psi = malloc((size_t)most * sizeof(Complex));
    if (!self->row || !self->psi) {
        PyErr_NoMemory();
        goto failed;
    }
    return (PyObject *)self;
failed:
    Py_DECREF(self);
    return NULL;
}

static void models_dealloc(Models *self)
{
    PyTypeObject *type = Py_TYPE((PyObject *)self);
    forget(self);
    const freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
    release(self);
    Py_DECREF(type);
}

/* Linear between the knots, flat beyond them. */
static void run_curve(const Model *m, const Complex *row, double *out)
{
    const double x = row[m->input].re, *first = m->knot, *last = m->knot + 2 * (m->knots - 1);
    out[0] = x;
    out[1] = m->sigma[0];
    out[2] = !(x >= first[0] && x <= last[0]);
    if (isnan(x)) return;
    const double *k = first;
    while (k + 2 < last && x >= k[2]) k += 2;
    out[0] = x <= first[0] ? first[1] : x >= last[0] ? last[1] : (k[3] - k[1]) / (k[2] - k[0]) * (x - k[0]) + k[1];
}

static void run_polynomial(const Model *m, const Complex *row, Complex *psi, double *out)
{
    const Py_ssize_t n = m->terms;
    Complex y = {0, 0};
    for (Py_ssize_t i = 0; i < n; i++) {
        const int32_t *columns = m->columns + i * m->longest;
        Complex p = {1, 0};
        for (Py_ssize_t l = 0; l < m->longest; l++) {
            const Complex q = row[columns[l]];
            p = (Complex){p.re * q.re - p.im * q.im, p.re * q.im + p.im * q.re};
        }
        psi[i] = p;
        y.re += m->weights[i].re * p.re - m->weights[i].im * p.im;
        y.im += m->weights[i].re * p.im + m->weights[i].im * p.re;
    }
    double away = 0;
    for (Py_ssize_t r = 0; r < m->spread; r++) {
        const Complex *factor = m->factor + r * n;
        Complex s = {0, 0};
        for (Py_ssize_t i = 0; i < n; i++) {
            s.re += factor[i].re * psi[i].re - factor[i].im * psi[i].im;
            s.im += factor[i].re * psi[i].im + factor[i].im * psi[i].re;
        }
        away += s.re * s.re + s.im * s.im;
    }
    const double widened = sqrt(1 + away), value[OUTPUTS_MAX] = {y.re, y.im};
    for (int i = 0; i < m->outputs; i++, out += FIELDS) {
        const int below = value[i] < m->low[i], above = value[i] > m->high[i];
        out[0] = below ? m->low[i] : above ? m->high[i] : value[i];
        out[1] = m->sigma[i] * widened;
        out[2] = below || above;
    }
}

static PyObject *models_run(Models *self, PyObject *args)
{
    PyObject *given, *wanted;
    Arrays a = {.n = 0};
    PyObject *result = NULL;
    const Py_ssize_t k = self->inputs;
    if (!PyArg_ParseTuple(args, "OO:run", &given, &wanted)) return NULL;
    const Complex *z = take(&a, given, 'd', -1, 0, "inputs");
    const Py_ssize_t rows = z && k ? count(&a) / 2 / k : 0;
    if (z && rows * 2 * k != count(&a)) {
        wrong("run: rows of another number of inputs");
        goto done;
    }
    double *out = z ? take(&a, wanted, 'd', rows * self->outputs * FIELDS, 1, "out") : NULL;
    if (!out) goto done;
    for (Py_ssize_t r = 0; r < rows; r++, z += k) {
        for (Py_ssize_t i = 0; i < k; i++) {
            self->row[i] = z[i];
            self->row[k + i] = (Complex){z[i].re, -z[i].im};
        }
        self->row[2 * k] = (Complex){1, 0};
        for (Py_ssize_t i = 0; i < self->n; i++) {
            const Model *m = &self->model[i];
            if (m->knots) run_curve(m, self->row, out);
            else run_polynomial(m, self->row, self->psi, out);
            out += FIELDS * (m->knots ? 1 : m->outputs);
        }
    }
    result = Py_NewRef(Py_None);
done:
    let_go(&a);
    return result;
}

static PyMethodDef models_methods[] = {
    {"run", (PyCFunction)models_run, METH_VARARGS,
     "run(inputs, out): writes (value, sigma, outside) of every output, row by row of the inputs."},
    {NULL, NULL, 0, NULL},
};

static PyType_Slot models_slots[] = {
    {Py_tp_new, (void *)models_new},
    {Py_tp_dealloc, (void *)models_dealloc},
    {Py_tp_methods, models_methods},
    {Py_tp_doc, "Models(inputs, models): curves and polynomials of that many complex inputs."},
    {0, NULL},
};

static PyType_Spec models_spec = {"edge._moments.Models", sizeof(Models), 0, Py_TPFLAGS_DEFAULT, models_slots};

static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "_moments", "The models of a calibration.", -1, NULL, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__moments(void)
{
    PyObject *self = PyModule_Create(&module);
    if (!self) return NULL;
    PyObject *type = PyType_FromSpec(&models_spec);
    if (!type || PyModule_AddObjectRef(self, "Models", type) < 0) {
        Py_XDECREF(type);
        Py_DECREF(self);
        return NULL;
    }
    Py_DECREF(type);
    return self;
}
