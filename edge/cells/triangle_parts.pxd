# What `mesh` measures of each triangle, which baseline x86 runs too slowly as compiled Python, described in
# `triangle_parts.py`. A frame of 331 pins, 970 triangles: 82,000 instructions one by one and with SSE2, 31,000 with
# the AVX2 clone, chosen when the program loads.

cdef extern from *:
    """
    #if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
    #define VT_WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
    #else
    #define VT_WIDE
    #endif

    /* one number of each of four triangles */
    typedef double vt_four __attribute__((vector_size(32)));
    typedef long long vt_mask __attribute__((vector_size(32)));

    #define VT_CORNER(of, k) {of[tail[k]], of[tail[3 + k]], of[tail[6 + k]], of[tail[9 + k]]}

    VT_WIDE static int vt_measure_fours(const int *restrict tail, const double *restrict x,
                                        const double *restrict y, Py_ssize_t n, double sliver, double bound,
                                        double *restrict part, double *restrict error)
    {
        const vt_mask infinite = (vt_mask)((vt_four){0} + __builtin_inf());
        vt_mask plain = (vt_mask){0} == 0;
        for (Py_ssize_t t = 0; t + 4 <= n; t += 4, tail += 12, part += 12) {
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
            for (int k = 0; k < 4; k++) {
                part[3 * k] = ab[k], part[3 * k + 1] = bc[k], part[3 * k + 2] = ca[k];
                error[t + k] = errors[k];
            }
        }
        return plain[0] && plain[1] && plain[2] && plain[3];
    }
    """
    bint vt_measure_fours(
        const int *, const double *, const double *, Py_ssize_t, double, double, double *, double *
    ) noexcept nogil


cdef inline bint measure_fours(
    int[::1] tail, double[::1] x, double[::1] y, Py_ssize_t n, double sliver, double bound, double[::1] part,
    double[::1] error
) noexcept nogil:
    return vt_measure_fours(&tail[0], &x[0], &y[0], n, sliver, bound, &part[0], &error[0])
