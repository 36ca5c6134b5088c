# The widening of a polynomial's sigma, which compiled Python would form number by number, described in
# `spread_sums.py`. The five polynomials of a frame: 9,400 instructions with the AVX2 clone, chosen when the program
# loads; 21,000 number by number.

cdef extern from *:
    """
    #if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
    #define VT_WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
    #else
    #define VT_WIDE
    #endif

    /* of four rows the real parts, then the imaginary parts */
    typedef float vt_eight __attribute__((vector_size(32)));
    typedef float vt_eight_at __attribute__((vector_size(32), aligned(4), may_alias));

    VT_WIDE static double vt_sum_squares(const float *restrict spread, Py_ssize_t fours, const double *restrict terms,
                                         Py_ssize_t n)
    {
        double total = 0.0;
        for (Py_ssize_t f = 0; f < fours; f++) {
            vt_eight by_re = {0}, by_im = {0};
            for (Py_ssize_t i = 0; i < n; i++, spread += 8) {
                const vt_eight rows = *(const vt_eight_at *)spread;
                by_re += rows * (float)terms[2 * i];
                by_im += rows * (float)terms[2 * i + 1];
            }
            for (int r = 0; r < 4; r++) {
                const double re = by_re[r] - by_im[4 + r], im = by_im[r] + by_re[4 + r];
                total += re * re + im * im;
            }
        }
        return total;
    }
    """
    double vt_sum_squares(const float *, Py_ssize_t, const double *, Py_ssize_t) noexcept nogil


cdef inline double sum_squares(
    float[:, ::1] spread, Py_ssize_t first, Py_ssize_t end, double[:, ::1] terms, Py_ssize_t n
) noexcept nogil:
    if first == end:
        return 0.0
    return vt_sum_squares(&spread[first, 0], (end - first) // n, &terms[0, 0], n)
