# The products of `quantized_operator`, which baseline x86 runs too slowly as compiled Python, described in
# `row_products.py`. The whole surface of 331 pins, 709 points: 5 us with AVX2, chosen at run time.

cdef extern from *:
    """
    #if defined(__x86_64__) && defined(__GNUC__)
    #define VT_AVX2
    #include <immintrin.h>
    #endif

    #define VT_BLOCK 16 /* columns */
    #define VT_ROW_PRODUCTS_ARGUMENTS \
        const short *restrict weights, const int *restrict start, const unsigned short *restrict block, \
        const int *restrict which, Py_ssize_t n, const short *restrict vector, int *restrict sums

    static inline void vt_row_products_plain(VT_ROW_PRODUCTS_ARGUMENTS)
    {
        for (Py_ssize_t p = 0; p < n; p++) {
            int sum = 0;
            for (Py_ssize_t b = start[which[p]]; b < start[which[p] + 1]; b++)
                for (int i = 0; i < VT_BLOCK; i++) sum += weights[VT_BLOCK * b + i] * vector[VT_BLOCK * block[b] + i];
            sums[p] = sum;
        }
    }

    #ifdef VT_AVX2
    __attribute__((target("avx2"))) static void vt_row_products_avx2(VT_ROW_PRODUCTS_ARGUMENTS)
    {
        #define VT_LOAD(p) _mm256_loadu_si256((const __m256i *)(p))
        for (Py_ssize_t p = 0; p < n; p++) {
            __m256i sum = _mm256_setzero_si256();
            for (Py_ssize_t b = start[which[p]]; b < start[which[p] + 1]; b++)
                sum = _mm256_add_epi32(sum, _mm256_madd_epi16(VT_LOAD(weights + VT_BLOCK * b),
                                                              VT_LOAD(vector + VT_BLOCK * block[b])));
            __m128i four = _mm_add_epi32(_mm256_castsi256_si128(sum), _mm256_extracti128_si256(sum, 1));
            four = _mm_add_epi32(four, _mm_shuffle_epi32(four, 0x4E));
            sums[p] = _mm_cvtsi128_si32(_mm_add_epi32(four, _mm_shuffle_epi32(four, 0xB1)));
        }
    }
    #endif

    static void vt_row_products(VT_ROW_PRODUCTS_ARGUMENTS)
    {
    #ifdef VT_AVX2
        if (__builtin_cpu_supports("avx2")) vt_row_products_avx2(weights, start, block, which, n, vector, sums);
        else
    #endif
        vt_row_products_plain(weights, start, block, which, n, vector, sums);
    }
    """
    void vt_row_products(
        const short *, const int *, const unsigned short *, const int *, Py_ssize_t, const short *, int *
    ) noexcept nogil


cdef inline void row_products(
    short[::1] weights, int[::1] start, unsigned short[::1] block, const int[::1] which, Py_ssize_t n,
    short[::1] vector, int[::1] sums
) noexcept nogil:
    if n:
        vt_row_products(&weights[0], &start[0], &block[0], &which[0], n, &vector[0], &sums[0])
