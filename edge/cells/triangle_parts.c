/* The parts of all triangles, which `mesh` needs of each in every frame; `triangle_parts.py` describes them and gives
 * the same to the last bit. Two triangles at a time: vectors of 16 bytes are what x86-64 and aarch64 both have.
 */
typedef double vt_two __attribute__((vector_size(16)));
typedef double vt_any_two __attribute__((vector_size(16), aligned(8), may_alias));
typedef long long vt_mask __attribute__((vector_size(16)));

#define VT_CORNER(of, k) {of[tail[k]], of[tail[3 + k]]}
#define VT_WHERE(mask, a) ((vt_two)((vt_mask)(a) & (mask)))
#define VT_BOTH(k, a, b) ((vt_two){(a)[k], (b)[k]})
#define VT_ADD(k) \
    area[tail[3 * k]] += at_a[k], area[tail[3 * k + 1]] += at_b[k], area[tail[3 * k + 2]] += at_c[k]

/* The number n of triangles is even: each point adds two. */
__attribute__((always_inline)) static inline Py_ssize_t vt_measure_by(
    const int *restrict tail, const double *restrict x, const double *restrict y, Py_ssize_t n, double sliver,
    double bound, double *restrict parts, double *restrict area, int *restrict unsure)
{
    Py_ssize_t found = 0;
    const vt_mask infinite = (vt_mask)((vt_two){0} + __builtin_inf());
    for (Py_ssize_t t = 0; t < n; t += 2, tail += 6, parts += 8) {
        const vt_two ax = VT_CORNER(x, 0), bx = VT_CORNER(x, 1), cx = VT_CORNER(x, 2);
        const vt_two ay = VT_CORNER(y, 0), by = VT_CORNER(y, 1), cy = VT_CORNER(y, 2);
        const vt_two abx = bx - ax, aby = by - ay, bcx = cx - bx, bcy = cy - by, acx = cx - ax, acy = cy - ay;
        const vt_two cross = abx * acy - aby * acx;
        /* Products of the edges at each corner; a squared edge is the sum of those at its ends. */
        const vt_two dot_a = abx * acx + aby * acy, dot_b = -(abx * bcx + aby * bcy), dot_c = acx * bcx + acy * bcy;
        const vt_two ab2 = dot_a + dot_b, bc2 = dot_b + dot_c, ca2 = dot_c + dot_a, half2 = ab2 + dot_c;
        const vt_mask is_plain = cross > sliver * half2;
        const vt_two inverse = VT_WHERE(is_plain, 1.0 / cross), q = half2 * inverse;
        const vt_two ab = dot_c * inverse * ab2, bc = dot_a * inverse * bc2, ca = dot_b * inverse * ca2;
        const vt_two least = (vt_two)((vt_mask)(bound * q * (1.0 + q) * half2) | (infinite & ~is_plain));
        *(vt_any_two *)parts = VT_BOTH(0, ab, bc);
        *(vt_any_two *)(parts + 2) = VT_BOTH(0, ca, least);
        *(vt_any_two *)(parts + 4) = VT_BOTH(1, ab, bc);
        *(vt_any_two *)(parts + 6) = VT_BOTH(1, ca, least);
        const vt_mask certain = (least < ab) & (least < bc) & (least < ca);
        const vt_two at_a = VT_WHERE(certain, ab + ca), at_b = VT_WHERE(certain, ab + bc);
        const vt_two at_c = VT_WHERE(certain, bc + ca);
        VT_ADD(0);
        VT_ADD(1);
        unsure[found] = (int)t, found += 1 + certain[0];
        unsure[found] = (int)t + 1, found += 1 + certain[1];
    }
    return found;
}

/* AVX2, chosen at run time, needs a fifth less instructions for the same, as it overwrites no operand. */
#if defined(__x86_64__) && defined(__GNUC__)
__attribute__((target("avx2"))) static Py_ssize_t vt_measure_avx2(
    const int *tail, const double *x, const double *y, Py_ssize_t n, double sliver, double bound, double *parts,
    double *area, int *unsure)
{
    return vt_measure_by(tail, x, y, n, sliver, bound, parts, area, unsure);
}
#endif

static Py_ssize_t vt_measure(const int *tail, const double *x, const double *y, Py_ssize_t n, double sliver,
                             double bound, double *parts, double *area, int *unsure)
{
#if defined(__x86_64__) && defined(__GNUC__)
    if (__builtin_cpu_supports("avx2"))
        return vt_measure_avx2(tail, x, y, n, sliver, bound, parts, area, unsure);
#endif
    return vt_measure_by(tail, x, y, n, sliver, bound, parts, area, unsure);
}
