# The selection of `select`, which baseline x86 runs too slowly as compiled Python, described in `counting.py`. The
# median of 331 numbers: 5,000 instructions with the AVX2 clone, chosen when the program loads, 9,000 by partitioning.

cdef extern from *:
    """
    #include <string.h>

    #if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
    #define VT_WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
    #else
    #define VT_WIDE
    #endif

    typedef double vt_row __attribute__((vector_size(32), aligned(8)));
    typedef long long vt_which __attribute__((vector_size(32), aligned(8)));

    /* Numbers in order have whole numbers in order; and back. */
    static inline long long vt_key(double number)
    {
        long long key;
        memcpy(&key, &number, 8);
        return key < 0 ? key ^ 0x7fffffffffffffff : key;
    }

    static inline double vt_number(long long key)
    {
        double number;
        key = key < 0 ? key ^ 0x7fffffffffffffff : key;
        memcpy(&number, &key, 8);
        return number;
    }

    VT_WIDE static double vt_kth(const double *restrict v, Py_ssize_t n, Py_ssize_t k)
    {
        const vt_row first = {v[0], v[0], v[0], v[0]};
        vt_row low = first, high = first;
        Py_ssize_t i = 0, below = 0, up_to = n; /* how many are below low, and up to high */
        for (; i + 4 <= n; i += 4) {
            const vt_row row = *(const vt_row *)(v + i);
            const vt_which lower = row < low, higher = row > high;
            low = (vt_row)(((vt_which)row & lower) | ((vt_which)low & ~lower));
            high = (vt_row)(((vt_which)row & higher) | ((vt_which)high & ~higher));
        }
        for (; i < n; i++) low[0] = v[i] < low[0] ? v[i] : low[0], high[0] = v[i] > high[0] ? v[i] : high[0];
        for (i = 1; i < 4; i++) {
            low[0] = low[i] < low[0] ? low[i] : low[0];
            high[0] = high[i] > high[0] ? high[i] : high[0];
        }
        if (high[0] == 0) high[0] = 0; /* of zeros the last one */
        long long least = vt_key(low[0]), most = vt_key(high[0]);
        while (up_to - below > 1 && least < most) {
            /* the upper half's first; halves of both, as their sum may be too large */
            const long long half = (least >> 1) + (most >> 1) + ((least | most) & 1);
            const double limit = vt_number(half);
            const vt_row limits = {limit, limit, limit, limit};
            vt_which counts = {0};
            for (i = 0; i + 16 <= n; i += 16)
                for (int part = 0; part < 16; part += 4) counts -= limits > *(const vt_row *)(v + i + part);
            for (; i + 4 <= n; i += 4) counts -= limits > *(const vt_row *)(v + i);
            Py_ssize_t count = counts[0] + counts[1] + counts[2] + counts[3];
            for (; i < n; i++) count += v[i] < limit;
            if (count > k) most = half - 1, up_to = count;
            else least = half, below = count;
        }
        /* the only one in the range, or equal to the others there; beyond infinity is NaN, and nothing above that */
        const double from = vt_number(least), beyond = vt_number(most + 1);
        const vt_row froms = {from, from, from, from}, beyonds = {beyond, beyond, beyond, beyond};
        for (i = 0; i + 4 <= n; i += 4) {
            const vt_row row = *(const vt_row *)(v + i);
            const vt_which in = (row >= froms) & ~(row >= beyonds);
            if (in[0] | in[1] | in[2] | in[3]) break;
        }
        while (i + 1 < n && (!(v[i] >= from) || v[i] >= beyond)) i++;
        return v[i];
    }
    """
    double vt_kth(const double *, Py_ssize_t, Py_ssize_t) noexcept nogil


cdef inline double kth(const double[::1] v, Py_ssize_t n, Py_ssize_t k) noexcept nogil:
    return vt_kth(&v[0], n, k)
