/* What `edge.track.tracker.Tracker.follow` does to a frame's arrays, in one call.
 *
 * Each found pin's motion since rest is held against what its neighbours' motion says (a constant sparse
 * matrix), twice: the second time without those that the first one threw out. Constants and their reasons
 * stand in the Python module, which hands them in.
 */
#include "_buffers.h"
#include "_select.h"
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

typedef struct {
    double odd_motion, odd_change, odd_return, beside_share, bend_kept;
} Rules;

/* The rest lattice: k nearest pins of each, how much they count, and where they are, in pitches. */
typedef struct {
    Py_ssize_t n, k;
    const int32_t *near;
    const double *weight, *offset;
    double ridge;
} Map;

typedef struct {
    double light_sigmas, light_least, sigma_times, bend_least, bend_times, support_least;
} Doubts;

typedef struct {
    Py_ssize_t n, n_close, n_pairs;
    const double *found, *sigma, *light, *rest_look, *rest, *last, *velocity, *last_bend, *weight, *step, *apart;
    const uint8_t *last_seen;
    const int32_t *start, *column, *close, *pair;
    const Rules *rule;
    double *limit, *given, *common, *ratio; /* scratch: n, 2n, 2n, n */
    uint8_t *trusted; /* the last n of scratch */
    double *now, *bend, *xy_out, *sigma_out;
    uint8_t *seen;
} Frame;

static void judge(const Frame *f)
{
    const Py_ssize_t n = f->n;
    for (Py_ssize_t i = 0; i < n; i++) {
        double limit = f->rule->odd_change * f->step[i];
        if (!f->last_seen[i]) { /* a lost pin comes back beside pins that were seen */
            int beside = 0;
            for (Py_ssize_t c = 0; c < f->n_close; c++) beside += f->last_seen[f->close[i * f->n_close + c]];
            limit = beside >= f->rule->beside_share * (double)f->n_close ? f->rule->odd_return * f->step[i] : 0;
        }
        f->limit[i] = limit * limit;
        f->seen[i] = !isnan(f->found[2 * i]);
        for (int d = 0; d < 2; d++)
            f->common[2 * i + d] = f->last[2 * i + d] + f->velocity[2 * i + d] - f->rest[2 * i + d];
    }
    int mapped = 0; /* whether common is what the neighbours say, without the pin's own bend */
    for (int round = 0; round < 2; round++) {
        int all = 1;
        for (Py_ssize_t i = 0; i < n; i++) all &= f->seen[i];
        /* A lost pin moves as its neighbours, which may be lost pins that move as theirs. */
        for (int pass = 0; pass < (all ? 1 : 2); pass++) {
            for (Py_ssize_t i = 0; i < n; i++)
                for (int d = 0; d < 2; d++) {
                    const Py_ssize_t at = 2 * i + d;
                    const double alone = f->common[at] + (mapped ? f->last_bend[at] : 0);
                    f->given[at] = f->seen[i] ? f->found[at] - f->rest[at] : alone;
                }
            mapped = 1;
            for (Py_ssize_t i = 0; i < n; i++) {
                double x = 0, y = 0;
                for (int32_t k = f->start[i]; k < f->start[i + 1]; k++) {
                    const double *from = f->given + 2 * (Py_ssize_t)f->column[k];
                    x += f->weight[k] * from[0];
                    y += f->weight[k] * from[1];
                }
                f->common[2 * i] = x;
                f->common[2 * i + 1] = y;
            }
        }
        int same = 1;
        for (Py_ssize_t i = 0; i < n; i++) {
            double off = 0, change = 0;
            for (int d = 0; d < 2; d++) {
                const double bend = f->found[2 * i + d] - f->rest[2 * i + d] - f->common[2 * i + d];
                const double odd = bend - f->last_bend[2 * i + d];
                f->bend[2 * i + d] = bend;
                off += bend * bend;
                change += odd * odd;
            }
            const double most = f->rule->odd_motion * f->step[i];
            const uint8_t good = change < f->limit[i] && off < most * most; /* NaN, not found, is false */
            same &= good == f->seen[i];
            f->seen[i] = good;
        }
        if (same) break;
    }
}

static void keep_apart(const Frame *f)
{
    /* Both are judged on what was seen before any was thrown out. */
    memcpy(f->limit, f->seen, (size_t)f->n);
    const uint8_t *seen = (const uint8_t *)f->limit;
    for (Py_ssize_t p = 0; p < f->n_pairs; p++) {
        const int32_t a = f->pair[2 * p], b = f->pair[2 * p + 1];
        const double dx = f->found[2 * a] - f->found[2 * b], dy = f->found[2 * a + 1] - f->found[2 * b + 1];
        if (!(dx * dx + dy * dy < f->apart[p] * f->apart[p]) || !seen[a] || !seen[b]) continue;
        double odd[2] = {0, 0};
        for (int d = 0; d < 2; d++) {
            const double one = f->bend[2 * a + d] - f->last_bend[2 * a + d];
            const double two = f->bend[2 * b + d] - f->last_bend[2 * b + d];
            odd[0] += one * one;
            odd[1] += two * two;
        }
        f->seen[odd[0] > odd[1] ? a : b] = 0;
    }
}

/* Weighted least squares of an affine map: value[2] at the pin, gradient[4] = (d/dx of x, y; d/dy of x, y). */
static double predict_one(const Map *map, const double *motion, const uint8_t *known, Py_ssize_t i, double *value,
                          double *gradient)
{
    double w = 1e-9, x = 0, y = 0, xx = map->ridge, xy = 0, yy = map->ridge, r[3][2] = {{0, 0}, {0, 0}, {0, 0}};
    for (Py_ssize_t c = i * map->k; c < (i + 1) * map->k; c++) {
        const int32_t at = map->near[c];
        const double weight = map->weight[c];
        if (!known[at] || weight <= 0) continue;
        const double wx = weight * map->offset[2 * c], wy = weight * map->offset[2 * c + 1];
        w += weight, x += wx, y += wy;
        xx += wx * map->offset[2 * c], xy += wx * map->offset[2 * c + 1], yy += wy * map->offset[2 * c + 1];
        for (int d = 0; d < 2; d++) {
            const double m = motion[2 * at + d];
            r[0][d] += weight * m, r[1][d] += wx * m, r[2][d] += wy * m;
        }
    }
    const double a = xx * yy - xy * xy, b = xy * y - x * yy, c = x * xy - xx * y;
    const double det = w * a + x * b + y * c, e = x * y - w * xy;
    for (int d = 0; d < 2; d++) {
        value[d] = (a * r[0][d] + b * r[1][d] + c * r[2][d]) / det;
        if (!gradient) continue;
        gradient[d] = (b * r[0][d] + (w * yy - y * y) * r[1][d] + e * r[2][d]) / det;
        gradient[2 + d] = (c * r[0][d] + e * r[1][d] + (w * xx - x * x) * r[2][d]) / det;
    }
    return w;
}

/* How far a pin's motion is off what the trusted ones say, squared; below zero where too few of these are near. */
static double off_trusted(const Doubts *rule, const Map *map, const double *motion, const uint8_t *trusted,
                          Py_ssize_t i)
{
    double value[2], off = 0;
    if (predict_one(map, motion, trusted, i, value, NULL) < rule->support_least) return -1;
    for (int d = 0; d < 2; d++) off += (motion[2 * i + d] - value[d]) * (motion[2 * i + d] - value[d]);
    return off;
}

/* The median of some positive values to a ten-thousandth of their range, by halving it: counting is done four at a
 * time, while no processor guesses the branches of a selection, which takes three times as long. */
static double middle(const float *v, Py_ssize_t n)
{
    float low = v[0], high = v[0];
    for (Py_ssize_t i = 0; i < n; i++) {
        low = v[i] < low ? v[i] : low;
        high = v[i] > high ? v[i] : high;
    }
    for (int turn = 0; turn < 14; turn++) {
        const float half = 0.5f * (low + high);
        int below = 0;
        for (int i = 0; i < (int)n; i++) below += v[i] < half;
        if (below > (int)n / 2) high = half;
        else low = half;
    }
    return low;
}

/* Which pins look unlike themselves and do not go with their neighbours: no longer seen.
 *
 * light, sigma  (n,); rest_look  (2n,) of each its light at rest and how much its sigma may be beyond others';
 * bend (2n,) how far each is off its neighbours' map; motion (2n,) since rest
 * scratch, off  (n,); trusted (n,) bytes */
static void doubt(const Doubts *rule, const Map *map, const double *light, const double *rest_look,
                  const double *sigma, const double *bend, const double *motion, const double *step, uint8_t *seen,
                  double *scratch, double *off, uint8_t *trusted)
{
    enum { UNKNOWN = -2 };
    const Py_ssize_t n = map->n;
    int any = 0;
    for (Py_ssize_t i = 0; i < n; i++) {
        const double least = rule->bend_least * step[i];
        /* for now: whether it would matter */
        trusted[i] = !seen[i] || !(bend[2 * i] * bend[2 * i] + bend[2 * i + 1] * bend[2 * i + 1] > least * least);
        any |= !trusted[i];
    }
    if (!any) return;
    float *some = (float *)scratch;
    Py_ssize_t m = 0;
    for (Py_ssize_t i = 0; i < n; i++) {
        off[i] = light[i] / rest_look[2 * i];
        some[m] = (float)off[i];
        m += seen[i];
    }
    const double gain = middle(some, m);
    for (Py_ssize_t i = 0; i < m; i++) some[i] = fabsf(some[i] - (float)gain);
    const double unlike = fmax(rule->light_sigmas * 1.4826 * middle(some, m), rule->light_least * gain);
    m = 0;
    for (Py_ssize_t i = 0; i < n; i++) {
        some[m] = (float)sigma[i];
        m += seen[i];
    }
    const double unsure = rule->sigma_times * middle(some, m);
    for (Py_ssize_t i = 0; i < n; i++) {
        const int matters = !trusted[i];
        trusted[i] = seen[i] && !(fabs(off[i] - gain) > unlike) && !(sigma[i] > unsure * rest_look[2 * i + 1]);
        if (matters && !trusted[i]) seen[i] = 2; /* to be judged */
    }
    for (Py_ssize_t i = 0; i < n; i++) off[i] = UNKNOWN;
    for (Py_ssize_t i = 0; i < n; i++) {
        if (seen[i] != 2) continue;
        seen[i] = 1;
        const double least = rule->bend_least * step[i], own = off_trusted(rule, map, motion, trusted, i);
        if (own < least * least) continue;
        m = 0;
        for (Py_ssize_t c = i * map->k; c < (i + 1) * map->k; c++) {
            const int32_t at = map->near[c];
            if (!trusted[at] || !(map->weight[c] > 0)) continue;
            if (off[at] == UNKNOWN) off[at] = off_trusted(rule, map, motion, trusted, at);
            if (off[at] >= 0) scratch[m++] = off[at];
        }
        if (m) seen[i] = own < rule->bend_times * rule->bend_times * select_kth(scratch, m, 2 * m / 3);
    }
}

/* Where every pin goes; the median of what was not expected of it, in steps. */
static double settle(const Frame *f, Py_ssize_t *n_seen)
{
    *n_seen = 0;
    for (Py_ssize_t i = 0; i < f->n; i++) {
        double square = 0;
        for (int d = 0; d < 2; d++) {
            const Py_ssize_t at = 2 * i + d;
            if (!f->seen[i]) f->bend[at] = f->rule->bend_kept * f->last_bend[at];
            f->now[at] = f->seen[i] ? f->found[at] : f->rest[at] + f->common[at] + f->bend[at];
            f->xy_out[at] = f->seen[i] ? f->found[at] : NAN;
            const double surprise = f->now[at] - f->last[at] - f->velocity[at];
            square += surprise * surprise;
        }
        f->sigma_out[i] = f->seen[i] ? f->sigma[i] : NAN;
        f->limit[i] = square / (f->step[i] * f->step[i]);
        *n_seen += f->seen[i];
    }
    return sqrt(select_kth(f->limit, f->n, f->n / 2));
}

enum { FOUND, SIGMA, LIGHT, LAST, VELOCITY, LAST_BEND, LAST_SEEN, REST, STEP, START, COLUMN, WEIGHT, CLOSE, PAIR, APART,
       RULES, REST_LOOK, DOUBTS, FIXED };

static int take_map(Arrays *a, PyObject *tuple, Map *map);

static PyObject *follow(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *frame, *tip, *near, *scratch, *results;
    PyObject *result = NULL;
    Arrays a = {.n = 0}, b = {.n = 0}, c = {.n = 0};
    Frame f;
    if (!PyArg_ParseTuple(args, "O!O!O!OO!:follow", &PyTuple_Type, &frame, &PyTuple_Type, &tip, &PyTuple_Type, &near,
                          &scratch, &PyTuple_Type, &results))
        return NULL;
    if (PyTuple_Size(frame) != REST || PyTuple_Size(tip) != FIXED - REST || PyTuple_Size(results) != 5) {
        PyErr_SetString(PyExc_ValueError, "follow: 7 arrays of the frame, 11 of the tip, 5 results");
        return NULL;
    }
#define OF_FRAME(i) PyTuple_GetItem(frame, i)
#define OF_TIP(i) PyTuple_GetItem(tip, (i) - REST)
#define TAKE(field, from, object, type, size, writable, name) \
    if (!(f.field = take(from, object, type, size, writable, name))) goto done
    TAKE(last_seen, &a, OF_FRAME(LAST_SEEN), '?', -1, 0, "last_seen");
    const Py_ssize_t n = f.n = count(&a);
    TAKE(found, &a, OF_FRAME(FOUND), 'd', 2 * n, 0, "found");
    TAKE(sigma, &a, OF_FRAME(SIGMA), 'd', n, 0, "sigma");
    TAKE(light, &a, OF_FRAME(LIGHT), 'd', n, 0, "light");
    TAKE(last, &a, OF_FRAME(LAST), 'd', 2 * n, 0, "last");
    TAKE(velocity, &a, OF_FRAME(VELOCITY), 'd', 2 * n, 0, "velocity");
    TAKE(last_bend, &a, OF_FRAME(LAST_BEND), 'd', 2 * n, 0, "last_bend");
    TAKE(rest, &a, OF_TIP(REST), 'd', 2 * n, 0, "rest");
    TAKE(step, &a, OF_TIP(STEP), 'd', n, 0, "step");
    TAKE(start, &a, OF_TIP(START), 'i', n + 1, 0, "start");
    TAKE(column, &a, OF_TIP(COLUMN), 'i', f.start[n], 0, "column");
    TAKE(weight, &a, OF_TIP(WEIGHT), 'd', f.start[n], 0, "weight");
    TAKE(close, &a, OF_TIP(CLOSE), 'i', -1, 0, "close");
    f.n_close = n ? count(&a) / n : 0;
    TAKE(apart, &a, OF_TIP(APART), 'd', -1, 0, "apart");
    f.n_pairs = count(&a);
    TAKE(pair, &a, OF_TIP(PAIR), 'i', 2 * f.n_pairs, 0, "pair");
    TAKE(rule, &a, OF_TIP(RULES), 'd', sizeof(Rules) / sizeof(double), 0, "rules");
    TAKE(rest_look, &c, OF_TIP(REST_LOOK), 'd', 2 * n, 0, "rest_look");
    const Doubts *doubts = take(&c, OF_TIP(DOUBTS), 'd', sizeof(Doubts) / sizeof(double), 0, "doubts");
    Map map = {.n = n};
    if (!doubts || !take_map(&c, near, &map)) goto done;
    TAKE(limit, &b, scratch, 'd', 7 * n, 1, "scratch");
    f.given = f.limit + n;
    f.common = f.given + 2 * n;
    f.ratio = f.common + 2 * n;
    f.trusted = (uint8_t *)(f.ratio + n);
    TAKE(now, &b, PyTuple_GetItem(results, 0), 'd', 2 * n, 1, "now");
    TAKE(bend, &b, PyTuple_GetItem(results, 1), 'd', 2 * n, 1, "bend");
    TAKE(seen, &b, PyTuple_GetItem(results, 2), '?', n, 1, "seen");
    TAKE(xy_out, &b, PyTuple_GetItem(results, 3), 'd', 2 * n, 1, "xy");
    TAKE(sigma_out, &b, PyTuple_GetItem(results, 4), 'd', n, 1, "sigma out");
    if (!n || !f.n_close) {
        PyErr_SetString(PyExc_ValueError, "follow: no pins");
        goto done;
    }
    double jump;
    Py_ssize_t n_seen;
    Py_BEGIN_ALLOW_THREADS
    judge(&f);
    keep_apart(&f);
    for (Py_ssize_t i = 0; i < 2 * n; i++) f.given[i] = f.found[i] - f.rest[i];
    doubt(doubts, &map, f.light, f.rest_look, f.sigma, f.bend, f.given, f.step, f.seen, f.limit, f.ratio, f.trusted);
    jump = settle(&f, &n_seen);
    Py_END_ALLOW_THREADS
    result = Py_BuildValue("(nd)", n_seen, jump);
done:
    let_go(&c);
    let_go(&b);
    let_go(&a);
    return result;
}

/* Blobs, and a raster that says which is nearest: exact but for its cells' size. */
typedef struct {
    Py_ssize_t m, columns, rows;
    const double *xy;
    const int32_t *table;
    double left, top, per_px;
} Blobs;

static int32_t nearest(const Blobs *b, double x, double y)
{
    const double column = fmin(fmax((x - b->left) * b->per_px, 0), (double)(b->columns - 1));
    const double row = fmin(fmax((y - b->top) * b->per_px, 0), (double)(b->rows - 1));
    return b->table[(Py_ssize_t)(row + 0.5) * b->columns + (Py_ssize_t)(column + 0.5)];
}

/* Each pin takes the blob nearest to `at`, within its gate, and no blob is taken twice: the nearer pin has it.
 * owner (m,) is scratch. */
static void match_one(const Blobs *b, Py_ssize_t n, const double *at, const double *gate, int32_t *owner,
                      int32_t *blob, double *square, uint8_t *ours)
{
    for (Py_ssize_t j = 0; j < b->m; j++) owner[j] = -1;
    for (Py_ssize_t i = 0; i < n; i++) {
        const int32_t j = blob[i] = nearest(b, at[2 * i], at[2 * i + 1]);
        const double dx = b->xy[2 * j] - at[2 * i], dy = b->xy[2 * j + 1] - at[2 * i + 1];
        square[i] = dx * dx + dy * dy;
        ours[i] = square[i] < gate[i] * gate[i];
        if (!ours[i]) continue;
        const int32_t other = owner[j];
        if (other >= 0 && square[other] <= square[i]) {
            ours[i] = 0;
        } else {
            if (other >= 0) ours[other] = 0;
            owner[j] = (int32_t)i;
        }
    }
}

static int take_map(Arrays *a, PyObject *tuple, Map *map)
{
    PyObject *near, *weight, *offset;
    if (!PyArg_ParseTuple(tuple, "OOOd:map", &near, &weight, &offset, &map->ridge)) return 0;
    if (!(map->near = take(a, near, 'i', -1, 0, "near"))) return 0;
    const Py_ssize_t size = count(a);
    map->k = map->n ? size / map->n : 0;
    return (map->weight = take(a, weight, 'd', size, 0, "weight")) &&
           (map->offset = take(a, offset, 'd', 2 * size, 0, "offset"));
}

static int take_blobs(Arrays *a, PyObject *tuple, Blobs *b)
{
    PyObject *xy, *table;
    if (!PyArg_ParseTuple(tuple, "OOnddd:blobs", &xy, &table, &b->columns, &b->left, &b->top, &b->per_px)) return 0;
    if (!(b->xy = take(a, xy, 'd', -1, 0, "blobs"))) return 0;
    b->m = count(a) / 2;
    if (!(b->table = take(a, table, 'i', -1, 0, "table"))) return 0;
    b->rows = b->columns > 0 ? count(a) / b->columns : 0;
    if (b->m && b->rows) return 1;
    PyErr_SetString(PyExc_ValueError, "no blobs");
    return 0;
}

static PyObject *predict(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *motion, *known, *tuple, *value, *support, *gradient, *result = NULL;
    Arrays a = {.n = 0};
    Map map;
    if (!PyArg_ParseTuple(args, "OOO!OOO:predict", &motion, &known, &PyTuple_Type, &tuple, &value, &support, &gradient))
        return NULL;
    const uint8_t *is_known = take(&a, known, '?', -1, 0, "known");
    if (!is_known) goto done;
    const Py_ssize_t n = map.n = count(&a);
    const double *moved = take(&a, motion, 'd', 2 * n, 0, "motion");
    double *out = moved ? take(&a, value, 'd', 2 * n, 1, "value") : NULL;
    double *sum = out ? take(&a, support, 'd', n, 1, "support") : NULL;
    double *slope = sum ? take(&a, gradient, 'd', 4 * n, 1, "gradient") : NULL;
    if (!slope || !take_map(&a, tuple, &map)) goto done;
    for (Py_ssize_t i = 0; i < n; i++) sum[i] = predict_one(&map, moved, is_known, i, out + 2 * i, slope + 4 * i);
    result = Py_NewRef(Py_None);
done:
    let_go(&a);
    return result;
}

static PyObject *doubtful(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *light_, *rest_, *sigma_, *bend_, *motion_, *step_, *rules_, *tuple, *scratch_, *seen_, *result = NULL;
    Arrays a = {.n = 0};
    Map map;
    if (!PyArg_ParseTuple(args, "OOOOOOOO!OO:doubtful", &light_, &rest_, &sigma_, &bend_, &motion_, &step_, &rules_,
                          &PyTuple_Type, &tuple, &scratch_, &seen_))
        return NULL;
    uint8_t *seen = take(&a, seen_, '?', -1, 1, "seen");
    if (!seen) goto done;
    const Py_ssize_t n = map.n = count(&a);
    const double *light = take(&a, light_, 'd', n, 0, "light");
    const double *rest = light ? take(&a, rest_, 'd', 2 * n, 0, "rest_look") : NULL;
    const double *sigma = rest ? take(&a, sigma_, 'd', n, 0, "sigma") : NULL;
    const double *bend = sigma ? take(&a, bend_, 'd', 2 * n, 0, "bend") : NULL;
    const double *motion = bend ? take(&a, motion_, 'd', 2 * n, 0, "motion") : NULL;
    const double *step = motion ? take(&a, step_, 'd', n, 0, "step") : NULL;
    const Doubts *rule = step ? take(&a, rules_, 'd', sizeof(Doubts) / sizeof(double), 0, "doubts") : NULL;
    double *scratch = rule ? take(&a, scratch_, 'd', 7 * n, 1, "scratch") : NULL;
    if (!scratch || !take_map(&a, tuple, &map)) goto done;
    doubt(rule, &map, light, rest, sigma, bend, motion, step, seen, scratch, scratch + n, (uint8_t *)(scratch + 2 * n));
    result = Py_NewRef(Py_None);
done:
    let_go(&a);
    return result;
}

static PyObject *match(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *at_, *gate_, *tuple, *blob_, *square_, *ours_, *result = NULL;
    Arrays a = {.n = 0};
    Blobs blobs;
    int32_t *owner = NULL;
    if (!PyArg_ParseTuple(args, "OOO!OOO:match", &at_, &gate_, &PyTuple_Type, &tuple, &blob_, &square_, &ours_))
        return NULL;
    const double *gate = take(&a, gate_, 'd', -1, 0, "gate");
    if (!gate) goto done;
    const Py_ssize_t n = count(&a);
    const double *at = take(&a, at_, 'd', -1, 0, "at");
    if (!at || !n) goto done;
    const Py_ssize_t hypotheses = count(&a) / (2 * n), all = hypotheses * n;
    int32_t *blob = take(&a, blob_, 'i', all, 1, "blob");
    double *square = blob ? take(&a, square_, 'd', all, 1, "square") : NULL;
    uint8_t *ours = square ? take(&a, ours_, '?', all, 1, "ours") : NULL;
    if (!ours || !take_blobs(&a, tuple, &blobs)) goto done;
    if (!(owner = malloc((size_t)blobs.m * sizeof *owner))) {
        PyErr_NoMemory();
        goto done;
    }
    for (Py_ssize_t h = 0; h < all; h += n)
        match_one(&blobs, n, at + 2 * h, gate, owner, blob + h, square + h, ours + h);
    result = Py_NewRef(Py_None);
done:
    free(owner);
    let_go(&a);
    return result;
}

typedef struct {
    const double *rest, *gate;
    double least_support;
    int sweeps;
} Growth;

/* Every sweep judges every pin anew: one whose neighbours changed is predicted again, and all are matched. */
static int sweep(const Map *map, const Blobs *blobs, const Growth *g, double *motion, uint8_t *known, int32_t *blob)
{
    const Py_ssize_t n = map->n;
    double *real = malloc((size_t)n * 4 * sizeof *real);
    int32_t *whole = malloc((size_t)(n + blobs->m) * sizeof *whole);
    uint8_t *changed = malloc((size_t)n);
    if (!real || !whole || !changed) {
        free(real), free(whole), free(changed);
        return 0;
    }
    double *at = real, *gate = real + 2 * n, *square = real + 3 * n;
    int32_t *before = whole, *owner = whole + n;
    for (Py_ssize_t i = 0; i < n; i++) before[i] = known[i] ? -2 : -1; /* of the seed all counts as new */
    memset(changed, 1, (size_t)n);
    for (int round = 0; round < g->sweeps; round++) {
        for (Py_ssize_t i = 0; i < n; i++) {
            int anew = round == 0;
            for (Py_ssize_t c = i * map->k; !anew && c < (i + 1) * map->k; c++) anew = changed[map->near[c]];
            if (!anew) continue;
            double value[2];
            gate[i] = predict_one(map, motion, known, i, value, NULL) > g->least_support ? g->gate[i] : 0;
            for (int d = 0; d < 2; d++) at[2 * i + d] = g->rest[2 * i + d] + value[d];
        }
        match_one(blobs, n, at, gate, owner, blob, square, known);
        int any = 0;
        for (Py_ssize_t i = 0; i < n; i++) {
            const int32_t now = known[i] ? blob[i] : -1;
            any |= changed[i] = now != before[i];
            before[i] = now;
            for (int d = 0; d < 2; d++) motion[2 * i + d] = blobs->xy[2 * blob[i] + d] - g->rest[2 * i + d];
        }
        if (!any) break;
    }
    free(real), free(whole), free(changed);
    return 1;
}

static PyObject *grow(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *motion_, *known_, *blob_, *map_, *blobs_, *rest_, *gate_, *result = NULL;
    Arrays a = {.n = 0};
    Map map;
    Blobs blobs;
    Growth g;
    if (!PyArg_ParseTuple(args, "OOOO!O!OOdi:grow", &motion_, &known_, &blob_, &PyTuple_Type, &map_, &PyTuple_Type,
                          &blobs_, &rest_, &gate_, &g.least_support, &g.sweeps))
        return NULL;
    uint8_t *known = take(&a, known_, '?', -1, 1, "known");
    if (!known) goto done;
    const Py_ssize_t n = map.n = count(&a);
    double *motion = take(&a, motion_, 'd', 2 * n, 1, "motion");
    int32_t *blob = motion ? take(&a, blob_, 'i', n, 1, "blob") : NULL;
    if (!blob || !(g.rest = take(&a, rest_, 'd', 2 * n, 0, "rest"))) goto done;
    if (!(g.gate = take(&a, gate_, 'd', n, 0, "gate")) || !take_map(&a, map_, &map)) goto done;
    if (!take_blobs(&a, blobs_, &blobs)) goto done;
    if (sweep(&map, &blobs, &g, motion, known, blob)) result = Py_NewRef(Py_None);
    else PyErr_NoMemory();
done:
    let_go(&a);
    return result;
}

static int32_t root(int32_t *label, int32_t i)
{
    while (label[i] != i) i = label[i] = label[label[i]];
    return i;
}

static PyObject *pieces(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *motion_, *known_, *first_, *second_, *seam_, *label_, *result = NULL;
    Arrays a = {.n = 0};
    if (!PyArg_ParseTuple(args, "OOOOOO:pieces", &motion_, &known_, &first_, &second_, &seam_, &label_)) return NULL;
    const uint8_t *known = take(&a, known_, '?', -1, 0, "known");
    if (!known) goto done;
    const Py_ssize_t n = count(&a);
    const double *motion = take(&a, motion_, 'd', 2 * n, 0, "motion");
    const double *seam = motion ? take(&a, seam_, 'd', -1, 0, "seam") : NULL;
    if (!seam) goto done;
    const Py_ssize_t links = count(&a);
    const int32_t *first = take(&a, first_, 'i', links, 0, "first");
    const int32_t *second = first ? take(&a, second_, 'i', links, 0, "second") : NULL;
    int32_t *label = second ? take(&a, label_, 'i', n, 1, "label") : NULL;
    if (!label) goto done;
    for (int32_t i = 0; i < n; i++) label[i] = i;
    for (Py_ssize_t c = 0; c < links; c++) {
        const int32_t p = first[c], q = second[c];
        if (!known[p] || !known[q]) continue;
        const double dx = motion[2 * p] - motion[2 * q], dy = motion[2 * p + 1] - motion[2 * q + 1];
        if (dx * dx + dy * dy < seam[c] * seam[c]) label[root(label, p)] = root(label, q);
    }
    for (int32_t i = 0; i < n; i++) label[i] = root(label, i);
    result = Py_NewRef(Py_None);
done:
    let_go(&a);
    return result;
}

static PyObject *disagree(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *motion_, *known_, *ring_, *off_, *result = NULL;
    Arrays a = {.n = 0};
    Py_ssize_t n;
    if (!PyArg_ParseTuple(args, "OOOnO:disagree", &motion_, &known_, &ring_, &n, &off_)) return NULL;
    const uint8_t *known = take(&a, known_, '?', -1, 0, "known");
    if (!known || n < 1) goto done;
    const Py_ssize_t all = count(&a);
    const double *motion = take(&a, motion_, 'd', 2 * all, 0, "motion");
    const int32_t *ring = motion ? take(&a, ring_, 'i', -1, 0, "ring") : NULL;
    if (!ring) goto done;
    const Py_ssize_t k = count(&a) / n;
    double *off = take(&a, off_, 'd', all, 1, "off");
    if (!off) goto done;
    for (Py_ssize_t h = 0; h < all; h += n)
        for (Py_ssize_t i = 0; i < n; i++) {
            double x = 0, y = 0;
            int beside = 0;
            for (Py_ssize_t c = i * k; c < (i + 1) * k && ring[c] < n; c++) {
                const Py_ssize_t at = h + ring[c];
                if (!known[at]) continue;
                x += motion[2 * at], y += motion[2 * at + 1], beside++;
            }
            const double dx = motion[2 * (h + i)] - x / beside, dy = motion[2 * (h + i) + 1] - y / beside;
            off[h + i] = known[h + i] && beside ? sqrt(dx * dx + dy * dy) : INFINITY;
        }
    result = Py_NewRef(Py_None);
done:
    let_go(&a);
    return result;
}

static PyMethodDef methods[] = {
    {"disagree", disagree, METH_VARARGS,
     "disagree(motion, known, ring, pins, off): off is written, for each of the hypotheses that motion holds"},
    {"predict", predict, METH_VARARGS,
     "predict(motion, known, (near, weight, offset, ridge), value, support, gradient): the last three are written"},
    {"match", match, METH_VARARGS,
     "match(at, gate, (blobs, table, columns, left, top, cells per px), blob, square, ours): the last three are written"},
    {"grow", grow, METH_VARARGS,
     "grow(motion, known, blob, map, blobs, rest, gate, least support, sweeps): the first three are written"},
    {"pieces", pieces, METH_VARARGS,
     "pieces(motion, known, first, second, seam, label): label is written, one of the piece's pins"},
    {"doubt", doubtful, METH_VARARGS,
     "doubt(light, rest_look, sigma, bend, motion, step, doubts, map, scratch, seen): as `follow` does at its end;"
     " seen is written."},
    {"follow", follow, METH_VARARGS,
     "follow((found, sigma, light, last, velocity, last_bend, last_seen),\n"
     "       (rest, step, start, column, weight, close, pair, apart, rules, rest_look, doubts), map, scratch,\n"
     "       (now, bend, seen, xy, sigma)) -> (pins seen, median surprise in steps)"},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "_track", "The arithmetic of edge.track.", 0, methods, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__track(void) { return PyModuleDef_Init(&module); }
