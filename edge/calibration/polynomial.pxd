cimport cython


@cython.final
cdef class ModelKernel:
    cdef Py_ssize_t n_inputs
    cdef readonly Py_ssize_t n_outputs
    cdef Py_ssize_t _n_models
    cdef unsigned char[::1] _wanted  # of each model
    # Each model's row says where its part of the arrays below begins. Row n_models marks the end.
    cdef Py_ssize_t[::1] _first_output
    cdef Py_ssize_t[::1] _first_knot  # a model without knots is a polynomial
    cdef Py_ssize_t[::1] _first_term
    cdef Py_ssize_t[::1] _first_spread
    cdef Py_ssize_t[::1] _curve_input
    cdef double[:, ::1] _knots  # input, output
    cdef int[::1] _shorter  # of each product but the first, which is 1: that without its last factor
    cdef int[::1] _column  # and this factor
    cdef double[:, ::1] _products  # their values
    cdef int[::1] _product_of  # of each term
    cdef double[:, ::1] _weights
    cdef float[:, ::1] _spread  # four rows of a factor, term by term: their real, then imaginary parts
    cdef double[::1] _low  # of each output
    cdef double[::1] _high
    cdef double[::1] _sigma
    cdef double[:, ::1] _row  # inputs, then their conjugates
    cdef double[:, ::1] _terms  # values of one model's terms

    cpdef void run(self, const double[::1] z, double[:, ::1] out) noexcept
    cdef void _multiply(self) noexcept
    cdef void _leave_out(self, Py_ssize_t m, double[:, ::1] out) noexcept
    cdef void _run_curve(self, Py_ssize_t m, double[:, ::1] out) noexcept
    cdef void _run_polynomial(self, Py_ssize_t m, double[:, ::1] out) noexcept
    cdef double _square_of_spread(self, Py_ssize_t m, Py_ssize_t n) noexcept
    cdef inline void _write(self, Py_ssize_t output, double y, double widened, double[:, ::1] out) noexcept
