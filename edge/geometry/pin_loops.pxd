# Loops over all pins, which baseline x86 runs too slowly as compiled Python, described in `pin_loops.py`. The C compiler
# makes vectors of them: 331 residuals are checked in 4,400 instructions with the AVX2 clone, chosen when the program
# loads, in 18,000 one by one.

from libc.string cimport memcpy

cdef extern from *:
    """
    #if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
    #define VT_WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
    #else
    #define VT_WIDE
    #endif

    VT_WIDE static void vt_subtract(const double *restrict a, const double *restrict b, Py_ssize_t n,
                                    double *restrict out)
    {
        for (Py_ssize_t i = 0; i < 2 * n; i++) out[i] = a[i] - b[i];
    }

    VT_WIDE static void vt_subtract_single(const double *restrict a, const double *restrict b, Py_ssize_t n,
                                           float *restrict out)
    {
        for (Py_ssize_t i = 0; i < 2 * n; i++) out[i] = (float)(a[i] - b[i]);
    }

    VT_WIDE static void vt_extrapolate(const double *restrict now, const double *restrict last, Py_ssize_t n,
                                       double share, double *restrict out)
    {
        for (Py_ssize_t i = 0; i < 2 * n; i++) out[i] = now[i] + share * (now[i] - last[i]);
    }

    VT_WIDE static void vt_square_distances(const double *restrict a, const double *restrict b,
                                            const double *restrict unit2, Py_ssize_t n, double *restrict out)
    {
        for (Py_ssize_t i = 0; i < n; i++) {
            const double x = a[2 * i] - b[2 * i], y = a[2 * i + 1] - b[2 * i + 1];
            out[i] = (x * x + y * y) / unit2[i];
        }
    }

    VT_WIDE static void vt_subtract_prediction(const double *restrict found, const double *restrict rest,
                                               const float *restrict predicted, Py_ssize_t n,
                                               float *restrict residual)
    {
        for (Py_ssize_t i = 0; i < 2 * n; i++) residual[i] = (float)(found[i] - rest[i] - predicted[i]);
    }

    VT_WIDE static int vt_within(const float *restrict residual, const float *restrict before,
                                 const double *restrict most2, double change,
                                 const double *restrict change2, Py_ssize_t n, unsigned char *restrict is_within)
    {
        unsigned char changed = 0;
        for (Py_ssize_t i = 0; i < n; i++) {
            const double x = residual[2 * i], y = residual[2 * i + 1];
            const double dx = x - before[2 * i], dy = y - before[2 * i + 1];
            const unsigned char is = (x * x + y * y < most2[i]) & (dx * dx + dy * dy < change * change2[i]);
            changed |= is ^ is_within[i];
            is_within[i] = is;
        }
        return changed;
    }

    VT_WIDE static int vt_beyond(const float *restrict residual, const double *restrict most2,
                                 const unsigned char *restrict seen, Py_ssize_t n,
                                 unsigned char *restrict is_beyond)
    {
        unsigned char some = 0;
        for (Py_ssize_t i = 0; i < n; i++) {
            const double x = residual[2 * i], y = residual[2 * i + 1];
            is_beyond[i] = (x * x + y * y > most2[i]) & seen[i];
            some |= is_beyond[i];
        }
        return some;
    }

    VT_WIDE static int vt_all_near(const double *restrict a, const float *restrict b, Py_ssize_t n, double far2)
    {
        long long far = 0;
        for (Py_ssize_t i = 0; i < n; i++) {
            const double x = a[2 * i] - b[2 * i], y = a[2 * i + 1] - b[2 * i + 1];
            far |= -(long long)(!(x * x + y * y < far2) & (a[2 * i] == a[2 * i]));
        }
        return !far;
    }
    """
    void vt_subtract(const double *, const double *, Py_ssize_t, double *) noexcept nogil
    void vt_subtract_single(const double *, const double *, Py_ssize_t, float *) noexcept nogil
    void vt_extrapolate(const double *, const double *, Py_ssize_t, double, double *) noexcept nogil
    void vt_square_distances(const double *, const double *, const double *, Py_ssize_t, double *) noexcept nogil
    void vt_subtract_prediction(
        const double *, const double *, const float *, Py_ssize_t, float *
    ) noexcept nogil
    bint vt_within(
        const float *, const float *, const double *, double, const double *, Py_ssize_t, unsigned char *
    ) noexcept nogil
    bint vt_beyond(
        const float *, const double *, const unsigned char *, Py_ssize_t, unsigned char *
    ) noexcept nogil
    bint vt_all_near(const double *, const float *, Py_ssize_t, double) noexcept nogil


cdef inline void copy(const double[:, ::1] a, double[:, ::1] out) noexcept nogil:
    memcpy(&out[0, 0], &a[0, 0], a.shape[0] * 2 * sizeof(double))


cdef inline void subtract(const double[:, ::1] a, const double[:, ::1] b, double[:, ::1] out) noexcept nogil:
    vt_subtract(&a[0, 0], &b[0, 0], out.shape[0], &out[0, 0])


cdef inline void subtract_single(const double[:, ::1] a, const double[:, ::1] b, float[:, ::1] out) noexcept nogil:
    vt_subtract_single(&a[0, 0], &b[0, 0], a.shape[0], &out[0, 0])


cdef inline void extrapolate(
    const double[:, ::1] now, const double[:, ::1] last, double share, double[:, ::1] out
) noexcept nogil:
    vt_extrapolate(&now[0, 0], &last[0, 0], now.shape[0], share, &out[0, 0])


cdef inline void square_distances(
    const double[:, ::1] a, const double[:, ::1] b, const double[::1] unit2, double[::1] out
) noexcept nogil:
    vt_square_distances(&a[0, 0], &b[0, 0], &unit2[0], a.shape[0], &out[0])


cdef inline void subtract_prediction(
    const double[:, ::1] found, const double[:, ::1] rest, const float[:, ::1] predicted, float[:, ::1] residual
) noexcept nogil:
    vt_subtract_prediction(&found[0, 0], &rest[0, 0], &predicted[0, 0], found.shape[0], &residual[0, 0])


cdef inline bint within(
    const float[:, ::1] residual, const float[:, ::1] before, const double[::1] most2, double change,
    const double[::1] change2, unsigned char[::1] is_within
) noexcept nogil:
    return vt_within(
        &residual[0, 0], &before[0, 0], &most2[0], change, &change2[0], residual.shape[0], &is_within[0]
    )


cdef inline bint beyond(
    const float[:, ::1] residual, const double[::1] most2, const unsigned char[::1] seen, unsigned char[::1] is_beyond
) noexcept nogil:
    return vt_beyond(&residual[0, 0], &most2[0], &seen[0], residual.shape[0], &is_beyond[0])


cdef inline bint all_near(const double[:, ::1] a, const float[:, ::1] b, double far2) noexcept nogil:
    return vt_all_near(&a[0, 0], &b[0, 0], a.shape[0], far2)
