cimport cython
from edge.features.pin_motion cimport PinMotion


@cython.final
cdef class Slip:
    cdef readonly double slip_px, probability
    cdef Py_ssize_t _n, _span, _n_core, _n_around, _n_path
    cdef PinMotion _motion
    cdef const double[:, ::1] _rest
    cdef double _pressing_rel, _noise_q, _spacing_px, _turned_sigma, _model_rel, _prior_odds
    cdef double[:, :, ::1] _past_px  # motion of the last frames, in turn, and their area changes
    cdef double[:, ::1] _past_change
    cdef Py_ssize_t _n_kept  # since the touch
    cdef bint _begun
    cdef double[:, ::1] _begin  # motion where the path begins
    cdef int[::1] _core  # rows of the pins in the core, and of those around the contact
    cdef int[::1] _around
    cdef unsigned char[::1] _is_around
    cdef double[::1] _far2  # of the contact's pins, px2 from its middle
    cdef double[::1] _some, _q, _curve
    cdef double _noise_s  # px
    cdef double[::1] _s  # the path
    cdef double[::1] _weight  # of its points
    cdef double[::1] _square  # of each share: of the path's distance from its curve, in sigmas

    cpdef void forget(self) noexcept
    cpdef void update(self, const double[::1] area_change, double sigma_px) noexcept
    cdef void _compare(self, const double[::1] area_change, double sigma_px, Py_ssize_t span) noexcept
    cdef void _forget_path(self) noexcept
    cdef void _begin_path(self, double sigma_px) noexcept
    cdef void _go_on(self, double sigma_px) noexcept
    cdef double _mean_step(self, Py_ssize_t d, int[::1] rows, Py_ssize_t n) noexcept
    cdef void _evaluate(self) noexcept


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
