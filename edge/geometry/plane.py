"""Least-squares planes through two components at once. A kernel with `plane.pxd`."""

# mypy: disable-error-code="valid-type"

from __future__ import annotations

import cython


def solve_plane(g: cython.double[:, ::1]) -> cython.void:
    """Gauss-Jordan on the normal equations of a plane, in place.

    g  (3, 5) float64: in columns 0 to 2 the symmetric positive matrix, of which only the upper triangle is
       read, in columns 3 and 4 two right sides, which become the coefficients of 1, x and y for each
    """
    r: cython.Py_ssize_t
    c: cython.Py_ssize_t
    row: cython.Py_ssize_t
    pivot: cython.double
    factor: cython.double
    g[1, 0] = g[0, 1]
    g[2, 0] = g[0, 2]
    g[2, 1] = g[1, 2]
    for r in range(3):
        pivot = g[r, r]
        for c in range(r, 5):
            g[r, c] /= pivot
        for row in range(3):
            if row != r:
                factor = g[row, r]
                for c in range(r, 5):
                    g[row, c] -= factor * g[r, c]
