cimport cython


@cython.final
cdef class ContactDetector:
    cdef Py_ssize_t _n, _min_ring_known
    cdef Py_ssize_t _width  # pins of a ring
    cdef const double[:, ::1] _rest
    cdef unsigned short[:, ::1] _ring
    cdef double[:, :, ::1] _slope
    cdef double _pitch_px, _cell_noise, _ring_noise, _median_noise, _raise_sigma, _clear_sigma
    cdef double _noise_ratio_max, _noise_frames_n
    cdef double _rest_noise  # noise of a pin's motion, seen as at rest, pitches
    cdef double _noise_ratio  # of a cell: measured over predicted noise
    cdef double _ring_noise_ratio  # of a ring's mean
    cdef Py_ssize_t _untouched_n  # frames so far
    cdef bint _in_contact
    cdef double[::1] _root  # sqrt(known pins of a ring / all of them)
    cdef Py_ssize_t _peak_row  # the ring of `_highest_mean`
    cdef double _begins  # area change that begins a contact, of the last `by_area`
    cdef double[:, ::1] _middle  # ring medians of the motion; NaN: not looked up yet
    cdef double[::1] _ring_x  # motion of one ring
    cdef double[::1] _ring_y, _values, _ring_values
    # These are for the slopes of all ring medians at once, in blocks and in single precision.
    cdef Py_ssize_t _blocks_n
    cdef unsigned short[:, ::1] _twice  # twice the rows of each ring
    cdef int[::1] _users, _first_user  # the rings that a pin belongs to, and where those of each pin begin
    cdef unsigned char[::1] _is_bent  # whether a median that a pin's slope depends on is large
    cdef float[::1] _motion, _medians  # x and y of each pin or ring in turn
    cdef double _rounding  # error of a sum over a ring in single precision, over its terms' sizes
    cdef double _most_sum, _most_product  # of a ring's weights for x and for y, their sizes added up

    cpdef void forget(self) noexcept
    cpdef double cell_noise(self, double sigma_px) noexcept
    cpdef bint by_area(self, const double[::1] area_change, const double[:, ::1] xy, double sigma_px) noexcept
    cpdef int known(
        self, const double[:, ::1] xy, const double[::1] mean, double sigma_px, bint if_touched, bint if_untouched
    ) noexcept
    cdef bint _learns_next(self) noexcept
    @cython.locals(a=float, b=float, c=float, d=float, e=float, f=float, g=float)
    cdef bint _are_below(self, const double[:, ::1] xy, const double[::1] mean, double limit) noexcept
    cpdef bint by_motion(self, const double[:, ::1] xy, double sigma_px) noexcept
    cdef double _limit_sigma(self) noexcept
    cdef double _highest_mean(self, const double[::1] area_change) noexcept
    cdef double _ring_sum(self, const double[::1] values, Py_ssize_t i) noexcept
    cdef void _forget_medians(self, Py_ssize_t i) noexcept
    cdef bint _goes_on(self, const double[::1] area_change, const double[:, ::1] xy, double limit) noexcept
    cdef bint _is_coherent(self, const double[:, ::1] xy, double limit) noexcept
    @cython.locals(xx=double, xy_=double, yx=double, yy=double)
    cdef double _median_area_change(self, const double[:, ::1] xy, Py_ssize_t i) noexcept
    cdef Py_ssize_t _ring_median(self, const double[:, ::1] xy, Py_ssize_t i, double shift_x, double shift_y) noexcept
    cdef double _median_motion(self, const double[:, ::1] xy, Py_ssize_t component) noexcept
    cdef double _quietness(self, const double[::1] area_change) noexcept
    cdef void _learn(self, const double[::1] area_change, double predicted) noexcept
    cdef double _moved(self, double learnt, double[::1] sizes, Py_ssize_t n, double predicted, double frames) noexcept
