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

    ctypedef struct Reading "vt_reading":
        const unsigned char *image
        Fetch *fetch
        const Kind *kinds
        const Py_ssize_t *steps
        const short *values
        const signed char *uv
        const double *norms
        unsigned char *pixels
        double *sums
        const double *predicted
        const double *inner
        const int *norm_of
        Py_ssize_t stride, side
        double reach2, noise2, gain
        bint dark
        double *xy
        double *sigma
        double *amplitude
        double *fit

    bint vt_step(
        const Reading *, Py_ssize_t, Py_ssize_t, double, double, double, double, bint
    ) noexcept nogil
    Py_ssize_t vt_take_steps(const Reading *, int *, Py_ssize_t, double, double, bint) noexcept nogil


cdef inline Reading reading_of(
    const unsigned char[:, :] image, Fetch[::1] fetch, Kind[::1] kinds, Py_ssize_t[:, ::1] steps, short[::1] values,
    signed char[::1] uv, double[:, ::1] norms, unsigned char[::1] pixels, double[::1] sums, double[:, ::1] predicted,
    double[::1] inner, int[::1] norm_of, Py_ssize_t stride, Py_ssize_t side, double reach2, double noise2,
    double gain, bint dark, double[:, ::1] xy, double[::1] sigma, double[::1] amplitude, double[::1] fit
) noexcept nogil:
    return Reading(
        &image[0, 0], &fetch[0], &kinds[0], &steps[0, 0], &values[0], &uv[0], &norms[0, 0], &pixels[0], &sums[0],
        &predicted[0, 0], &inner[0], &norm_of[0], stride, side, reach2, noise2, gain, dark, &xy[0, 0], &sigma[0],
        &amplitude[0], &fit[0]
    )


cdef inline bint take_step(
    Reading reading, Py_ssize_t i, Py_ssize_t norm, double x, double y, double near2, double far2, bint first
) noexcept nogil:
    return vt_step(&reading, i, norm, x, y, near2, far2, first)


cdef inline Py_ssize_t take_steps(
    Reading reading, int[::1] who, Py_ssize_t n, double near2, double far2, bint first
) noexcept nogil:
    return vt_take_steps(&reading, &who[0], n, near2, far2, first)


cdef inline double sigma_of(
    double noise_variance, double rest, double freedom, double energy, double noise2, double radius
) noexcept nogil:
    cdef double missing = rest - freedom * (noise2 + 1.0 / 12.0)
    cdef double m = missing / energy if missing > 0 and energy > 0 else 0.0
    cdef double hidden = radius * m * m
    return sqrt(noise_variance + hidden * hidden)
