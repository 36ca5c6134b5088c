cdef double select_kth(double[::1] v, Py_ssize_t n, Py_ssize_t k) noexcept nogil
cdef double median(double[::1] v, Py_ssize_t n) noexcept nogil
cdef double sigma_of(double[::1] v, Py_ssize_t n) noexcept nogil
