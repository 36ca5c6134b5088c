# The sums of `contact_fit` over a line's points, which compiled Python runs too slowly, one pin after another: four
# pins at a time, described in `line_sums.py`.

cdef extern from *:
    """
    #if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
    #define VT_WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
    #else
    #define VT_WIDE
    #endif

    /* one number of each of four pins */
    typedef double vt_four __attribute__((vector_size(32)));
    typedef double vt_any_four __attribute__((vector_size(32), aligned(8), may_alias));

    #define VT_PUT(row, four) (*(vt_any_four *)(sums + (row) * stride + i) = (four))

    VT_WIDE static void vt_line_sums(
        const double *restrict place, Py_ssize_t n, double middle_x, double middle_y, double half_x, double half_y,
        double i2, const double *restrict node, const double *restrict weight, Py_ssize_t nodes, int derive,
        double *restrict sums, Py_ssize_t stride)
    {
        for (Py_ssize_t i = 0; i < n; i += 4) {
            const double *p[4];
            for (int j = 0; j < 4; j++) p[j] = place + 2 * (i + j < n ? i + j : n - 1); /* beyond: as the last one */
            const vt_four x = (vt_four){p[0][0], p[1][0], p[2][0], p[3][0]} - middle_x;
            const vt_four y = (vt_four){p[0][1], p[1][1], p[2][1], p[3][1]} - middle_y;
            vt_four f0 = {0}, kx = {0}, ky = {0};
            if (!derive) {
                for (Py_ssize_t k = 0; k < nodes; k++) {
                    const vt_four dx = x - node[k] * half_x, dy = y - node[k] * half_y;
                    const vt_four f = 1.0 / (1.0 + 0.5 * ((dx * dx + dy * dy) * i2)), wf = f * weight[k], g = f * wf;
                    f0 += wf, kx += g * dx, ky += g * dy;
                }
                VT_PUT(0, f0), VT_PUT(1, kx), VT_PUT(2, ky);
                continue;
            }
            vt_four kxx = {0}, kxy = {0}, kyy = {0}, zx = {0}, zy = {0}, zxx = {0}, zxy = {0}, zyy = {0};
            vt_four fs = {0}, sx = {0}, sy = {0};
            for (Py_ssize_t k = 0; k < nodes; k++) {
                const double z = node[k];
                const vt_four dx = x - z * half_x, dy = y - z * half_y, r2 = (dx * dx + dy * dy) * i2;
                const vt_four f = 1.0 / (1.0 + 0.5 * r2), wf = f * weight[k], g = f * wf, gx = g * dx, gy = g * dy;
                const vt_four g3 = 2.0 * i2 * f, ex = g3 * gx, s = 2.0 * f * r2;
                const vt_four gxx = g - ex * dx, gxy = -ex * dy, gyy = g - g3 * gy * dy;
                f0 += wf, kx += gx, ky += gy, kxx += gxx, kxy += gxy, kyy += gyy;
                zx += z * gx, zy += z * gy, zxx += z * gxx, zxy += z * gxy, zyy += z * gyy;
                fs += g * r2, sx += s * gx, sy += s * gy;
            }
            VT_PUT(0, f0), VT_PUT(1, kx), VT_PUT(2, ky), VT_PUT(3, kxx), VT_PUT(4, kxy), VT_PUT(5, kyy);
            VT_PUT(6, zx), VT_PUT(7, zy), VT_PUT(8, zxx), VT_PUT(9, zxy), VT_PUT(10, zyy);
            VT_PUT(11, fs), VT_PUT(12, sx), VT_PUT(13, sy);
        }
    }
    """
    void vt_line_sums(
        const double *, Py_ssize_t, double, double, double, double, double, const double *, const double *,
        Py_ssize_t, bint, double *, Py_ssize_t
    ) noexcept nogil


cdef inline void line_sums(
    double[:, ::1] place, Py_ssize_t n, double middle_x, double middle_y, double half_x, double half_y, double i2,
    double[::1] node, double[::1] weight, bint derive, double[:, ::1] sums
) noexcept nogil:
    if n:
        vt_line_sums(
            &place[0, 0], n, middle_x, middle_y, half_x, half_y, i2, &node[0], &weight[0], node.shape[0], derive,
            &sums[0, 0], sums.shape[1]
        )
