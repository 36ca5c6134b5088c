# How `mesh` takes the coordinates of a frame, which baseline x86 runs too slowly as compiled Python, described in
# `coordinates.py`. 484 points: 5,000 instructions with the AVX2 clone, chosen when the program loads; 15,000 one by one.

cdef extern from *:
    """
    #if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
    #define VT_WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
    #else
    #define VT_WIDE
    #endif

    /* x and y of two points */
    typedef double vt_two __attribute__((vector_size(32), aligned(8)));
    typedef long long vt_two_masks __attribute__((vector_size(32), aligned(8)));

    VT_WIDE static int vt_extent(const double *restrict points, Py_ssize_t n, double *restrict low_,
                                 double *restrict high_)
    {
        vt_two low = {points[0], points[1], points[0], points[1]}, high = low, zero = low - low;
        for (Py_ssize_t i = n & 1; i < n; i += 2) { /* the first of an odd number has been taken */
            const vt_two at = *(const vt_two *)(points + 2 * i);
            const vt_two_masks lower = at < low, higher = at > high;
            low = (vt_two)(((vt_two_masks)at & lower) | ((vt_two_masks)low & ~lower));
            high = (vt_two)(((vt_two_masks)at & higher) | ((vt_two_masks)high & ~higher));
            zero += at - at; /* NaN if any is NaN or infinite */
        }
        for (int d = 0; d < 2; d++) {
            low_[d] = low[d + 2] < low[d] ? low[d + 2] : low[d];
            high_[d] = high[d + 2] > high[d] ? high[d + 2] : high[d];
        }
        return zero[0] + zero[1] + zero[2] + zero[3] == 0.0;
    }

    VT_WIDE static void vt_take(const double *restrict points, Py_ssize_t n, double tiny, double *restrict x,
                                double *restrict y)
    {
        for (Py_ssize_t i = 0; i < n; i++) {
            x[i] = __builtin_fabs(points[2 * i]) < tiny ? 0.0 : points[2 * i];
            y[i] = __builtin_fabs(points[2 * i + 1]) < tiny ? 0.0 : points[2 * i + 1];
        }
    }
    """
    bint vt_extent(const double *, Py_ssize_t, double *, double *) noexcept nogil
    void vt_take(const double *, Py_ssize_t, double, double *, double *) noexcept nogil


cdef inline bint extent(const double[:, ::1] points, double[::1] low, double[::1] high) noexcept nogil:
    return vt_extent(&points[0, 0], points.shape[0], &low[0], &high[0])


cdef inline void take(const double[:, ::1] points, double tiny, double[::1] x, double[::1] y) noexcept nogil:
    vt_take(&points[0, 0], points.shape[0], tiny, &x[0], &y[0])
