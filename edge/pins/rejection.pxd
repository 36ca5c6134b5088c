from edge.geometry.neighbours cimport Separation


cdef class CentroidFilter:
    cdef Py_ssize_t n
    cdef double share_min, scale, clash_slanted
    cdef double[::1] rest_amplitude, ratio, along, x, y
    cdef int[::1] order
    cdef Separation separation

    cdef void reject(
        self, double[:, ::1] xy, double[::1] sigma, const double[::1] amplitude, const double[::1] fit,
        const double[:, ::1] predicted
    ) noexcept nogil
    cdef void _reject_dim(
        self, double[:, ::1] xy, double[::1] sigma, const double[::1] amplitude, Py_ssize_t m
    ) noexcept nogil
    cdef void _sort(self, const double[:, ::1] xy) noexcept nogil
    cdef void _reject_clashes(
        self, double[:, ::1] xy, double[::1] sigma, const double[:, ::1] predicted
    ) noexcept nogil
    cdef void _reject_one(
        self, double[:, ::1] xy, double[::1] sigma, const double[:, ::1] predicted, Py_ssize_t i, Py_ssize_t j
    ) noexcept nogil
