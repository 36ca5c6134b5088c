/* Arrays as C sees them: any object with the buffer protocol, checked for type and size, let go of together. */
#ifndef EDGE_BUFFERS_H
#define EDGE_BUFFERS_H

#include <Python.h>
#include <string.h>

#define ARRAYS_MAX 16

typedef struct {
    Py_buffer view[ARRAYS_MAX];
    int n;
} Arrays;

static void let_go(Arrays *a)
{
    while (a->n > 0) PyBuffer_Release(&a->view[--a->n]);
}

/* The data of a C-contiguous array of one item type, of `want` items (-1: any number); NULL with an exception
 * set. `type` is the struct code: d, f, h, i, B, or ? for bool. */
static void *take(Arrays *a, PyObject *object, char type, Py_ssize_t want, int writable, const char *name)
{
    Py_buffer *view = &a->view[a->n];
    const int flags = PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | (writable ? PyBUF_WRITABLE : 0);
    if (PyObject_GetBuffer(object, view, flags) < 0) return NULL;
    a->n++;
    const char *format = view->format ? view->format : "B";
    if (format[0] != type || format[1] != 0) {
        PyErr_Format(PyExc_ValueError, "%s: items of type '%c' are wanted, not '%s'", name, type, format);
        return NULL;
    }
    if (want >= 0 && view->len != want * view->itemsize) {
        PyErr_Format(PyExc_ValueError, "%s: %zd items are wanted, not %zd", name, want, view->len / view->itemsize);
        return NULL;
    }
    return view->buf;
}

/* Number of items of the array taken last. */
static Py_ssize_t count(const Arrays *a)
{
    const Py_buffer *view = &a->view[a->n - 1];
    return view->len / view->itemsize;
}

#endif
