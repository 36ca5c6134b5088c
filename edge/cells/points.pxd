cdef class FramePoints:
    cdef readonly object xy_img, area_px2
    cdef double[:, ::1] points  # the same memory
    cdef double[::1] area
    cdef Py_ssize_t n_pins, n_missing
    cdef const double[:, ::1] rest
    cdef int[::1] rim
    cdef double[:, ::1] rim_terms, fit, terms, around_rest
    cdef unsigned short[:, ::1] near  # where the x of a rim pin's residual stands
    cdef float[:, ::1] weight
    cdef double[::1] residual  # (2 r,) x, y, x, y, ...: motion of the rim pins less the affine fit
    cdef int[::1] missing
    cdef double[:, ::1] rows, inverse
    cdef double[::1] motion  # (2 n,) of the seen pins, zero where missing
    cdef double[::1] left  # (2 n,) of the motion of the last frame
    cdef double[::1] pull  # (2 n,) rows times motion

    cdef int place(self, const double[:, ::1] xy, double autocorrelation) except -1
    cdef void _fill_missing(self, double[:, ::1] points) noexcept
    cdef void _carry_around(self, double[:, ::1] points) noexcept
