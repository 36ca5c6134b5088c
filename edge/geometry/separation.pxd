cdef class Separation:
    cdef Py_ssize_t n
    cdef double[:, ::1] at
    cdef double far2

    cdef bint holds(self, const double[:, ::1] xy) noexcept nogil
    cdef void renew(self, const double[:, ::1] xy, double gap) noexcept nogil
