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
