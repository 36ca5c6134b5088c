/* What `edge.track.tracker.Tracker.follow` does to a frame's arrays, in one call.
 *
 * Each found pin's motion since rest is held against what its neighbours' motion says (a constant sparse
 * matrix), twice: the second time without those that the first one threw out. Constants and their reasons
 * stand in the Python module, which hands them in.
 */
#include "_buffers.h"
#include <math.h>
#include <stdint.h>

typedef struct {
    double odd_motion, odd_change, odd_return, beside_share, bend_kept;
} Rules;

typedef struct {
    Py_ssize_t n, n_close, n_pairs;
    const double *found, *sigma, *rest, *last, *velocity, *last_bend, *weight, *step, *apart;
    const uint8_t *last_seen;
    const int32_t *start, *column, *close, *pair;
    const Rules *rule;
    double *limit, *given, *common; /* scratch: n, 2n, 2n */
    double *now, *bend, *xy_out, *sigma_out;
    uint8_t *seen;
} Frame;

static double select_kth(double *v, Py_ssize_t n, Py_ssize_t kth)
{
    Py_ssize_t low = 0, high = n - 1;
    while (low < high) {
        const double pivot = v[(low + high) / 2];
        Py_ssize_t i = low, j = high;
        while (i <= j) {
            while (v[i] < pivot) i++;
            while (v[j] > pivot) j--;
            if (i <= j) {
                const double t = v[i];
                v[i++] = v[j];
                v[j--] = t;
            }
        }
        if (kth <= j) high = j;
        else if (kth >= i) low = i;
        else break;
    }
    return v[kth];
}

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

enum { FOUND, SIGMA, LAST, VELOCITY, LAST_BEND, LAST_SEEN, REST, STEP, START, COLUMN, WEIGHT, CLOSE, PAIR, APART, RULES,
       FIXED };

static PyObject *follow(PyObject *self, PyObject *args)
{
    (void)self;
    PyObject *frame, *tip, *scratch, *results;
    PyObject *result = NULL;
    Arrays a = {.n = 0}, b = {.n = 0};
    Frame f;
    if (!PyArg_ParseTuple(args, "O!O!OO!:follow", &PyTuple_Type, &frame, &PyTuple_Type, &tip, &scratch, &PyTuple_Type,
                          &results))
        return NULL;
    if (PyTuple_Size(frame) != REST || PyTuple_Size(tip) != FIXED - REST || PyTuple_Size(results) != 5) {
        PyErr_SetString(PyExc_ValueError, "follow: 6 arrays of the frame, 9 of the tip, 5 results");
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
    TAKE(limit, &b, scratch, 'd', 5 * n, 1, "scratch");
    f.given = f.limit + n;
    f.common = f.given + 2 * n;
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
    jump = settle(&f, &n_seen);
    Py_END_ALLOW_THREADS
    result = Py_BuildValue("(nd)", n_seen, jump);
done:
    let_go(&b);
    let_go(&a);
    return result;
}

static PyMethodDef methods[] = {
    {"follow", follow, METH_VARARGS,
     "follow((found, sigma, last, velocity, last_bend, last_seen),\n"
     "       (rest, step, start, column, weight, close, pair, apart, rules), scratch,\n"
     "       (now, bend, seen, xy, sigma)) -> (pins seen, median surprise in steps)"},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef module = {
    PyModuleDef_HEAD_INIT, "_track", "The arithmetic of edge.track.", 0, methods, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__track(void) { return PyModuleDef_Init(&module); }
