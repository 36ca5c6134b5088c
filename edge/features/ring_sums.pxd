# The sums of `contact_detector`, which compiled Python runs too slowly, described in `ring_sums.py`. 331 rings of 7:
# 9,000 instructions instead of 18,000.

cdef extern from *:
    """
    static Py_ssize_t vt_highest_ring(const unsigned short *restrict ring, Py_ssize_t n, const double *restrict values,
                                      double *restrict highest)
    {
        Py_ssize_t row = 0, unknown = 0;
        double most = 0.0;
        for (Py_ssize_t i = 0; i < n; i++, ring += 7) {
            double sum = values[ring[0]];
            for (int k = 1; k < 7; k++) sum += values[ring[k]];
            unknown += sum != sum;
            if (sum > most) most = sum, row = i;
        }
        *highest = most;
        return unknown ? -1 : row;
    }
    """
    Py_ssize_t vt_highest_ring(const unsigned short *, Py_ssize_t, const double *, double *) noexcept nogil


cdef inline Py_ssize_t highest_ring(
    const unsigned short[:, ::1] ring, const double[::1] values, double[::1] highest
) noexcept nogil:
    return vt_highest_ring(&ring[0, 0], ring.shape[0], &values[0], &highest[0])
