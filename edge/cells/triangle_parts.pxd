cdef extern from "triangle_parts.c":
    void vt_measure(const int *, const double *, const double *, Py_ssize_t, double, double, double *) noexcept


cdef inline void measure(
    int[::1] tail, double[::1] x, double[::1] y, Py_ssize_t n, double sliver, double bound, double[:, ::1] parts
) noexcept:
    vt_measure(&tail[0], &x[0], &y[0], n, sliver, bound, &parts[0, 0])
