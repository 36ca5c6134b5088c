cimport cython


@cython.final
cdef class ContactDetector:
    cdef Py_ssize_t _n, _n_looked_up, _min_ring_known
    cdef Py_ssize_t _width  # pins of a ring
    cdef const double[:, ::1] _rest
    cdef unsigned short[:, ::1] _ring
    cdef double[:, :, ::1] _slope
    cdef double _pitch_px, _cell_noise, _ring_noise, _median_noise, _raise_sigma, _clear_sigma
    cdef double _noise_ratio_max, _noise_frames_n
    cdef double _rest_noise  # noise of a pin's motion, seen as at rest, pitches
    cdef double _noise_ratio  # of a cell: measured over predicted noise
    cdef double _ring_noise_ratio  # of a ring's mean
    cdef Py_ssize_t _turn  # which rings it is learnt from next
    cdef Py_ssize_t _learnt_n  # frames that it was learnt from
    cdef bint _in_contact
    cdef double[::1] _root  # sqrt(known pins of a ring / all of them)
    cdef Py_ssize_t _peak_row  # the ring of `_highest_mean`
    cdef double _begins  # area change that begins a contact, of the last `by_area`
    cdef double[:, ::1] _middle  # ring medians of the motion; NaN: not looked up yet
    cdef int[::1] _looked_up  # the first n_looked_up: rows of those that were
    cdef double[::1] _ring_x  # motion of one ring
    cdef double[::1] _ring_y, _values, _ring_values

    cpdef double cell_noise(self, double sigma_px) noexcept
    cpdef bint by_area(self, const double[::1] area_change, const double[:, ::1] xy, double sigma_px) noexcept
    cpdef bint holds(self, const double[:, ::1] xy) except? True
    cpdef bint by_motion(self, const double[:, ::1] xy, double sigma_px) noexcept
    cdef double _limit_sigma(self) noexcept
    cdef double _highest_mean(self, const double[::1] area_change) noexcept
    cdef bint _is_coherent(self, const double[:, ::1] xy, double limit) noexcept
    cdef void _forget_medians(self) noexcept
    cdef double _median_area_change(self, const double[:, ::1] xy, Py_ssize_t i) noexcept
    cdef Py_ssize_t _ring_median(self, const double[:, ::1] xy, Py_ssize_t i, double shift_x, double shift_y) noexcept
    cdef double _median_motion(self, const double[:, ::1] xy, Py_ssize_t component) noexcept
    cdef double _quietness(self, const double[::1] area_change) noexcept
    cdef void _learn(self, const double[::1] area_change, double predicted) noexcept
    cdef double _moved(self, double learnt, double[::1] sizes, Py_ssize_t n, double predicted) noexcept
