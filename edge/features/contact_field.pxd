cimport cython


@cython.final
cdef class QuantizedOperator:
    cdef readonly float[::1] values, result
    cdef float[::1] _padded  # (w,), the values, and 0
    cdef short[::1] _weights  # of `_in_runs`, as the next three
    cdef int[::1] _start, _begin, _ahead
    cdef float[::1] _row_step
    cdef short[::1] _vector  # (w,), the values in whole steps

    cpdef void apply_rows(self, const int[::1] which, Py_ssize_t n) noexcept
    cdef float _quantize(self) noexcept


@cython.final
cdef class ContactField:
    cdef readonly float[::1] area_change, heights, divergence, blend, curl
    cdef readonly int[::1] active
    cdef readonly Py_ssize_t n_active
    cdef readonly float plane_divergence, plane_curl
    cdef readonly double[:, ::1] points
    cdef Py_ssize_t _n
    cdef QuantizedOperator _interpolator, _divergences
    cdef int[::1] _column  # of each pin in the interpolator; and in the divergences that of its x
    cdef int[::1] _column_both
    cdef float[::1] _change_row  # what the operators are multiplied with, in the order of their columns
    cdef float[::1] _detrended  # that is the motion less its plane, px
    cdef float[::1] _height_row  # results of their rows
    cdef float[::1] _divergence_row
    cdef int[::1] _near  # points near each pin, pin after pin
    cdef int[::1] _near_start  # (n + 1,)
    cdef unsigned char[::1] _is_active  # (k,), and up to 7 more
    cdef unsigned long long[::1] _are_active  # the same, eight at once
    cdef float _min_area_change, _heights_rel
    cdef const double[:, ::1] _rest
    cdef double[:, ::1] _inverse  # (3, 3), of the equations of a plane through all pins, about the first
    cdef float _divergence_rel  # shares of the blend

    cpdef void set_area_change(self, const double[::1] change) except *
    cpdef void find(self, const double[:, ::1] xy) except *
    cpdef void find_curl(self, const int[::1] which, Py_ssize_t n) noexcept
    cpdef object whole_surface(self)
    cdef void _find_active(self) noexcept
    @cython.locals(x0=double, xx=double, xy_=double, y0=double, yx=double, yy=double)
    cdef void _detrend(self, const double[:, ::1] xy) noexcept


@cython.final
cdef class PeakFinder:
    cdef readonly Py_ssize_t width, n_active, n_peaks
    cdef readonly int[::1] place, active, mark, at, point
    cdef readonly float[::1] grid, height
    cdef int[::1] _around  # (8,) from a place to its neighbours
    cdef int[::1] _stack

    cpdef void set_field(self, const float[::1] field, const int[::1] active, Py_ssize_t n_active) noexcept
    cpdef Py_ssize_t find(self, const float[::1] noise, float noise_factor, float least) noexcept
    cpdef void forget_searches(self) noexcept
    cpdef Py_ssize_t first_connected(self, Py_ssize_t j, float given, bint any_will_do) noexcept
    cdef bint _is_peak(self, int place, Py_ssize_t n) noexcept
    cdef void _insert(self, Py_ssize_t p, float h) noexcept
    cdef bint _is_maximum(self, Py_ssize_t here) noexcept
    cdef void _mark_plateau(self, Py_ssize_t start) noexcept
