cimport cython


@cython.final
cdef class AreaChange:
    cdef readonly double[::1] values
    cdef Py_ssize_t _n
    cdef const double[:, ::1] _rest
    cdef double[::1] _rest_area
    cdef double[::1] _inverse_area
    cdef int[:, ::1] _ring
    cdef double[:, :, ::1] _slope

    cpdef void since_rest(self, const double[:] area_px2, double[::1] out) except *
    cpdef void fill(self, const double[::1] change, const double[:, ::1] xy) noexcept
    cpdef double volume(self, double threshold) noexcept
    cdef double _between(self, const double[:, ::1] xy, Py_ssize_t i) noexcept
