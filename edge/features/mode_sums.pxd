# The sums of `modes`, which baseline x86 runs too slowly as compiled Python, described in `mode_sums.py`. A frame
# of 331 pins: 18,000 instructions with SSE2, a third of it with the AVX2 clone, chosen when the program loads.

cdef extern from *:
    """
    #if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
    #define VT_WIDE __attribute__((target_clones("arch=x86-64-v3", "default")))
    #else
    #define VT_WIDE
    #endif

    VT_WIDE static void vt_mode_sums(const short *restrict basis, const float *restrict step,
                                     const double *restrict motion, Py_ssize_t n, float *restrict sums)
    {
        float re[24] = {0}, im[24] = {0}; /* in registers */
        for (Py_ssize_t i = 0; i < n; i++, basis += 24) {
            const float x = (float)motion[2 * i], y = (float)motion[2 * i + 1];
            for (int j = 0; j < 24; j++) re[j] += (float)basis[j] * x, im[j] += (float)basis[j] * y;
        }
        for (int j = 0; j < 24; j++) sums[j] = re[j] * step[j], sums[24 + j] = im[j] * step[j];
    }
    """
    void vt_mode_sums(const short *, const float *, const double *, Py_ssize_t, float *) noexcept nogil


cdef inline void mode_sums(
    const short[:, ::1] basis, const float[::1] step, const double[:, ::1] motion, float[::1] sums
) noexcept nogil:
    vt_mode_sums(&basis[0, 0], &step[0], &motion[0, 0], basis.shape[0], &sums[0])
