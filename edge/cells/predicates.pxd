cdef class Predicates:
    cdef const double[::1] x
    cdef const double[::1] y
    cdef double[:, ::1] term
    cdef Py_ssize_t[::1] n_terms
    cdef double orient(self, Py_ssize_t a, Py_ssize_t b, Py_ssize_t c) noexcept nogil
    cdef double incircle(self, Py_ssize_t a, Py_ssize_t b, Py_ssize_t c, Py_ssize_t d) noexcept nogil
    cdef double orient_exact(self, Py_ssize_t a, Py_ssize_t b, Py_ssize_t c) noexcept nogil
    cdef double incircle_exact(self, Py_ssize_t a, Py_ssize_t b, Py_ssize_t c, Py_ssize_t d) noexcept nogil
    cdef void _add(self, Py_ssize_t e, double number) noexcept nogil
    cdef void _difference(self, Py_ssize_t e, double a, double b) noexcept nogil
    cdef void _add_product(self, Py_ssize_t out, Py_ssize_t a, Py_ssize_t b, double sign) noexcept nogil
    cdef double _value(self, Py_ssize_t e) noexcept nogil
