# The sums of `contact_fit`, which baseline x86 runs too slowly as compiled Python, described in `normal_sums.py`.
# A fit's step of two contacts, 130 pins: 166,000 instructions with SSE2, 74,000 with the AVX2 clone, chosen when the
# program loads.

cdef extern from *:
    """
    #if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
    #define VT_WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
    #else
    #define VT_WIDE
    #endif

    /* Four rows at a time: each sum is read and written once for the four. */
    VT_WIDE static void vt_normal_sums(const double *rows, Py_ssize_t n, Py_ssize_t stride, Py_ssize_t columns,
                                       double *restrict sums)
    {
        for (Py_ssize_t i = 0; i < n; i += 4) {
            const double *restrict r0 = rows + i * stride, *restrict r1 = r0 + stride;
            const double *restrict r2 = r1 + stride, *restrict r3 = r2 + stride;
            for (Py_ssize_t j = 0; j < columns; j++) {
                const double a = r0[j], b = r1[j], c = r2[j], d = r3[j];
                double *restrict sum = sums + j * stride;
                const Py_ssize_t end = (j & -4) + 4; /* no remainder: beyond the diagonal is not used */
                for (Py_ssize_t k = 0; k < end; k++)
                    sum[k] += (a * r0[k] + b * r1[k]) + (c * r2[k] + d * r3[k]);
            }
        }
    }
    """
    void vt_normal_sums(const double *, Py_ssize_t, Py_ssize_t, Py_ssize_t, double *) noexcept nogil


cdef inline void normal_sums(
    double[:, ::1] rows, Py_ssize_t n, Py_ssize_t columns, double[:, ::1] sums
) noexcept nogil:
    vt_normal_sums(&rows[0, 0], n, rows.shape[1], columns, &sums[0, 0])
