cimport cython
from edge.features.pin_motion cimport PinMotion


@cython.final
cdef class Slip:
    cdef readonly double slip_px, probability, of_twist
    cdef Py_ssize_t _n, _span, _n_core, _n_around, _n_begin
    cdef PinMotion _motion
    cdef const double[:, ::1] _rest
    cdef double _pressing_rel, _sigmas, _prior_odds, _pitch_px, _tip_radius_px
    cdef list _past  # motion of the last frames since the touch, area changes and times: the results' own
    cdef readonly bint unseen
    cdef bint _begun, _presses  # _presses: in the frame before
    cdef double[:, ::1] _begin  # motion where the path begins, a mean of _n_begin frames
    cdef int[::1] _core  # rows of the contact's pins, and of those around it
    cdef int[::1] _around
    cdef unsigned char[::1] _is_around
    cdef double[::1] _weight  # of each pin in the mean motion, and in its moment: across the way to the middle
    cdef double[:, ::1] _across
    cdef double[::1] _of_core, _of_around  # motion x, y, and its moment
    cdef double[::1] _noise_s  # of the core's drag and twist, and around it, for pins of one sigma
    cdef double _noise_q, _lag, _gap_ns
    cdef const double[:, :, ::1] _curves
    cdef int[::1] _n_path  # here and below: of the drag, and of the twist
    cdef double[::1] _spacing, _probable
    cdef double[:, ::1] _s, _q  # the paths
    cdef double[::1] _weight_of, _curve  # of a path's points
    cdef double[::1] _square  # of each share: of the path's distance from its curve, in sigmas

    cpdef void forget(self, bint touched=*) noexcept
    cpdef void update(self, object motion_px, object area_change, double sigma_px, long long at_ns) except *
    cdef void _compare(self, object area_change, double sigma_px, long long at_ns) except *
    cdef void _forget_path(self) noexcept
    @cython.locals(compressed=double, x=double, y=double, square=double)
    cdef void _begin_path(self, object area_change) except *
    cdef void _weigh(self, double radius2, double pitch2) noexcept
    cdef void _go_on(self, object area_change, double sigma_px) except *
    @cython.locals(total=double, x=double, y=double, turn=double, across_x=double, across_y=double)
    cdef void _measure(self, int[::1] rows, Py_ssize_t n, double[::1] out) noexcept
    cdef bint _follow(self, Py_ssize_t kind, double s, double q, double sigma) noexcept
    cdef void _evaluate(self, Py_ssize_t kind, Py_ssize_t n, double noise_s, double noise_q) noexcept


@cython.final
cdef class Vibration:
    cdef double _from_hz, _lasted_s, _power_px2
    cdef double[:, ::1] _before, _once, _twice
    cdef long long[::1] _frame_of  # the frame in which each pin was followed last
    cdef long long _frame, _before_ns

    cpdef void forget(self) noexcept
    cpdef object update(
        self, const double[:, ::1] motion, const int[::1] pins, Py_ssize_t n_pins, double sigma_px,
        long long capture_ns
    )
    cdef double _mean_square(
        self, const double[:, ::1] motion, const int[::1] pins, Py_ssize_t n_pins, double pole
    ) noexcept
    cdef void _join(
        self, const double[:, ::1] motion, const int[::1] pins, Py_ssize_t n_pins, Py_ssize_t held_n
    ) noexcept
