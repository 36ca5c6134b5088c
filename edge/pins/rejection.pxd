# One row of `centroids.ANSWER`.
cdef struct Answer:
    double x
    double y
    double sigma
    double amplitude
    double fit


cdef class CentroidFilter:
    cdef Py_ssize_t n
    cdef double fit_min, amplitude_share_min, clash_slanted
    cdef double[::1] rest_amplitude, ratio, along, x, y
    cdef int[::1] order

    cdef void reject(self, Answer[::1] found, const double[:, ::1] predicted) noexcept nogil
    cdef void _sort(self, Answer[::1] found) noexcept nogil
    cdef void _reject_clashes(self, Answer[::1] found, const double[:, ::1] predicted) noexcept nogil
    cdef void _reject_one(
        self, Answer[::1] found, const double[:, ::1] predicted, Py_ssize_t i, Py_ssize_t j
    ) noexcept nogil
