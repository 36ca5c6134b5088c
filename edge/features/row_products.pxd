# The products of `quantized_operator`, which baseline x86 runs too slowly as compiled Python, described in
# `row_products.py`. Both surfaces of a frame of 331 pins: 37 us with SSE2, 10 us with the AVX2 clone, chosen
# when the program loads.

cdef extern from *:
    """
    #if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
    #define VT_WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
    #else
    #define VT_WIDE
    #endif

    /* Four rows at a time: the vector is read once for the four, and their sums are independent. */
    VT_WIDE static void vt_all_rows(const short *rows, Py_ssize_t n, Py_ssize_t width_, const short *restrict vector,
                                    int *restrict sums)
    {
        const Py_ssize_t width = width_ & -16; /* no remainder: width_ is a multiple of 16 */
        Py_ssize_t p = 0;
        for (; p + 4 <= n; p += 4) {
            const short *restrict r0 = rows + p * width, *restrict r1 = r0 + width;
            const short *restrict r2 = r1 + width, *restrict r3 = r2 + width;
            int s0 = 0, s1 = 0, s2 = 0, s3 = 0;
            for (Py_ssize_t i = 0; i < width; i++) {
                const int v = vector[i];
                s0 += r0[i] * v;
                s1 += r1[i] * v;
                s2 += r2[i] * v;
                s3 += r3[i] * v;
            }
            sums[p] = s0, sums[p + 1] = s1, sums[p + 2] = s2, sums[p + 3] = s3;
        }
        for (; p < n; p++) {
            const short *restrict row = rows + p * width;
            int sum = 0;
            for (Py_ssize_t i = 0; i < width; i++) sum += row[i] * vector[i];
            sums[p] = sum;
        }
    }

    VT_WIDE static void vt_some_rows(const short *rows, const int *which, Py_ssize_t n, Py_ssize_t width_,
                                     const short *restrict vector, int *restrict sums)
    {
        const Py_ssize_t width = width_ & -16;
        for (Py_ssize_t p = 0; p < n; p++) {
            const short *restrict row = rows + which[p] * width;
            int sum = 0;
            for (Py_ssize_t i = 0; i < width; i++) sum += row[i] * vector[i];
            sums[p] = sum;
        }
    }
    """
    void vt_all_rows(const short *, Py_ssize_t, Py_ssize_t, const short *, int *) noexcept nogil
    void vt_some_rows(const short *, const int *, Py_ssize_t, Py_ssize_t, const short *, int *) noexcept nogil


cdef inline void all_rows(short[:, ::1] rows, short[::1] vector, int[::1] sums) noexcept nogil:
    vt_all_rows(&rows[0, 0], rows.shape[0], rows.shape[1], &vector[0], &sums[0])


cdef inline void some_rows(
    short[:, ::1] rows, const int[::1] which, Py_ssize_t n, short[::1] vector, int[::1] sums
) noexcept nogil:
    if n:
        vt_some_rows(&rows[0, 0], &which[0], n, rows.shape[1], &vector[0], &sums[0])
