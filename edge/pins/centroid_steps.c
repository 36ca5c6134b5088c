/* The steps of `centroids` from the sums over windows, which `centroid_steps.py` describes and takes to the same last
 * bit. Two pins at a time: vectors of 16 bytes are what x86-64 and aarch64 both have.
 */
#include <math.h>
#include "window_sums.c"

typedef double vt_two __attribute__((vector_size(16)));
typedef double vt_any_two __attribute__((vector_size(16), aligned(8), may_alias));
typedef long long vt_mask __attribute__((vector_size(16)));

/* The steps of a frame share this, as `steps_of` describes it. */
typedef struct {
    const double *norms, *predicted, *inner;
    const int *kind_of, *norm_of;
    Py_ssize_t stride;
    double reach2, noise2, gain;
    double *xy, *sigma, *amplitude, *fit;
} vt_steps;
/* A pin, the row of its norms, and where its step begins. */
typedef struct {
    Py_ssize_t pin, norm;
    double x, y;
} vt_start;

/* The loop is compiled for each processor: AVX2 needs a fifth less instructions, as it overwrites no operand. */
#define VT_INLINE __attribute__((always_inline))

#define VT_WHERE(mask, a) ((vt_two)((vt_mask)(a) & (mask)))
/* the numbers k and k + 1 of two rows */
#define VT_COLUMNS(p, q, k, first, second) \
    const vt_two first##_ = *(const vt_any_two *)(p + k), second##_ = *(const vt_any_two *)(q + k); \
    const vt_two first = {first##_[0], second##_[0]}, second = {first##_[1], second##_[1]}

/* Shorten a step that is too long; whether it ends near enough to the prediction. */
static int vt_is_within_reach(const vt_steps *s, const vt_start *from, double ex, double ey)
{
    double *const xy = s->xy + 2 * from->pin;
    const double *const at = s->predicted + 2 * from->pin;
    const double length = sqrt(ex * ex + ey * ey), longest = s->norms[VT_NORM * from->norm + 20];
    if (length > longest) xy[0] = from->x + longest / length * ex, xy[1] = from->y + longest / length * ey;
    const double dx = xy[0] - at[0], dy = xy[1] - at[1];
    return dx * dx + dy * dy <= s->reach2;
}

/* A step of two pins, or of one twice, from their sums. Returns 1 if the first one has to go on, 2 for the other. */
VT_INLINE static inline int vt_step_two(const vt_steps *s, const double *sums, const vt_start *from, double near2,
                                        double far2, int first)
{
    const double *const p = s->norms + VT_NORM * from[0].norm, *const q = s->norms + VT_NORM * from[1].norm;
    const double *const other = sums + 8;
    VT_COLUMNS(sums, other, 0, a, tx);
    VT_COLUMNS(sums, other, 2, ty, level);
    VT_COLUMNS(sums, other, 4, u, v);
    VT_COLUMNS(sums, other, 6, square, inv_pixels);
    VT_COLUMNS(p, q, 8, inv_d, x_d); /* numbered as in NORM */
    VT_COLUMNS(p, q, 10, y_d, x_u);
    VT_COLUMNS(p, q, 12, y_v, d_u);
    VT_COLUMNS(p, q, 14, tx_u, d_v);
    VT_COLUMNS(p, q, 16, ty_v, freedom);
    VT_COLUMNS(p, q, 18, inv_freedom, radius);

    const vt_two inverse = 1.0 / a, a2 = a * a, near_ex = tx * x_d, near_ey = ty * y_d;
    const vt_mask seen = a > 0.0, is_near = near_ex * near_ex + near_ey * near_ey <= far2 * a2;
    const vt_two su = u + d_u * a, sv = v + d_v * a, gu = su + tx_u * tx, gv = sv + ty_v * ty;
    const vt_two gu2 = gu * gu, gv2 = gv * gv, energy = square - level * level * inv_pixels;
    const vt_two rest = energy - a2 - tx * tx - ty * ty - gu2 - gv2;
    const vt_two variance = VT_WHERE(rest > 0.0, rest) * inv_freedom + 1.0 / 12.0, limit = 4.0 * variance;
    const vt_two keep_x = VT_WHERE((gu2 > limit) & is_near, 1.0 - limit / gu2);
    const vt_two keep_y = VT_WHERE((gv2 > limit) & is_near, 1.0 - limit / gv2);
    const vt_two ex = near_ex - keep_x * gu * x_u, ey = near_ey - keep_y * gv * y_v;
    const vt_mask on = (ex * ex + ey * ey >= near2 * a2) & seen;
    const vt_two step_x = ex * inverse, step_y = ey * inverse;

    const vt_two left = energy - gu * su - gv * sv;
    const vt_two spread = x_d * x_d + y_d * y_d + keep_x * (x_u * x_u) + keep_y * (y_v * y_v);
    const vt_two missing = rest - freedom * (s->noise2 + 1.0 / 12.0);
    const vt_two m = VT_WHERE((missing > 0.0) & (left > 0.0), missing / left), hidden = radius * m * m;
    const vt_two variances = 0.5 * variance * spread * inverse * inverse + hidden * hidden;
    const vt_two amplitude = VT_WHERE(seen, a * inv_d * s->gain);
    const vt_two fit = VT_WHERE((left > 0.0) & seen, a2 / left);
    int goes_on = 0;
    for (int k = 0; k < 2; k++) {
        const Py_ssize_t i = from[k].pin;
        s->amplitude[i] = amplitude[k], s->fit[i] = fit[k];
        if (!seen[k]) continue;
        s->sigma[i] = sqrt(variances[k]);
        *(vt_any_two *)(s->xy + 2 * i) = *(const vt_any_two *)&from[k].x + (vt_two){step_x[k], step_y[k]};
        if (!on[k] && first) continue; /* so short that it is within reach */
        if (!vt_is_within_reach(s, from + k, step_x[k], step_y[k])) s->amplitude[i] = s->fit[i] = 0.0;
        else if (on[k]) goes_on |= 1 << k;
    }
    return goes_on;
}

static int vt_step(const vt_steps *s, const double *sums, Py_ssize_t i, Py_ssize_t norm, double x, double y,
                   double near2, double far2, int first)
{
    double twice[16];
    const vt_start from[2] = {{i, norm, x, y}, {i, norm, x, y}};
    memcpy(twice, sums, 8 * sizeof *sums);
    memcpy(twice + 8, sums, 8 * sizeof *sums);
    return vt_step_two(s, twice, from, near2, far2, first) & 1;
}

typedef void vt_sum(const vt_windows *, Py_ssize_t, Py_ssize_t, Py_ssize_t);

VT_INLINE static inline Py_ssize_t vt_take_steps_by(vt_sum *sum_window, const vt_windows *windows, const vt_steps *s,
                                                    int *who, Py_ssize_t n, double near2, double far2, int first)
{
    double sums[16];
    vt_start from[2];
    vt_windows w = *windows;
    Py_ssize_t asked = 0, taken = 0;
    const vt_two least = {s->inner[0], s->inner[1]}, beyond = {s->inner[2], s->inner[3]};
    const double *const begin = first ? s->predicted : s->xy;
    for (Py_ssize_t j = 0; j < n; j++) {
        const Py_ssize_t i = who[j];
        const vt_two at = 4.0 * *(const vt_any_two *)(begin + 2 * i) + 2.0; /* phases */
        const vt_mask inside = (at >= least) & (at < beyond);
        if (!(inside[0] & inside[1])) {
            who[asked++] = (int)(2 * i);
            continue;
        }
        const int x = (int)at[0], y = (int)at[1];
        const Py_ssize_t norm = s->norm_of[i] + (y & 3) * 4 + (x & 3);
        from[taken] = (vt_start){i, norm, 0.25 * x - 0.375, 0.25 * y - 0.375};
        w.sums = sums + 8 * taken;
        sum_window(&w, (y >> 2) * s->stride + (x >> 2), s->kind_of[i], norm);
        if (++taken < 2) continue;
        taken = 0;
        const int goes_on = vt_step_two(s, sums, from, near2, far2, first);
        if (goes_on & 1) who[asked++] = (int)(2 * from[0].pin + 1);
        if (goes_on & 2) who[asked++] = (int)(2 * i + 1);
    }
    if (taken && vt_step(s, sums, from[0].pin, from[0].norm, from[0].x, from[0].y, near2, far2, first))
        who[asked++] = (int)(2 * from[0].pin + 1);
    return asked;
}

#ifdef VT_AVX2
__attribute__((target("avx2"))) static Py_ssize_t vt_take_steps_avx2(const vt_windows *windows, const vt_steps *s,
                                                                     int *who, Py_ssize_t n, double near2, double far2,
                                                                     int first)
{
    return vt_take_steps_by(vt_sum_window_avx2, windows, s, who, n, near2, far2, first);
}
#endif

static Py_ssize_t vt_take_steps(const vt_windows *windows, const vt_steps *s, int *who, Py_ssize_t n, double near2,
                                double far2, int first)
{
#ifdef VT_AVX2
    if (__builtin_cpu_supports("avx2")) return vt_take_steps_avx2(windows, s, who, n, near2, far2, first);
#endif
    return vt_take_steps_by(vt_sum_window_plain, windows, s, who, n, near2, far2, first);
}
