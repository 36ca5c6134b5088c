/* Kept Delaunay triangulation of moving points, and the areas of their Voronoi cells.
 *
 * Idea
 *   The triangulation of one frame is nearly always that of the next. So it is kept: every frame each
 *   triangle is measured once, each edge checked once, and only edges that are no longer Delaunay are
 *   flipped (Lawson). A triangulation from nothing (incremental insertion) is made at the start and
 *   when points moved so far that triangles turned over and single flips cannot mend them.
 *
 *   All follows from one number an edge. With alpha, beta the angles that face the edge in its two
 *   triangles,
 *
 *            r                w = cot(alpha) + cot(beta)
 *           /a\
 *          /   \              w >= 0     the edge is Delaunay
 *         p-----q             w len^2/8  area that the edge gives to the cell of p, and to that of q
 *          \   /              w = -incircle(p, q, r, s) / (orient(p, q, r) orient(q, p, s))
 *           \b/
 *            s
 *
 *   (len * w / 2 is the length of the Voronoi edge, len / 2 the height of the triangle that it spans
 *   with p.) A cell's area is a sum of terms that are all >= 0: nothing cancels, and at a flip w passes
 *   through 0, so areas are continuous and near-cocircular points do not matter.
 *
 * Rules
 *   - Decisions are exact. A floating-point value with an error bound decides where it can, exact
 *     expansion arithmetic (sums of doubles that do not overlap) where it cannot. Thus every flip
 *     lowers the lifted surface and the loop ends; equality (cocircular) never flips.
 *   - Areas carry a running error bound; a cell whose bound exceeds AREA_TOLERANCE of its area is
 *     summed again from exact expansions, where each term is good to a few ulp whatever the input.
 *   - Only differences of coordinates enter: no origin, no scale. -ffp-contract=off is needed.
 *   - Points come in this order: pins, whose areas are wanted; boundary points, that bound their cells;
 *     fence points, that stand round the boundary. A cell that reaches the fence is not bounded; its
 *     area is NaN. Four guard points far outside, added here, make a hull that never changes.
 *   - Why a fence: without it, boundary points that lie nearly on a line have flat triangles on their
 *     outer side, which turn over at the least motion. With a fence nearby these are never Delaunay.
 *   - Points at the same place share one vertex and one cell: each gets an equal part of its area.
 *   - All memory is taken when the object is made; the GIL is released while it works.
 *
 * Names: h, g are half-edges (3t, 3t+1, 3t+2 belong to triangle t), tail[h] the point where h starts,
 * twin[h] the same edge in the neighbouring triangle or -1 on the hull. Triangles run counter-clockwise
 * in the coordinates' own sense (x right, y up).
 */
#define PY_SSIZE_T_CLEAN
#include "_buffers.h"
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define EPS 1.1102230246251565e-16     /* 2^-53, half an ulp of 1 */
#define ORIENT_BOUND (4.0 * EPS)       /* times |ux vy| + |uy vx|: 2 differences, a product, a sum */
#define INCIRCLE_BOUND (12.0 * EPS)    /* times the permanent of the 3x3 determinant: 10 + rounding of it */
#define SLIVER 1e-10                   /* cross / (sum of squared edges) below which w is taken exactly */
#define AREA_TOLERANCE 1e-12           /* relative error bound beyond which a cell is summed exactly */
#define GUARD 16.0                     /* distance of the guards, in half-widths of the point set */
#define N_GUARD 4
#define MANY 1000000                   /* points of a kind; keeps every index within 32 bits */
#define EXACT_TERMS 1056               /* terms are >= 2 bits apart, doubles span 2098 bits */
/* Products of four coordinates must not underflow, or they are not exact: of a set at least this wide,
 * coordinates smaller than this share of its width count as 0. 4 (66 + 140 + 52) bits < 1074. */
#define EXTENT_MIN 0x1p-66
#define EXTENT_MAX 0x1p66
#define SNAP 0x1p-140
#define FLIPS_PER_TRIANGLE 32          /* more than any motion needs that does not call for a new mesh */

typedef struct {
    double x, y;
} Point;

/* ---------------------------------------------------------------- exact arithmetic */

/* A number as a sum of doubles that do not overlap, smallest first. */
typedef struct {
    int n;
    double term[EXACT_TERMS];
} Exact;

static void exact_add(Exact *e, double x)
{
    int kept = 0;
    for (int i = 0; i < e->n; i++) {
        double y = e->term[i];
        double sum = x + y;
        double virtual_y = sum - x;
        double low = (x - (sum - virtual_y)) + (y - virtual_y);
        if (low != 0.0)
            e->term[kept++] = low;
        x = sum;
    }
    if (x != 0.0 && kept < EXACT_TERMS)
        e->term[kept++] = x;
    e->n = kept;
}

static void exact_difference(Exact *e, double a, double b)
{
    double x = a - b;
    double virtual_b = a - x;
    double low = (a - (x + virtual_b)) + (virtual_b - b);
    e->n = 0;
    if (low != 0.0)
        e->term[e->n++] = low;
    if (x != 0.0)
        e->term[e->n++] = x;
}

/* out += sign * a * b */
static void exact_add_product(Exact *out, const Exact *a, const Exact *b, double sign)
{
    for (int i = 0; i < a->n; i++)
        for (int j = 0; j < b->n; j++) {
            double product = a->term[i] * b->term[j];
            exact_add(out, sign * fma(a->term[i], b->term[j], -product));
            exact_add(out, sign * product);
        }
}

/* The nearest double, nearly: right in sign, and in value to an ulp or two. */
static double exact_value(const Exact *e)
{
    double sum = 0.0;
    for (int i = 0; i < e->n; i++)
        sum += e->term[i];
    return sum;
}

static double orient_exact(Point a, Point b, Point c)
{
    Exact ux, uy, vx, vy, det;
    det.n = 0;
    exact_difference(&ux, b.x, a.x);
    exact_difference(&uy, b.y, a.y);
    exact_difference(&vx, c.x, a.x);
    exact_difference(&vy, c.y, a.y);
    exact_add_product(&det, &ux, &vy, 1.0);
    exact_add_product(&det, &uy, &vx, -1.0);
    return exact_value(&det);
}

static double incircle_exact(Point a, Point b, Point c, Point d)
{
    const Point ring[3] = {a, b, c};
    Exact x[3], y[3], lift, minor, det;
    det.n = 0;
    for (int i = 0; i < 3; i++) {
        exact_difference(&x[i], ring[i].x, d.x);
        exact_difference(&y[i], ring[i].y, d.y);
    }
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        lift.n = minor.n = 0;
        exact_add_product(&lift, &x[i], &x[i], 1.0);
        exact_add_product(&lift, &y[i], &y[i], 1.0);
        exact_add_product(&minor, &x[j], &y[k], 1.0);
        exact_add_product(&minor, &y[j], &x[k], -1.0);
        exact_add_product(&det, &lift, &minor, 1.0);
    }
    return exact_value(&det);
}

/* > 0: a, b, c turn counter-clockwise. The sign is exact. */
static double orient(Point a, Point b, Point c)
{
    double left = (b.x - a.x) * (c.y - a.y);
    double right = (b.y - a.y) * (c.x - a.x);
    double det = left - right;
    if (fabs(det) > ORIENT_BOUND * (fabs(left) + fabs(right)))
        return det;
    return orient_exact(a, b, c);
}

/* > 0: d lies inside the circle through a, b, c (counter-clockwise). The sign is exact. */
static double incircle(Point a, Point b, Point c, Point d)
{
    double ax = a.x - d.x, ay = a.y - d.y, bx = b.x - d.x, by = b.y - d.y, cx = c.x - d.x, cy = c.y - d.y;
    double bxcy = bx * cy, bycx = by * cx, cxay = cx * ay, cyax = cy * ax, axby = ax * by, aybx = ay * bx;
    double a2 = ax * ax + ay * ay, b2 = bx * bx + by * by, c2 = cx * cx + cy * cy;
    double det = a2 * (bxcy - bycx) + b2 * (cxay - cyax) + c2 * (axby - aybx);
    double permanent = a2 * (fabs(bxcy) + fabs(bycx)) + b2 * (fabs(cxay) + fabs(cyax)) +
                       c2 * (fabs(axby) + fabs(aybx));
    if (fabs(det) > INCIRCLE_BOUND * permanent)
        return det;
    return incircle_exact(a, b, c, d);
}

/* ---------------------------------------------------------------- the mesh */

typedef struct {
    int n_pins, n_bounded; /* areas are for the first n_pins; from n_bounded on it is fence and guards */
    int n_points;          /* guards are points n_points .. n_points + 3 */
    int n_triangles;       /* 0: not built */
    int n_stack;
    int n_twins;           /* points that share their place with another, and its vertex */
    long flips, builds;    /* since the beginning; flips of the kept mesh, not those within a build */
    long changes;          /* how often the triangles changed */
    int busy;
    Point *point;
    int32_t *tail, *twin;  /* per half-edge */
    double *cot, *len2;    /* per half-edge: cotangent of the angle that faces it; its squared length */
    double *err;           /* per triangle: bound of the error of its cotangents; inf: unknown */
    double *area, *bound;  /* per point */
    int32_t *stack;        /* half-edges to look at */
    uint8_t *stacked;      /* per half-edge: on the stack */
    uint8_t *doubtful;     /* per point: area must be summed exactly */
    int32_t *same_as;      /* per point: the point whose vertex it uses, mostly itself */
    void *memory;
} Mesh;

static inline int next_of(int h) { return h % 3 == 2 ? h - 2 : h + 1; }
static inline int prev_of(int h) { return h % 3 == 0 ? h + 2 : h - 1; }

static inline void link_edges(Mesh *m, int h, int g)
{
    m->twin[h] = g;
    if (g >= 0)
        m->twin[g] = h;
}

static inline void push(Mesh *m, int h)
{
    if (!m->stacked[h]) {
        m->stacked[h] = 1;
        m->stack[m->n_stack++] = h;
    }
}

static void clear_stack(Mesh *m)
{
    while (m->n_stack > 0)
        m->stacked[m->stack[--m->n_stack]] = 0;
}

/*        r                 r
 *       /|\               / \
 *    h2/ | \h1         h2/ t0\h0'      t0 = h/3 holds p, s, r afterwards,
 *     /  |  \           /     \        t1 = g/3 holds q, r, s.
 *    p  h|g  q   --->  p  ...  q       (p-q was the edge, s-r is.)
 */
static void flip(Mesh *m, int h)
{
    int g = m->twin[h];
    int h1 = next_of(h), g1 = next_of(g);
    int r = m->tail[prev_of(h)], s = m->tail[prev_of(g)];
    int beyond_h1 = m->twin[h1], beyond_g1 = m->twin[g1];
    m->tail[h1] = s;
    m->tail[g1] = r;
    link_edges(m, h, beyond_g1);
    link_edges(m, g, beyond_h1);
    link_edges(m, h1, g1);
    m->flips++;
}

/* Cotangents, squared lengths and error bound of triangle t. Returns 0 if it is turned over or flat. */
static inline int measure(Mesh *m, int t)
{
    const int32_t *v = m->tail + 3 * t;
    Point a = m->point[v[0]], b = m->point[v[1]], c = m->point[v[2]];
    double abx = b.x - a.x, aby = b.y - a.y;
    double bcx = c.x - b.x, bcy = c.y - b.y;
    double cax = a.x - c.x, cay = a.y - c.y;
    double cross = aby * cax - abx * cay;
    double *len2 = m->len2 + 3 * t, *cot = m->cot + 3 * t;
    len2[0] = abx * abx + aby * aby;
    len2[1] = bcx * bcx + bcy * bcy;
    len2[2] = cax * cax + cay * cay;
    double sum2 = len2[0] + len2[1] + len2[2];
    if (!(cross > SLIVER * sum2)) {
        m->err[t] = INFINITY;
        return orient(a, b, c) > 0.0;
    }
    double inverse = 1.0 / cross;
    cot[0] = -(bcx * cax + bcy * cay) * inverse;
    cot[1] = -(cax * abx + cay * aby) * inverse;
    cot[2] = -(abx * bcx + aby * bcy) * inverse;
    /* |cot| <= q, relative error of cross <= 4 eps q, of the dot products' magnitude 4 eps */
    double q = 0.5 * sum2 * inverse;
    m->err[t] = 8.0 * EPS * q * (1.0 + q);
    return 1;
}

static inline double edge_incircle(const Mesh *m, int h, int g)
{
    const Point *p = m->point;
    const int32_t *tail = m->tail;
    return incircle(p[tail[h]], p[tail[g]], p[tail[prev_of(h)]], p[tail[prev_of(g)]]);
}

static double exact_weight(const Mesh *m, int h, int g)
{
    Point p = m->point[m->tail[h]], q = m->point[m->tail[g]];
    Point r = m->point[m->tail[prev_of(h)]], s = m->point[m->tail[prev_of(g)]];
    return -incircle_exact(p, q, r, s) / orient_exact(p, q, r) / orient_exact(q, p, s);
}

/* -------- from nothing */

/* Flips until every edge on the stack, and those that the flips touch, is Delaunay. */
static int legalize(Mesh *m, int measured, long limit)
{
    while (m->n_stack > 0) {
        int h = m->stack[--m->n_stack];
        m->stacked[h] = 0;
        int g = m->twin[h];
        if (g < 0 || !(edge_incircle(m, h, g) > 0.0))
            continue;
        if (limit-- <= 0)
            return 0;
        flip(m, h);
        if (measured) {
            measure(m, h / 3);
            measure(m, g / 3);
        }
        push(m, h);
        push(m, prev_of(h));
        push(m, g);
        push(m, prev_of(g));
    }
    return 1;
}

static int add_triangle(Mesh *m, int a, int b, int c)
{
    int h = 3 * m->n_triangles++;
    m->tail[h] = a;
    m->tail[h + 1] = b;
    m->tail[h + 2] = c;
    return h;
}

/* Inserts point i; `hint` is a triangle to walk from. Returns a triangle near it, or -1. */
static int insert(Mesh *m, int i, int hint)
{
    Point p = m->point[i];
    int t = hint, on_edge = -1, zeros = 0, came = -1;
    for (long steps = 0;; steps++) {
        int h, k;
        if (steps > 4L * m->n_triangles + 16)
            return -1;
        on_edge = -1;
        zeros = 0;
        for (k = 0; k < 3; k++) {
            h = 3 * t + k;
            if (h == came)
                continue;
            double side = orient(m->point[m->tail[h]], m->point[m->tail[next_of(h)]], p);
            if (side < 0.0)
                break;
            if (side == 0.0) {
                zeros++;
                on_edge = h;
            }
        }
        if (k == 3)
            break;
        came = m->twin[h];
        if (came < 0)
            return -1;
        t = came / 3;
    }
    if (zeros == 2) { /* on the vertex that the two edges share */
        for (int k = 0; k < 3; k++) {
            Point v = m->point[m->tail[3 * t + k]];
            if (v.x == p.x && v.y == p.y)
                m->same_as[i] = m->tail[3 * t + k];
        }
        m->n_twins++;
        return t;
    }
    int a = 3 * t, va = m->tail[a], vb = m->tail[a + 1], vc = m->tail[a + 2];
    int beyond_bc = m->twin[a + 1], beyond_ca = m->twin[a + 2];
    m->tail[a + 2] = i; /* t becomes a, b, i */
    int b = add_triangle(m, vb, vc, i);
    int c = add_triangle(m, vc, va, i);
    link_edges(m, b, beyond_bc);
    link_edges(m, c, beyond_ca);
    link_edges(m, a + 1, b + 2);
    link_edges(m, b + 1, c + 2);
    link_edges(m, c + 1, a + 2);
    int outer[3] = {a, b, c};
    for (int k = 0; k < 3; k++)
        if (!(zeros == 1 && on_edge == 3 * t + k))
            push(m, outer[k]);
    if (zeros == 1) { /* one of the three is flat: it and its neighbour change places */
        int flat = outer[on_edge - 3 * t], g = m->twin[flat];
        if (g < 0)
            return -1;
        flip(m, flat);
        push(m, flat);
        push(m, prev_of(flat));
        push(m, g);
        push(m, prev_of(g));
    }
    /* Each flip gives the new point an edge that it keeps: there cannot be more than points. */
    return legalize(m, 0, m->n_triangles + 8) ? t : -1;
}

static int build(Mesh *m)
{
    int n = m->n_points, hint = 0;
    long flips = m->flips; /* those made here do not count */
    clear_stack(m);
    m->n_triangles = 0;
    m->n_twins = 0;
    int h = add_triangle(m, n, n + 1, n + 2), g = add_triangle(m, n, n + 2, n + 3);
    for (int k = 0; k < 6; k++)
        m->twin[k] = -1;
    link_edges(m, h + 2, g);
    for (int i = 0; i < n; i++) {
        m->same_as[i] = i;
        hint = insert(m, i, hint);
        if (hint < 0) {
            m->n_triangles = 0;
            return 0;
        }
    }
    for (int t = 0; t < m->n_triangles; t++)
        measure(m, t);
    m->flips = flips;
    m->builds++;
    m->changes++;
    return 1;
}

/* -------- from the last frame */

/* Triangles that turned over: flips the edge that a point crossed, where that makes both sound.
 * Returns 1 if every triangle is sound afterwards. */
static int mend(Mesh *m)
{
    for (int round = 0; round < 8; round++) {
        int bad = 0, mended = 0;
        for (int t = 0; t < m->n_triangles; t++) {
            if (m->err[t] < INFINITY || measure(m, t))
                continue;
            bad++;
            for (int h = 3 * t; h < 3 * t + 3; h++) {
                int g = m->twin[h];
                if (g < 0)
                    continue;
                Point p = m->point[m->tail[h]], q = m->point[m->tail[g]];
                Point r = m->point[m->tail[prev_of(h)]], s = m->point[m->tail[prev_of(g)]];
                if (orient(p, s, r) > 0.0 && orient(q, r, s) > 0.0) {
                    flip(m, h);
                    measure(m, t);
                    measure(m, g / 3);
                    mended++;
                    break;
                }
            }
        }
        if (bad == 0)
            return 1;
        if (mended == 0)
            return 0;
    }
    return 0;
}

/* Checks every edge and sums the areas; edges that are not Delaunay go onto the stack. */
static void sweep(Mesh *m)
{
    int n = m->n_bounded, n_half_edges = 3 * m->n_triangles;
    const int32_t *tail = m->tail, *twin = m->twin;
    memset(m->area, 0, sizeof(double) * (size_t)(m->n_points + N_GUARD));
    memset(m->bound, 0, sizeof(double) * (size_t)(m->n_points + N_GUARD));
    for (int h = 0; h < n_half_edges; h++) {
        int g = twin[h];
        if (g < h) /* seen from the other side, or the hull */
            continue;
        double w = m->cot[h] + m->cot[g];
        double err = m->err[h / 3] + m->err[g / 3];
        if (!(w > err)) {
            if (edge_incircle(m, h, g) > 0.0) {
                push(m, h);
                continue;
            }
            w = exact_weight(m, h, g);
            err = 8.0 * EPS * w;
        }
        int p = tail[h], q = tail[g];
        if (p >= n || q >= n) {
            m->area[p] = m->area[q] = INFINITY;
            continue;
        }
        double part = m->len2[h] * w, doubt = m->len2[h] * err;
        m->area[p] += part;
        m->area[q] += part;
        m->bound[p] += doubt;
        m->bound[q] += doubt;
    }
}

/* Sums the cells again whose error bound is too large, from exact weights. */
static void refine(Mesh *m)
{
    int doubts = 0;
    for (int i = 0; i < m->n_pins; i++) {
        m->doubtful[i] = m->bound[i] > AREA_TOLERANCE * m->area[i] && m->area[i] < INFINITY;
        if (m->doubtful[i]) {
            m->area[i] = 0.0;
            doubts++;
        }
    }
    if (doubts == 0)
        return;
    for (int h = 0; h < 3 * m->n_triangles; h++) {
        int g = m->twin[h];
        if (g < h)
            continue;
        int ends[2] = {m->tail[h], m->tail[g]};
        double part = -1.0;
        for (int k = 0; k < 2; k++) {
            if (ends[k] >= m->n_pins || !m->doubtful[ends[k]])
                continue;
            if (part < 0.0)
                part = m->len2[h] * exact_weight(m, h, g);
            m->area[ends[k]] += part;
        }
    }
}

/* Points at one place: each gets an equal part of the cell. */
static void share(Mesh *m)
{
    if (m->n_twins == 0)
        return;
    for (int i = 0; i < m->n_points; i++)
        m->bound[i] = 0.0;
    for (int i = 0; i < m->n_points; i++)
        m->bound[m->same_as[i]] += 1.0;
    for (int i = m->n_points - 1; i >= 0; i--)
        m->area[i] = m->area[m->same_as[i]] / (m->same_as[i] == i ? 1.0 : m->bound[m->same_as[i]]);
    for (int i = 0; i < m->n_points; i++)
        if (m->same_as[i] == i)
            m->area[i] /= m->bound[i];
}

enum outcome { DONE, NOT_FINITE, NO_EXTENT, NOT_BUILT };

static enum outcome run(Mesh *m, const double *xy, double *area_out)
{
    int n = m->n_points;
    double x_min = INFINITY, x_max = -INFINITY, y_min = INFINITY, y_max = -INFINITY, finite = 0.0;
    for (int i = 0; i < n; i++) {
        double x = xy[2 * i], y = xy[2 * i + 1];
        finite += (x - x) + (y - y); /* NaN and inf leave NaN */
        x_min = x < x_min ? x : x_min;
        x_max = x > x_max ? x : x_max;
        y_min = y < y_min ? y : y_min;
        y_max = y > y_max ? y : y_max;
    }
    if (finite != 0.0)
        return NOT_FINITE;
    double extent = fmax(x_max - x_min, y_max - y_min);
    if (!(extent > EXTENT_MIN && extent < EXTENT_MAX))
        return NO_EXTENT;
    double tiny = SNAP * extent;
    for (int i = 0; i < n; i++) {
        double x = xy[2 * i], y = xy[2 * i + 1];
        m->point[i].x = fabs(x) < tiny ? 0.0 : x;
        m->point[i].y = fabs(y) < tiny ? 0.0 : y;
    }
    double half = 0.5 * extent * GUARD, x_mid = x_min + 0.5 * (x_max - x_min), y_mid = y_min + 0.5 * (y_max - y_min);
    m->point[n] = (Point){x_mid - half, y_mid - half};
    m->point[n + 1] = (Point){x_mid + half, y_mid - half};
    m->point[n + 2] = (Point){x_mid + half, y_mid + half};
    m->point[n + 3] = (Point){x_mid - half, y_mid + half};

    int fresh = m->n_triangles == 0;
    for (int i = 0; m->n_twins > 0 && i < n; i++) { /* twins that part need a vertex of their own */
        Point a = m->point[i], b = m->point[m->same_as[i]];
        fresh |= a.x != b.x || a.y != b.y;
    }
    if (!fresh) {
        int sound = 1;
        long flips = m->flips;
        for (int t = 0; t < m->n_triangles; t++)
            sound &= measure(m, t);
        fresh = !sound && !mend(m);
        m->changes += m->flips != flips;
    }
    if (fresh && !build(m))
        return NOT_BUILT;
    for (;;) {
        sweep(m);
        if (m->n_stack == 0)
            break;
        m->changes++;
        if (!legalize(m, 1, (long)FLIPS_PER_TRIANGLE * m->n_triangles) && !build(m))
            return NOT_BUILT;
    }
    refine(m);
    share(m);
    for (int i = 0; i < m->n_pins; i++)
        area_out[i] = m->area[i] < INFINITY ? 0.125 * m->area[i] : NAN;
    return DONE;
}

/* ---------------------------------------------------------------- Python */

typedef struct {
    PyObject_HEAD
    Mesh mesh;
} MeshObject;

static PyObject *mesh_new(PyTypeObject *type, PyObject *args, PyObject *kwargs)
{
    static char *names[] = {"n_pins", "n_boundary", "n_fence", NULL};
    int n_pins, n_boundary, n_fence = 0;
    if (!PyArg_ParseTupleAndKeywords(args, kwargs, "ii|i", names, &n_pins, &n_boundary, &n_fence))
        return NULL;
    if (n_pins < 1 || n_boundary < 0 || n_fence < 0 || n_pins > MANY || n_boundary > MANY || n_fence > MANY) {
        PyErr_Format(PyExc_ValueError, "need 1 <= n_pins, 0 <= n_boundary, n_fence <= %d, got %d, %d, %d", MANY,
                     n_pins, n_boundary, n_fence);
        return NULL;
    }
    int n_points = n_pins + n_boundary + n_fence;
    allocfunc alloc = (allocfunc)PyType_GetSlot(type, Py_tp_alloc);
    MeshObject *self = (MeshObject *)alloc(type, 0);
    if (self == NULL)
        return NULL;
    Mesh *m = &self->mesh;
    m->n_pins = n_pins;
    m->n_bounded = n_pins + n_boundary;
    m->n_points = n_points;
    size_t n = (size_t)n_points + N_GUARD, triangles = 2 * (size_t)n_points + 2, half_edges = 3 * triangles;
    size_t bytes = n * (sizeof(Point) + 2 * sizeof(double) + sizeof(int32_t) + 1) +
                   half_edges * (2 * sizeof(double) + 3 * sizeof(int32_t) + 1) + triangles * sizeof(double);
    char *memory = calloc(bytes, 1);
    if (memory == NULL) {
        Py_DECREF(self);
        return PyErr_NoMemory();
    }
    m->memory = memory; /* widest members first: all stay aligned */
    m->point = (Point *)memory, memory += n * sizeof(Point);
    m->area = (double *)memory, memory += n * sizeof(double);
    m->bound = (double *)memory, memory += n * sizeof(double);
    m->cot = (double *)memory, memory += half_edges * sizeof(double);
    m->len2 = (double *)memory, memory += half_edges * sizeof(double);
    m->err = (double *)memory, memory += triangles * sizeof(double);
    m->tail = (int32_t *)memory, memory += half_edges * sizeof(int32_t);
    m->twin = (int32_t *)memory, memory += half_edges * sizeof(int32_t);
    m->stack = (int32_t *)memory, memory += half_edges * sizeof(int32_t);
    m->same_as = (int32_t *)memory, memory += n * sizeof(int32_t);
    m->stacked = (uint8_t *)memory, memory += half_edges;
    m->doubtful = (uint8_t *)memory;
    return (PyObject *)self;
}

static void mesh_dealloc(MeshObject *self)
{
    PyTypeObject *type = Py_TYPE((PyObject *)self);
    free(self->mesh.memory);
    freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
    release(self);
    Py_DECREF(type);
}

static int get_doubles(PyObject *object, Py_buffer *view, Py_ssize_t n, int flags, const char *name)
{
    if (PyObject_GetBuffer(object, view, flags | PyBUF_C_CONTIGUOUS | PyBUF_FORMAT) < 0)
        return -1;
    if (view->len != n * (Py_ssize_t)sizeof(double) || view->format == NULL || strcmp(view->format, "d") != 0) {
        PyErr_Format(PyExc_ValueError, "%s must be a contiguous float64 array of %zd numbers", name, n);
        PyBuffer_Release(view);
        return -1;
    }
    return 0;
}

/* ---------------------------------------------------------------- the points of a frame */

/* As in _centroid.c: the wide clone needs glibc's help. The arithmetic is the same in both. */
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
#define WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
#else
#define WIDE
#endif

/* Four sums, that do not wait for each other. */
static double dot(const double *a, const double *b, Py_ssize_t n)
{
    double sum[4] = {0};
    Py_ssize_t i = 0;
    for (; i + 4 <= n; i += 4)
        for (int k = 0; k < 4; k++) sum[k] += a[i + k] * b[i + k];
    for (; i < n; i++) sum[0] += a[i] * b[i];
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

/* The n pins into `points`, lost ones where the others make them most likely to be: see edge.tessellate.lost. One
 * pin's motion is taken out, so that a far origin costs no digits. */
static void fill_lost(const double *xy, const double *rest, Py_ssize_t n, const int32_t *lost, Py_ssize_t m,
                      const double *rows, const double *inverse, double *right, double *points)
{
    Py_ssize_t first = 0;
    while (first < m && lost[first] == first) first++;
    const double shift[2] = {xy[2 * first] - rest[2 * first], xy[2 * first + 1] - rest[2 * first + 1]};
    for (Py_ssize_t i = 0; i < 2 * n; i++) points[i] = xy[i] - rest[i] - shift[i & 1];
    for (Py_ssize_t l = 0; l < m; l++) points[2 * lost[l]] = points[2 * lost[l] + 1] = 0.0;
    for (Py_ssize_t l = 0; l < 2 * m; l++) right[l] = dot(rows + l * 2 * n, points, 2 * n);
    memcpy(points, xy, (size_t)(2 * n) * sizeof(double));
    for (Py_ssize_t l = 0; l < 2 * m; l++) {
        const Py_ssize_t at = 2 * lost[l / 2] + (l & 1);
        points[at] = rest[at] + shift[l & 1] - dot(inverse + l * 2 * m, right, 2 * m);
    }
}

/* Points round the pins move as the rim's pins say: `weights` (r, b), a row for each pin of the rim. */
WIDE static void carry_along(const double *pins, const double *rest, const int32_t *rim, Py_ssize_t r,
                             const double *restrict weights, const double *rest_around, Py_ssize_t b,
                             double *restrict x, double *restrict y, double *around)
{
    const Py_ssize_t one = rim[0];
    const double shift[2] = {pins[2 * one] - rest[2 * one], pins[2 * one + 1] - rest[2 * one + 1]};
    for (Py_ssize_t p = 0; p < b; p++) x[p] = y[p] = 0.0;
    for (Py_ssize_t k = 0; k < r; k++) {
        const Py_ssize_t i = rim[k];
        const double dx = pins[2 * i] - rest[2 * i] - shift[0], dy = pins[2 * i + 1] - rest[2 * i + 1] - shift[1];
        const double *restrict w = weights + k * b;
        for (Py_ssize_t p = 0; p < b; p++) {
            x[p] += w[p] * dx;
            y[p] += w[p] * dy;
        }
    }
    for (Py_ssize_t p = 0; p < b; p++) {
        around[2 * p] = x[p] + rest_around[2 * p] + shift[0];
        around[2 * p + 1] = y[p] + rest_around[2 * p + 1] + shift[1];
    }
}

static PyObject *place(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *o[10];
    Arrays a = {.n = 0};
    PyObject *result = NULL;
    if (!PyArg_ParseTuple(args, "OO(OOOO)(OOO)O:place", &o[0], &o[1], &o[2], &o[3], &o[4], &o[5], &o[6], &o[7], &o[8],
                          &o[9]))
        return NULL;
    const double *xy = take(&a, o[0], 'd', -1, 0, "xy");
    const Py_ssize_t n = xy ? count(&a) / 2 : 0;
    const double *rest = xy ? take(&a, o[1], 'd', 2 * n, 0, "rest") : NULL;
    const int32_t *rim = rest ? take(&a, o[2], 'i', -1, 0, "rim") : NULL;
    const Py_ssize_t r = rim ? count(&a) : 0;
    const double *around = rim ? take(&a, o[4], 'd', -1, 0, "around") : NULL;
    const Py_ssize_t b = around ? count(&a) / 2 : 0;
    const double *weights = around ? take(&a, o[3], 'd', r * b, 0, "weights") : NULL;
    double *scratch = weights ? take(&a, o[5], 'd', 2 * b, 1, "scratch") : NULL;
    const int32_t *lost = scratch ? take(&a, o[6], 'i', -1, 0, "lost") : NULL;
    const Py_ssize_t m = lost ? count(&a) : 0;
    const double *rows = lost ? take(&a, o[7], 'd', 4 * m * n, 0, "rows") : NULL;
    const double *inverse = rows ? take(&a, o[8], 'd', 4 * m * m, 0, "inverse") : NULL;
    double *points = inverse ? take(&a, o[9], 'd', 2 * (n + b), 1, "points") : NULL;
    if (!points) goto done;
    int sound = n > m && r > 0;
    for (Py_ssize_t k = 0; k < r; k++) sound &= rim[k] >= 0 && rim[k] < n;
    for (Py_ssize_t l = 0; l < m; l++) sound &= lost[l] >= 0 && lost[l] < n && (l == 0 || lost[l] > lost[l - 1]);
    double *right = malloc((size_t)(2 * m + 1) * sizeof(double));
    if (!sound || !right) {
        free(right);
        if (sound) PyErr_NoMemory();
        else PyErr_SetString(PyExc_ValueError, "place: no such pin, or none left");
        goto done;
    }
    if (m) fill_lost(xy, rest, n, lost, m, rows, inverse, right, points);
    else memcpy(points, xy, (size_t)(2 * n) * sizeof(double));
    free(right);
    carry_along(points, rest, rim, r, weights, around, b, scratch, scratch + b, points + 2 * n);
    result = Py_NewRef(Py_None);
done:
    let_go(&a);
    return result;
}

static PyMethodDef functions[] = {
    {"place", place, METH_VARARGS,
     "place(xy, rest, (rim, weights, around, scratch), (lost, rows, inverse), points): writes the pins, lost ones "
     "filled in, and the points round them."},
    {NULL, NULL, 0, NULL},
};

static PyObject *mesh_update(MeshObject *self, PyObject *args)
{
    PyObject *points, *areas;
    Py_buffer xy, area;
    Mesh *m = &self->mesh;
    if (!PyArg_ParseTuple(args, "OO", &points, &areas))
        return NULL;
    if (m->busy) {
        PyErr_SetString(PyExc_RuntimeError, "another thread is updating this mesh");
        return NULL;
    }
    if (get_doubles(points, &xy, 2 * (Py_ssize_t)m->n_points, 0, "points") < 0)
        return NULL;
    if (get_doubles(areas, &area, m->n_pins, PyBUF_WRITABLE, "areas") < 0) {
        PyBuffer_Release(&xy);
        return NULL;
    }
    enum outcome outcome;
    m->busy = 1;
    Py_BEGIN_ALLOW_THREADS
    outcome = run(m, xy.buf, area.buf);
    Py_END_ALLOW_THREADS
    m->busy = 0;
    PyBuffer_Release(&xy);
    PyBuffer_Release(&area);
    if (outcome != DONE) {
        m->n_triangles = 0;
        PyErr_SetString(PyExc_ValueError, outcome == NOT_FINITE  ? "a coordinate is not finite"
                                          : outcome == NO_EXTENT ? "all points at one place, or farther apart than 7e19"
                                                                 : "no triangulation: coordinates out of range");
        return NULL;
    }
    return PyLong_FromLong(m->changes);
}

static PyObject *mesh_triangles(MeshObject *self, PyObject *unused)
{
    (void)unused;
    const Mesh *m = &self->mesh;
    if (m->busy) {
        PyErr_SetString(PyExc_RuntimeError, "another thread is updating this mesh");
        return NULL;
    }
    PyObject *bytes = PyBytes_FromStringAndSize(NULL, (Py_ssize_t)sizeof(int32_t) * 3 * m->n_triangles);
    if (bytes == NULL)
        return NULL;
    char *out = PyBytes_AsString(bytes);
    Py_ssize_t used = 0;
    for (int t = 0; t < m->n_triangles; t++) {
        const int32_t *v = m->tail + 3 * t;
        int pins = (v[0] < m->n_pins) + (v[1] < m->n_pins) + (v[2] < m->n_pins);
        int outer = (v[0] >= m->n_bounded) + (v[1] >= m->n_bounded) + (v[2] >= m->n_bounded);
        if (pins == 0 || outer > 0)
            continue;
        memcpy(out + used, v, 3 * sizeof(int32_t));
        used += 3 * (Py_ssize_t)sizeof(int32_t);
    }
    PyObject *result = PyBytes_FromStringAndSize(out, used);
    Py_DECREF(bytes);
    return result;
}

static PyObject *mesh_counts(MeshObject *self, PyObject *unused)
{
    (void)unused;
    return Py_BuildValue("(lll)", self->mesh.changes, self->mesh.flips, self->mesh.builds);
}

static PyMethodDef mesh_methods[] = {
    {"update", (PyCFunction)mesh_update, METH_VARARGS,
     "update(points, areas) -> int: moves the points, writes the pins' cell areas, returns how often the "
     "triangles have changed so far."},
    {"triangles", (PyCFunction)mesh_triangles, METH_NOARGS,
     "triangles() -> bytes: int32 triples, the triangles that touch a pin and not the fence."},
    {"counts", (PyCFunction)mesh_counts, METH_NOARGS, "counts() -> (changes, flips, builds) so far."},
    {NULL, NULL, 0, NULL},
};

static PyType_Slot mesh_slots[] = {
    {Py_tp_new, (void *)mesh_new},
    {Py_tp_dealloc, (void *)mesh_dealloc},
    {Py_tp_methods, mesh_methods},
    {Py_tp_doc, "Mesh(n_pins, n_boundary, n_fence=0): kept Delaunay triangulation of moving points."},
    {0, NULL},
};

static PyType_Spec mesh_spec = {"edge._cells.Mesh", sizeof(MeshObject), 0, Py_TPFLAGS_DEFAULT, mesh_slots};

static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, "_cells", "Kept Delaunay triangulation and cell areas.",
                                    -1, functions, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__cells(void)
{
    PyObject *self = PyModule_Create(&module);
    if (self == NULL)
        return NULL;
    PyObject *type = PyType_FromSpec(&mesh_spec);
    if (type == NULL || PyModule_AddObjectRef(self, "Mesh", type) < 0) {
        Py_XDECREF(type);
        Py_DECREF(self);
        return NULL;
    }
    Py_DECREF(type);
    return self;
}
