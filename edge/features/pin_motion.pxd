cimport cython

from edge.geometry.copies cimport Copies, numbers_of


@cython.final
cdef class PinMotion:
    cdef readonly double[:, ::1] xy, motion
    cdef readonly double[::1] mean
    cdef readonly double sigma_px, sigma_max_px, longest_px, step_px
    cdef readonly int[::1] pins
    cdef public Py_ssize_t n_pins
    cdef readonly double left_px2, curl  # of `fit_step`
    cdef Py_ssize_t _n
    cdef const double[:, ::1] _rest
    cdef const double[::1] _at_rest  # this, `xy` and `motion` in one piece: their addresses need no sums
    cdef double[::1] _xy, _motion
    cdef object _no_offset  # zeros
    cdef double _x0, _y0, _per_px  # of the tip's unit disc: its middle, px, and what a px is of its radius
    cdef double[:, ::1] _g  # (3, 5), equations of a plane: three unknowns, two right sides

    @cython.locals(x=double, y=double, sigma=double, widest=double, longest2=double, step2=double)
    cpdef Py_ssize_t since_rest(self, object xy, object sigma_px, object offset_px=*) except -1
    @cython.locals(total=double, x=double, y=double, xx=double, xy=double, yy=double)
    cpdef Py_ssize_t find_contact(self, const double[::1] area_change, double least) noexcept
    cpdef double torsion(self) noexcept
    cpdef bint is_pressing(self, object now, object before, double least_rel, double least) except -1
    cpdef Py_ssize_t fit_step(self, object before) except -1
    cdef void _solve_plane(self) noexcept


@cython.final
cdef class ModeProduct:
    cdef float[:, ::1] _rows  # (n, ROW), real part where a >= b in a mode's powers, there imaginary part of (b, a)
    cdef int[::1] _mirror
    cdef double complex[::1] _result
    cdef Copies _results

    cpdef object fit(self, const double[:, ::1] motion)


@cython.final
cdef class AreaChange:
    cdef readonly double[::1] values
    cdef Py_ssize_t _n
    cdef const double[:, ::1] _rest
    cdef double[::1] _rest_area, _inverse_area
    cdef int[:, ::1] _ring
    cdef double[:, :, ::1] _slope

    cpdef void since_rest(self, object area_px2, double[::1] out) except *
    cpdef void fill(self, const double[::1] change, const double[:, ::1] xy) noexcept
    cpdef double volume(self, double threshold) noexcept
    @cython.locals(xx=double, xy_=double, yx=double, yy=double)
    cdef double _between(self, const double[:, ::1] xy, Py_ssize_t i) noexcept


@cython.final
cdef class PinNoise:
    cdef const double[:, ::1] _rest
    cdef int[::1] _start
    cdef unsigned short[::1] _near
    cdef float[::1] _weight, _residual
    cdef float[::1] _motion  # (2 n,), single precision: its error is 1e-6 px
    cdef double[::1] _sizes

    cpdef double sigma_px(self, const double[:, ::1] xy, const unsigned char[::1] seen) noexcept
