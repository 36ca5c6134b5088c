cdef void solve_plane(double[:, ::1] g) noexcept nogil
