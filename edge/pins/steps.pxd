# The steps of `centroids` from the sums over windows, four pins at a time, described in `steps.py`. A frame of 331
# pins: 125,000 instructions one by one in compiled Python, 23,000 with the AVX2 clone, chosen when the program loads.

cdef extern from *:
    """
    #include <math.h>
    #include <string.h>
    #if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
    #define VT_WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
    #else
    #define VT_WIDE
    #endif

    /* one number of each of four pins */
    typedef double vt_four __attribute__((vector_size(32)));
    typedef long long vt_mask __attribute__((vector_size(32)));
    typedef double vt_any_four __attribute__((vector_size(32), aligned(8), may_alias));

    #define VT_SUM 8 /* numbers of a window */
    #define VT_NORM 24 /* and of a phase, in the order of NORM */

    #define VT_WHERE(mask, a) ((vt_four)((vt_mask)(a) & (mask)))
    #if defined(__clang__)
    #define VT_MIX(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
    #else
    #define VT_MIX(a, b, ...) __builtin_shuffle(a, b, (vt_mask){__VA_ARGS__})
    #endif
    /* the numbers k to k + 3 of four pins' rows */
    #define VT_COLUMNS(of, k, first, second, third, fourth) \
        vt_four first, second, third, fourth; \
        do { \
            const vt_four r0 = *(const vt_any_four *)(of[0] + k), r1 = *(const vt_any_four *)(of[1] + k); \
            const vt_four r2 = *(const vt_any_four *)(of[2] + k), r3 = *(const vt_any_four *)(of[3] + k); \
            const vt_four even01 = VT_MIX(r0, r1, 0, 4, 2, 6), odd01 = VT_MIX(r0, r1, 1, 5, 3, 7); \
            const vt_four even23 = VT_MIX(r2, r3, 0, 4, 2, 6), odd23 = VT_MIX(r2, r3, 1, 5, 3, 7); \
            first = VT_MIX(even01, even23, 0, 1, 4, 5), second = VT_MIX(odd01, odd23, 0, 1, 4, 5); \
            third = VT_MIX(even01, even23, 2, 3, 6, 7), fourth = VT_MIX(odd01, odd23, 2, 3, 6, 7); \
        } while (0)

    VT_WIDE static Py_ssize_t vt_take_steps(
        int *who, Py_ssize_t n, int *at, double *x_of, double *y_of, double *sums, const double *norms,
        const double *predicted, int first, double near2, double far2, double reach2, double noise2, double gain,
        double *xy, double *sigma, double *amplitude, double *fit)
    {
        Py_ssize_t on_n = 0;
        for (Py_ssize_t j = n; j < (n + 3) / 4 * 4; j++) { /* up to three more, as the last one */
            who[j] = who[n - 1], at[j] = at[n - 1];
            x_of[j] = x_of[n - 1], y_of[j] = y_of[n - 1];
            memcpy(sums + VT_SUM * j, sums + VT_SUM * (n - 1), VT_SUM * sizeof *sums);
        }
        for (Py_ssize_t j = 0; j < n; j += 4, sums += 4 * VT_SUM) {
            const double *const s[4] = {sums, sums + VT_SUM, sums + 2 * VT_SUM, sums + 3 * VT_SUM};
            const double *const p[4] = {
                norms + VT_NORM * (Py_ssize_t)at[j], norms + VT_NORM * (Py_ssize_t)at[j + 1],
                norms + VT_NORM * (Py_ssize_t)at[j + 2], norms + VT_NORM * (Py_ssize_t)at[j + 3]};
            VT_COLUMNS(s, 0, a, tx, ty, level);
            VT_COLUMNS(s, 4, u, v, square, inv_pixels);
            /* numbered as in NORM; step_max is 20 */
            VT_COLUMNS(p, 8, inv_d, x_d, y_d, x_u);
            VT_COLUMNS(p, 12, y_v, d_u, tx_u, d_v);
            VT_COLUMNS(p, 16, ty_v, freedom, inv_freedom, radius);

            const vt_four inverse = 1.0 / a, a2 = a * a;
            const vt_four ex = tx * x_d, ey = ty * y_d;
            const vt_mask far = ex * ex + ey * ey > far2 * a2;
            const vt_four su = u + d_u * a, sv = v + d_v * a, gu = su + tx_u * tx, gv = sv + ty_v * ty;
            const vt_four gu2 = gu * gu, gv2 = gv * gv;
            const vt_four energy = square - level * level * inv_pixels;
            const vt_four rest = energy - a2 - tx * tx - ty * ty - gu2 - gv2;
            const vt_four variance = VT_WHERE(rest > 0.0, rest) * inv_freedom + 1.0 / 12.0, limit = 4.0 * variance;
            const vt_four keep_x = VT_WHERE((gu2 > limit) & ~far, 1.0 - limit / gu2);
            const vt_four keep_y = VT_WHERE((gv2 > limit) & ~far, 1.0 - limit / gv2);
            const vt_four hx = ex - keep_x * gu * x_u, hy = ey - keep_y * gv * y_v;
            const vt_mask seen = a > 0.0, on = (hx * hx + hy * hy >= near2 * a2) & seen;
            const vt_four sx = hx * inverse, sy = hy * inverse;

            const vt_four left = energy - gu * su - gv * sv;
            const vt_mask has = (left > 0.0) & seen;
            const vt_four inv_left = 1.0 / left;
            const vt_four missing = rest - freedom * (noise2 + 1.0 / 12.0);
            const vt_four m = VT_WHERE((missing > 0.0) & has, missing * inv_left), hidden = radius * m * m;
            const vt_four spread = x_d * x_d + y_d * y_d + keep_x * (x_u * x_u) + keep_y * (y_v * y_v);
            const vt_four noise = 0.5 * variance * spread * inverse * inverse;
            const vt_four variances = noise + hidden * hidden;
            const vt_four amplitudes = VT_WHERE(seen, a * inv_d * gain), fits = VT_WHERE(has, a2 * inv_left);

            const vt_four x = *(const vt_any_four *)(x_of + j) + sx, y = *(const vt_any_four *)(y_of + j) + sy;
            const int i = who[j];
            if (who[j + 1] == i + 1 && who[j + 2] == i + 2 && who[j + 3] == i + 3) { /* at once */
                const vt_four even = VT_MIX(x, y, 0, 4, 2, 6), odd = VT_MIX(x, y, 1, 5, 3, 7);
                *(vt_any_four *)(xy + 2 * i) = VT_MIX(even, odd, 0, 1, 4, 5);
                *(vt_any_four *)(xy + 2 * i + 4) = VT_MIX(even, odd, 2, 3, 6, 7);
                *(vt_any_four *)(amplitude + i) = amplitudes;
                *(vt_any_four *)(fit + i) = fits;
                for (int k = 0; k < 4; k++) sigma[i + k] = sqrt(variances[k]);
            }
            else for (int k = 0; k < 4; k++) {
                const int m = who[j + k];
                xy[2 * m] = x[k], xy[2 * m + 1] = y[k];
                amplitude[m] = amplitudes[k], fit[m] = fits[k], sigma[m] = sqrt(variances[k]);
            }
            if (first && !(on[0] | on[1] | on[2] | on[3])) continue;
            for (int k = 0; k < 4 && j + k < n; k++) {
                if (first && !on[k]) continue;
                const int m = who[j + k];
                const double length = sqrt(sx[k] * sx[k] + sy[k] * sy[k]), step_max = p[k][20];
                if (length > step_max) {
                    xy[2 * m] = x_of[j + k] + step_max / length * sx[k];
                    xy[2 * m + 1] = y_of[j + k] + step_max / length * sy[k];
                }
                const double dx = xy[2 * m] - predicted[2 * m], dy = xy[2 * m + 1] - predicted[2 * m + 1];
                if (dx * dx + dy * dy > reach2) amplitude[m] = fit[m] = 0;
                else if (on[k]) who[on_n++] = m;
            }
        }
        return on_n;
    }
    """
    Py_ssize_t vt_take_steps(
        int *, Py_ssize_t, int *, double *, double *, double *, const double *, const double *, bint, double,
        double, double, double, double, double *, double *, double *, double *
    ) noexcept nogil


cdef inline Py_ssize_t take_steps(
    int[::1] who, Py_ssize_t n, int[::1] at, double[:, ::1] middle, double[:, ::1] sums, double[:, ::1] norms,
    double[:, ::1] predicted, bint first, double near2, double far2, double reach2, double noise2, double gain,
    double[:, ::1] xy, double[::1] sigma, double[::1] amplitude, double[::1] fit
) noexcept nogil:
    return vt_take_steps(
        &who[0], n, &at[0], &middle[0, 0], &middle[1, 0], &sums[0, 0], &norms[0, 0], &predicted[0, 0], first,
        near2, far2, reach2, noise2, gain, &xy[0, 0], &sigma[0], &amplitude[0], &fit[0]
    )
