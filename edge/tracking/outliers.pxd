from edge.tracking.affine cimport LocalAffine


cdef class PhotometricFilter:
    cdef readonly Py_ssize_t n
    cdef LocalAffine affine
    cdef double ratio, brightness_change_min, sigma_ratio_max, support_min
    cdef double[::1] most2, rest_brightness, radius, rest_sigma_ratio, off, values
    cdef unsigned char[::1] suspect, trusted

    cdef bint find_suspects(
        self, const float[::1] residual, const unsigned char[::1] seen
    ) noexcept nogil
    cdef void filter(
        self, const double[::1] brightness, const double[::1] sigma, const double[:, ::1] motion,
        unsigned char[::1] seen, bint searched
    ) noexcept nogil
    cdef double _find_trusted(
        self, const double[::1] brightness, const double[::1] sigma, const unsigned char[::1] seen,
        double sigma_ratio_max
    ) noexcept nogil
    cdef bint _fits(self, const double[:, ::1] motion, Py_ssize_t i, double light2) noexcept nogil
    cdef double _off_trusted(self, const double[:, ::1] motion, Py_ssize_t i) noexcept nogil
