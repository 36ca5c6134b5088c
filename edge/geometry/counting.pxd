# The selection of `select`, which baseline x86 runs too slowly as compiled Python, described in `counting.py`. The
# median of 331 numbers: 5,500 instructions with the AVX2 clone, chosen when the program loads, 9,000 by partitioning.

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

    #define VT_ROW(i) (*(const vt_row *)(v + (i)))
    #define VT_ALL(number) {number, number, number, number}
    #define VT_SELECT(mask, a, b) (((a) & (mask)) | ((b) & ~(mask)))
    #define VT_PICK(mask, a, b) ((vt_row)VT_SELECT(mask, (vt_which)(a), (vt_which)(b)))
    #define VT_LOWER(a, b) VT_PICK((a) < (b), a, b)
    #define VT_HIGHER(a, b) VT_PICK((a) > (b), a, b)
    #define VT_INLINE static inline __attribute__((always_inline)) /* into both clones */

    /* Below, all is in four parts that do not wait for each other. */

    /* The lowest number that is not below from. */
    VT_INLINE double vt_lowest(const double *restrict v, Py_ssize_t n, double from)
    {
        #define VT_TAKE_LOW(low, i) low = VT_PICK((VT_ROW(i) >= froms) & (VT_ROW(i) < low), VT_ROW(i), low)
        const vt_row froms = VT_ALL(from);
        vt_row low = VT_ALL(__builtin_inf()), low1 = low, low2 = low, low3 = low;
        Py_ssize_t i = 0;
        for (; i + 16 <= n; i += 16) {
            VT_TAKE_LOW(low, i);
            VT_TAKE_LOW(low1, i + 4);
            VT_TAKE_LOW(low2, i + 8);
            VT_TAKE_LOW(low3, i + 12);
        }
        for (; i + 4 <= n; i += 4) VT_TAKE_LOW(low, i);
        low = VT_LOWER(low, low1), low2 = VT_LOWER(low2, low3), low = VT_LOWER(low, low2);
        for (; i < n; i++) low[0] = v[i] >= from && v[i] < low[0] ? v[i] : low[0];
        for (i = 1; i < 4; i++) low[0] = low[i] < low[0] ? low[i] : low[0];
        return low[0];
    }

    /* The highest number that does not reach beyond, which nothing does if it is NaN. */
    VT_INLINE double vt_highest(const double *restrict v, Py_ssize_t n, double beyond)
    {
        #define VT_TAKE_HIGH(high, i) high = VT_PICK(~(VT_ROW(i) >= ends) & (VT_ROW(i) > high), VT_ROW(i), high)
        const vt_row ends = VT_ALL(beyond);
        vt_row high = VT_ALL(-__builtin_inf()), high1 = high, high2 = high, high3 = high;
        Py_ssize_t i = 0;
        for (; i + 16 <= n; i += 16) {
            VT_TAKE_HIGH(high, i);
            VT_TAKE_HIGH(high1, i + 4);
            VT_TAKE_HIGH(high2, i + 8);
            VT_TAKE_HIGH(high3, i + 12);
        }
        for (; i + 4 <= n; i += 4) VT_TAKE_HIGH(high, i);
        high = VT_HIGHER(high, high1), high2 = VT_HIGHER(high2, high3), high = VT_HIGHER(high, high2);
        for (; i < n; i++) high[0] = !(v[i] >= beyond) && v[i] > high[0] ? v[i] : high[0];
        for (i = 1; i < 4; i++) high[0] = high[i] > high[0] ? high[i] : high[0];
        return high[0];
    }

    VT_INLINE Py_ssize_t vt_below(const double *restrict v, Py_ssize_t n, double limit)
    {
        const vt_row limits = VT_ALL(limit);
        vt_which counts = {0}, counts1 = {0}, counts2 = {0}, counts3 = {0};
        Py_ssize_t i = 0;
        for (; i + 16 <= n; i += 16) {
            counts -= limits > VT_ROW(i), counts1 -= limits > VT_ROW(i + 4);
            counts2 -= limits > VT_ROW(i + 8), counts3 -= limits > VT_ROW(i + 12);
        }
        for (; i + 4 <= n; i += 4) counts -= limits > VT_ROW(i);
        counts += counts1 + (counts2 + counts3);
        Py_ssize_t count = counts[0] + counts[1] + counts[2] + counts[3];
        for (; i < n; i++) count += v[i] < limit;
        return count;
    }

    VT_WIDE static double vt_kth(const double *restrict v, Py_ssize_t n, Py_ssize_t k)
    {
        double low = vt_lowest(v, n, -__builtin_inf()), high = vt_highest(v, n, __builtin_nan(""));
        if (high == 0) high = 0; /* of zeros the last one */
        long long least = vt_key(low), most = vt_key(high);
        Py_ssize_t below = 0, up_to = n; /* how many are below the range, and up to its end */
        while (k > below && k < up_to - 1 && least < most) {
            /* the upper half's first; halves of both, as their sum may be too large */
            const long long half = (least >> 1) + (most >> 1) + ((least | most) & 1);
            const Py_ssize_t count = vt_below(v, n, vt_number(half));
            const long long lower = -(long long)(count > k); /* no branch, which nothing could predict */
            most = VT_SELECT(lower, half - 1, most), up_to = VT_SELECT(lower, count, up_to);
            least = VT_SELECT(lower, least, half), below = VT_SELECT(lower, below, count);
        }
        /* The range's highest number; or its lowest, or all are equal there. */
        return k == up_to - 1 ? vt_highest(v, n, vt_number(most + 1)) : vt_lowest(v, n, vt_number(least));
    }
    """
    double vt_kth(const double *, Py_ssize_t, Py_ssize_t) noexcept nogil


cdef inline double kth(const double[::1] v, Py_ssize_t n, Py_ssize_t k) noexcept nogil:
    return vt_kth(&v[0], n, k)
