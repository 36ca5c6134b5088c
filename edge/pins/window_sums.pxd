cdef extern from "window_sums.c":
    ctypedef struct Kind "vt_kind":
        Py_ssize_t half, first_span, end_span, first_step, end_step, row_bytes, first, first_uv, plane, pixels
    ctypedef struct Fetch "vt_fetch":
        Py_ssize_t row, end, stride, first, beyond, rows, ahead

    ctypedef struct Windows "vt_windows":
        const unsigned char *image
        Fetch *fetch
        const Kind *kinds
        const Py_ssize_t *steps
        const short *values
        const signed char *uv
        const double *norms
        unsigned char *pixels
        double *sums
        bint dark

    void vt_sum_window(const Windows *, Py_ssize_t, Py_ssize_t, Py_ssize_t) noexcept nogil


cdef inline Windows windows_of(
    const unsigned char[:, :] image, Fetch[::1] fetch, Kind[::1] kinds, Py_ssize_t[:, ::1] steps, short[::1] values,
    signed char[::1] uv, double[:, ::1] norms, unsigned char[::1] pixels, double[::1] sums, bint dark
) noexcept nogil:
    return Windows(
        &image[0, 0], &fetch[0], &kinds[0], &steps[0, 0], &values[0], &uv[0], &norms[0, 0], &pixels[0], &sums[0], dark
    )


cdef inline void sum_window(Windows windows, Py_ssize_t begin, Py_ssize_t kind, Py_ssize_t norm) noexcept nogil:
    vt_sum_window(&windows, begin, kind, norm)
