cimport cython


@cython.final
cdef class NumbersView:
    cdef object array
    cdef const double[::1] view

    cdef const double[::1] of(self, object array)


@cython.final
cdef class PointsView:
    cdef object array
    cdef const double[:, ::1] view

    cdef const double[:, ::1] of(self, object array)


@cython.final
cdef class RowsView:
    cdef object array
    cdef const int[::1] view

    cdef const int[::1] of(self, object array)
