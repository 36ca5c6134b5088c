cdef extern from "triangle_parts.c":
    Py_ssize_t vt_measure(
        const int *, const double *, const double *, Py_ssize_t, double, double, double *, double *, int *
    ) noexcept


cdef inline Py_ssize_t measure(
    int[::1] tail, double[::1] x, double[::1] y, Py_ssize_t n, double sliver, double bound,
    double[:, ::1] parts, double[::1] area, int[::1] unsure
) noexcept:
    return vt_measure(&tail[0], &x[0], &y[0], n, sliver, bound, &parts[0, 0], &area[0], &unsure[0])
