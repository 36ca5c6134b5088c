# What `mesh` adds up of each triangle, which baseline x86 runs too slowly as compiled Python, described in
# `triangle_parts.py`. A frame of 331 pins, 930 triangles: 53,000 instructions with the AVX2 clone, chosen when the
# program loads.

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

    #define VT_BLOCK 16 /* triangles whose sums are formed before they are added up */
    #define VT_CORNER(of, k) {of[tail[k]], of[tail[3 + k]], of[tail[6 + k]], of[tail[9 + k]]}

    typedef struct {
        double of_corner[3][VT_BLOCK];
        long long certain[VT_BLOCK]; /* all of its parts are */
    } vt_block;

    VT_WIDE static void vt_measure(const int *restrict tail, const double *restrict x, const double *restrict y,
                                   Py_ssize_t n, double sliver, double bound, double tolerance,
                                   vt_block *restrict block)
    {
        const vt_mask infinite = (vt_mask)((vt_four){0} + __builtin_inf());
        for (Py_ssize_t t = 0; t < n; t += 4, tail += 12) {
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
            const vt_four error = (vt_four)((of_part & is_plain) | (infinite & ~is_plain));
            const vt_mask ab_is = error < tolerance * ab, bc_is = error < tolerance * bc;
            const vt_mask ca_is = error < tolerance * ca, all_are = ab_is & bc_is & ca_is;
            const vt_four ab_own = (vt_four)((vt_mask)ab & ab_is), bc_own = (vt_four)((vt_mask)bc & bc_is);
            const vt_four ca_own = (vt_four)((vt_mask)ca & ca_is);
            const vt_four of_a = ab_own + ca_own, of_b = ab_own + bc_own, of_c = bc_own + ca_own;
            memcpy(block->of_corner[0] + t, &of_a, sizeof of_a);
            memcpy(block->of_corner[1] + t, &of_b, sizeof of_b);
            memcpy(block->of_corner[2] + t, &of_c, sizeof of_c);
            memcpy(block->certain + t, &all_are, sizeof all_are);
        }
    }

    static Py_ssize_t vt_sum_certain(const int *tail, const double *x, const double *y, Py_ssize_t n, double sliver,
                                     double bound, double tolerance, double *restrict area, int *restrict uncertain)
    {
        vt_block block;
        Py_ssize_t n_uncertain = 0;
        for (Py_ssize_t first = 0; first < n; first += VT_BLOCK, tail += 3 * VT_BLOCK) {
            const Py_ssize_t m = n - first < VT_BLOCK ? n - first : VT_BLOCK;
            vt_measure(tail, x, y, m, sliver, bound, tolerance, &block);
            for (Py_ssize_t t = 0; t < m; t++) {
                area[tail[3 * t]] += block.of_corner[0][t];
                area[tail[3 * t + 1]] += block.of_corner[1][t];
                area[tail[3 * t + 2]] += block.of_corner[2][t];
                uncertain[n_uncertain] = (int)(first + t);
                n_uncertain += !block.certain[t];
            }
        }
        return n_uncertain;
    }
    """
    Py_ssize_t vt_sum_certain(
        const int *, const double *, const double *, Py_ssize_t, double, double, double, double *, int *
    ) noexcept nogil


cdef inline Py_ssize_t sum_certain(
    int[::1] tail, double[::1] x, double[::1] y, Py_ssize_t n, double sliver, double bound, double tolerance,
    double[::1] area, int[::1] uncertain
) noexcept nogil:
    return vt_sum_certain(&tail[0], &x[0], &y[0], n, sliver, bound, tolerance, &area[0], &uncertain[0])
