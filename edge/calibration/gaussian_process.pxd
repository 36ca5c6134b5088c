cimport cython


@cython.final
cdef class ProcessKernel:
    cdef Py_ssize_t n_inputs
    cdef Py_ssize_t n_models
    cdef readonly Py_ssize_t n_outputs
    cdef Py_ssize_t _n_nodes
    cdef Py_ssize_t _n_active
    cdef Py_ssize_t _width  # rows of L, the same for all models: shorter ones end in zeros
    cdef Py_ssize_t _gap
    cdef Py_ssize_t _volume
    cdef int[::1] _parent  # of each product; the root, 1, is its own
    cdef int[::1] _letter  # input that the parent is multiplied by; from n_inputs on its conjugate
    cdef int[::1] _active
    cdef unsigned char[::1] _needed
    cdef unsigned char[::1] _wanted
    cdef int[:, ::1] _first  # (models + 1, 4) first term, noise term, output, term of `lost`
    cdef int[::1] _node  # of each term
    cdef double[:, ::1] _weight
    cdef double[:, :, ::1] _factor  # (terms, 2, width): real parts, imaginary parts
    cdef int[::1] _noise_node
    cdef double[::1] _noise_weight
    cdef double[::1] _across_weight  # for the same terms
    cdef int[::1] _lost_node
    cdef double[::1] _lost_weight
    # (models, 9) far, range of the noise's logarithm, and across; scale, gap_power, volume_power, gap_max
    cdef double[:, ::1] _limits
    cdef double[:, ::1] _valid  # (outputs, 3) low, high, sigma
    cdef double[::1] _re  # products of the current frame
    cdef double[::1] _im
    cdef double[:, ::1] _sums  # (2, width)

    cpdef void run(self, const double[::1] z, double[:, ::1] out) noexcept
    cdef void _select(self) noexcept
    cdef void _multiply(self, const double[::1] z) noexcept
    cdef void _evaluate(self, Py_ssize_t m, double gap, double volume, double[:, ::1] out) noexcept
    cdef double _noise(self, Py_ssize_t m, double[::1] weight, Py_ssize_t limit) noexcept
    cdef double _lost(self, Py_ssize_t m, double gap, double volume) noexcept
    cdef void _write(self, Py_ssize_t o, double value, double variance, bint known, double[:, ::1] out) noexcept
    cdef void _leave_out(self, Py_ssize_t m, double[:, ::1] out) noexcept
