"""Order statistics without sorting. A kernel; other kernels import it through `select.pxd`."""

from __future__ import annotations

import cython

from edge.types import Array

if cython.compiled:
    from cython.cimports.edge.geometry.counting import kth
    from cython.cimports.libc.math import INFINITY, NAN
else:
    from math import inf as INFINITY  # noqa: N812
    from math import nan as NAN  # noqa: N812

    from edge.geometry.counting import kth


#: The median absolute deviation of normal noise, times this, is its standard deviation.
SIGMA_OF_MAD = 1.4826


def kth_smallest(values: Array, k: int) -> float:
    """k-th smallest, from 0, of values (n,) float64 without NaN.

    Raises  ValueError: no such k
    """
    if not 0 <= k < len(values):
        raise ValueError(f"the {k}-th of {len(values)} values: k must be 0 to {len(values) - 1}")
    smallest: float = select_kth(values, len(values), k)
    return smallest


def select_kth(v: cython.double[::1], n: cython.Py_ssize_t, k: cython.Py_ssize_t) -> cython.double:
    """k-th smallest of the first n > k."""
    return kth(v, n, k)


def median(v: cython.double[::1], n: cython.Py_ssize_t) -> cython.double:
    """Median of the first n, the mean of the middle two if n is even. NaN of none."""
    if n == 0:
        return NAN
    i: cython.Py_ssize_t
    below_n: cython.Py_ssize_t = 0
    below: cython.double = -INFINITY  # the largest of those
    middle: cython.double = kth(v, n, n // 2)
    if n % 2 == 1:
        return middle
    for i in range(n):
        below_n += v[i] < middle
        below = max(below, v[i] if v[i] < middle else -INFINITY)
    return 0.5 * ((below if below_n == n // 2 else middle) + middle)
