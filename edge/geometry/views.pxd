cimport cython


@cython.final
cdef class PointsView:
    cdef object array
    cdef const double[:, ::1] view

    cdef const double[:, ::1] of(self, object array)
