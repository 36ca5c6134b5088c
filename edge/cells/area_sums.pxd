# The sums of `first_order`, which baseline x86 runs too slowly as compiled Python, described in `area_sums.py`. A frame
# of 331 pins: 29,000 instructions with the AVX2 clone, chosen when the program loads; 49,000 one by one.

cdef extern from *:
    """
    #if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
    #define VT_WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
    #else
    #define VT_WIDE
    #endif

    /* x and y of two neighbours */
    typedef double vt_two __attribute__((vector_size(32), aligned(8)));

    VT_WIDE static Py_ssize_t vt_area_sums(const int *restrict start, const int *restrict near_,
                                           const double *restrict slope, const double *restrict motion,
                                           const double *restrict rest, const double *restrict most,
                                           Py_ssize_t i, Py_ssize_t n, double *restrict area)
    {
        for (; i < n; i++) {
            const double *const own = motion + 2 * i;
            const vt_two from = {own[0], own[1], own[0], own[1]};
            vt_two sum = {0}, square = {0};
            for (Py_ssize_t k = start[i]; k < start[i + 1]; k += 2) { /* an even number of neighbours */
                const double *const a = motion + near_[k], *const b = motion + near_[k + 1];
                const vt_two to = {a[0], a[1], b[0], b[1]}, by = to - from;
                sum += *(const vt_two *)(slope + 2 * k) * by;
                square += by * by;
            }
            area[i] = rest[i] + ((sum[0] + sum[2]) + (sum[1] + sum[3]));
            if (!((square[0] + square[2]) + (square[1] + square[3]) <= most[i])) break;
        }
        return i;
    }
    """
    Py_ssize_t vt_area_sums(
        const int *, const int *, const double *, const double *, const double *, const double *, Py_ssize_t,
        Py_ssize_t, double *
    ) noexcept nogil


cdef inline Py_ssize_t area_sums(
    const int[::1] start, const int[::1] near, const double[:, ::1] slope, const double[:, ::1] motion,
    const double[::1] rest, const double[::1] most, Py_ssize_t first, Py_ssize_t n, double[::1] area
) noexcept nogil:
    return vt_area_sums(
        &start[0], &near[0], &slope[0, 0], &motion[0, 0], &rest[0], &most[0], first, n, &area[0]
    )
