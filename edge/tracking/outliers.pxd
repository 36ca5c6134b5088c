cdef struct Fit:
    double x
    double y
    double support


cdef class LocalAffine:
    cdef readonly Py_ssize_t n
    cdef Py_ssize_t k
    cdef unsigned short[:, ::1] near
    cdef float[:, ::1] weight
    cdef float[:, :, ::1] offset
    cdef double ridge

    cdef Fit fit(self, const double[:, ::1] motion, const unsigned char[::1] known, Py_ssize_t i) noexcept nogil


cdef class PhotometricFilter:
    cdef readonly Py_ssize_t n
    cdef LocalAffine affine
    cdef double ratio, brightness_change_min, sigma_ratio_max, support_min
    cdef double[::1] most2, rest_brightness, radius, rest_sigma_ratio, off, values
    cdef double gain  # of the frame in hand, shared by its pins
    cdef unsigned char[::1] trusted

    cdef bint find_doubts(
        self, const double[::1] brightness, const double[::1] sigma, const unsigned char[::1] seen, bint searched
    ) noexcept nogil
    cdef Py_ssize_t _below(self, const double[::1] values, double limit) noexcept nogil
    cdef void filter(
        self, const double[::1] brightness, const double[::1] sigma, const float[::1] residual,
        const double[:, ::1] motion, unsigned char[::1] seen
    ) noexcept nogil
    cdef bint _fits(self, const double[:, ::1] motion, Py_ssize_t i, double light2) noexcept nogil
    cdef double _off_trusted(self, const double[:, ::1] motion, Py_ssize_t i) noexcept nogil
