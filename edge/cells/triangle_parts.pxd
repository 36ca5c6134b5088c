# What `mesh` measures of each triangle, which baseline x86 runs too slowly as compiled Python, described in
# `triangle_parts.py`. A frame of 331 pins, 970 triangles: 82,000 instructions one by one and with SSE2, 34,000 with
# the AVX2 clone, chosen when the program loads.

cdef extern from *:
    """
    #include <string.h>

    #if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
    #define VT_WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
    #else
    #define VT_WIDE
    #endif

    /* one number of each of four triangles */
    typedef double vt_four __attribute__((vector_size(32)));
    typedef long long vt_mask __attribute__((vector_size(32)));
    typedef vt_four vt_four_at __attribute__((aligned(8)));
    typedef vt_mask vt_mask_at __attribute__((aligned(8)));

    #define VT_CORNER(of, k) {of[tail[k]], of[tail[3 + k]], of[tail[6 + k]], of[tail[9 + k]]}

    VT_WIDE static int vt_measure_fours(const int *restrict tail, const double *restrict x,
                                        const double *restrict y, Py_ssize_t n, double sliver, double bound,
                                        double tolerance, Py_ssize_t stride, double *restrict part,
                                        double *restrict share, double *restrict error, long long *restrict certain)
    {
        const vt_mask infinite = (vt_mask)((vt_four){0} + __builtin_inf());
        vt_mask plain = (vt_mask){0} == 0;
        for (Py_ssize_t t = 0; t + 4 <= n; t += 4, tail += 12) {
            const vt_four ax = VT_CORNER(x, 0), bx = VT_CORNER(x, 1), cx = VT_CORNER(x, 2);
            const vt_four ay = VT_CORNER(y, 0), by = VT_CORNER(y, 1), cy = VT_CORNER(y, 2);
            const vt_four abx = bx - ax, aby = by - ay, bcx = cx - bx, bcy = cy - by, cax = ax - cx, cay = ay - cy;
            const vt_four cross = aby * cax - abx * cay;
            const vt_four ab2 = abx * abx + aby * aby, bc2 = bcx * bcx + bcy * bcy, ca2 = cax * cax + cay * cay;
            const vt_four sum2 = ab2 + bc2 + ca2, inverse = 1.0 / cross, q = 0.5 * sum2 * inverse;
            const vt_four ab = -(bcx * cax + bcy * cay) * inverse * ab2;
            const vt_four bc = -(cax * abx + cay * aby) * inverse * bc2;
            const vt_four ca = -(abx * bcx + aby * bcy) * inverse * ca2;
            const vt_mask is_plain = cross > sliver * sum2;
            const vt_mask of_part = (vt_mask)(bound * q * (1.0 + q) * sum2);
            const vt_four errors = (vt_four)((of_part & is_plain) | (infinite & ~is_plain));
            plain &= is_plain;
            *(vt_four_at *)(part + t) = ab;
            *(vt_four_at *)(part + t + stride) = bc;
            *(vt_four_at *)(part + t + 2 * stride) = ca;
            const vt_mask ab_is = errors < tolerance * ab, bc_is = errors < tolerance * bc;
            const vt_mask ca_is = errors < tolerance * ca;
            const vt_four ab_own = (vt_four)((vt_mask)ab & ab_is), bc_own = (vt_four)((vt_mask)bc & bc_is);
            const vt_four ca_own = (vt_four)((vt_mask)ca & ca_is);
            *(vt_four_at *)(share + t) = ab_own + ca_own;
            *(vt_four_at *)(share + t + stride) = ab_own + bc_own;
            *(vt_four_at *)(share + t + 2 * stride) = bc_own + ca_own;
            *(vt_four_at *)(error + t) = errors;
            *(vt_mask_at *)(certain + t) = (ab_is & 1) | (bc_is & 2) | (ca_is & 4);
        }
        return plain[0] && plain[1] && plain[2] && plain[3];
    }

    /* The areas of the corners of each triangle, which get its shares, and a list of the triangles with a part that
       is not certain. */
    static Py_ssize_t vt_sum_shares(const int *restrict tail, const double *restrict share,
                                    const long long *restrict certain, Py_ssize_t n, Py_ssize_t stride,
                                    double *restrict area, Py_ssize_t n_points, int *restrict uncertain)
    {
        Py_ssize_t n_uncertain = 0;
        memset(area, 0, n_points * sizeof(double));
        for (Py_ssize_t t = 0; t < n; t++, tail += 3) {
            area[tail[0]] += share[t];
            area[tail[1]] += share[t + stride];
            area[tail[2]] += share[t + 2 * stride];
            uncertain[n_uncertain] = (int)t;
            n_uncertain += certain[t] != 7;
        }
        return n_uncertain;
    }
    """
    bint vt_measure_fours(
        const int *, const double *, const double *, Py_ssize_t, double, double, double, Py_ssize_t, double *,
        double *, double *, long long *
    ) noexcept nogil
    Py_ssize_t vt_sum_shares(
        const int *, const double *, const long long *, Py_ssize_t, Py_ssize_t, double *, Py_ssize_t, int *
    ) noexcept nogil


cdef inline bint measure_fours(
    int[::1] tail, double[::1] x, double[::1] y, Py_ssize_t n, double sliver, double bound, double tolerance,
    double[:, ::1] part, double[:, ::1] share, double[::1] error, long long[::1] certain
) noexcept nogil:
    return vt_measure_fours(
        &tail[0], &x[0], &y[0], n, sliver, bound, tolerance, part.shape[1], &part[0, 0], &share[0, 0], &error[0],
        &certain[0]
    )


cdef inline Py_ssize_t sum_shares(
    int[::1] tail, double[:, ::1] share, long long[::1] certain, Py_ssize_t n, double[::1] area, int[::1] uncertain
) noexcept nogil:
    return vt_sum_shares(
        &tail[0], &share[0, 0], &certain[0], n, share.shape[1], &area[0], area.shape[0], &uncertain[0]
    )
