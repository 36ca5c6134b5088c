from libc.math cimport sqrt

cdef enum:  # columns of `NORM` that a pin at the image's border needs
    RADIUS = 19
    LONGEST
    D2
    UNIT_D
    UNIT_T

cdef extern from "centroid_steps.c":
    enum:
        LANES "VT_LANES"
        UNROLL "VT_UNROLL"

    ctypedef struct Kind "vt_kind":
        Py_ssize_t first_span, end_span, first_step, end_step, first, first_uv, plane, pixels
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
        Py_ssize_t side

    ctypedef struct Steps "vt_steps":
        const double *norms
        const double *predicted
        const double *inner
        const int *norm_of
        Py_ssize_t stride
        double reach2, noise2, gain, side
        double *xy
        double *sigma
        double *amplitude
        double *fit

    void vt_sum_window(const Windows *, Py_ssize_t, Py_ssize_t) noexcept nogil
    bint vt_step(
        const Steps *, const double *, Py_ssize_t, Py_ssize_t, double, double, double, double, bint
    ) noexcept nogil
    Py_ssize_t vt_take_steps(const Windows *, const Steps *, int *, Py_ssize_t, double, double, bint) noexcept nogil


cdef inline Windows windows_of(
    const unsigned char[:, :] image, Fetch[::1] fetch, Kind[::1] kinds, Py_ssize_t[:, ::1] steps, short[::1] values,
    signed char[::1] uv, double[:, ::1] norms, unsigned char[::1] pixels, double[::1] sums, bint dark,
    Py_ssize_t side
) noexcept nogil:
    return Windows(
        &image[0, 0], &fetch[0], &kinds[0], &steps[0, 0], &values[0], &uv[0], &norms[0, 0], &pixels[0], &sums[0], dark,
        side
    )


cdef inline void sum_window(Windows windows, Py_ssize_t begin, Py_ssize_t norm) noexcept nogil:
    vt_sum_window(&windows, begin, norm)


cdef inline Steps steps_of(
    double[:, ::1] norms, double[:, ::1] predicted, double[::1] inner, int[::1] norm_of,
    Py_ssize_t stride, double reach2, double noise2, double gain, double side, double[:, ::1] xy, double[::1] sigma,
    double[::1] amplitude, double[::1] fit
) noexcept nogil:
    return Steps(
        &norms[0, 0], &predicted[0, 0], &inner[0], &norm_of[0], stride, reach2, noise2, gain,
        side, &xy[0, 0], &sigma[0], &amplitude[0], &fit[0]
    )


cdef inline bint take_step(
    Steps steps, double[::1] sums, Py_ssize_t i, Py_ssize_t norm, double x, double y, double near2, double far2,
    bint first
) noexcept nogil:
    return vt_step(&steps, &sums[0], i, norm, x, y, near2, far2, first)


cdef inline Py_ssize_t take_steps(
    Windows windows, Steps steps, int[::1] who, Py_ssize_t n, double near2, double far2, bint first
) noexcept nogil:
    return vt_take_steps(&windows, &steps, &who[0], n, near2, far2, first)


cdef inline double sigma_of(
    double noise_variance, double rest, double freedom, double energy, double noise2, double radius
) noexcept nogil:
    cdef double missing = rest - freedom * (noise2 + 1.0 / 12.0)
    cdef double m = missing / energy if missing > 0 and energy > 0 else 0.0
    cdef double hidden = radius * m * m
    return sqrt(noise_variance + hidden * hidden)
