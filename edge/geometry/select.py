"""Order statistics without sorting: Hoare's selection. A kernel; other kernels import it through
`select.pxd`.
"""

from __future__ import annotations

import cython

from edge.types import Array

if cython.compiled:
    from cython.cimports.libc.math import NAN
else:
    from math import nan as NAN  # noqa: N812


#: The median absolute deviation of normal noise, times this, is its standard deviation.
SIGMA_OF_MAD = 1.4826


def kth_smallest(values: Array, k: int) -> float:
    """k-th smallest, from 0, of values (n,) float64 without NaN; reorders them.

    Raises  ValueError: no such k
    """
    if not 0 <= k < len(values):
        raise ValueError(f"the {k}-th of {len(values)} values: k must be 0 to {len(values) - 1}")
    smallest: float = select_kth(values, len(values), k)
    return smallest


def select_kth(v: cython.double[::1], n: cython.Py_ssize_t, k: cython.Py_ssize_t) -> cython.double:
    """k-th smallest of the first n > k; then none before place k is larger, none behind it smaller."""
    low: cython.Py_ssize_t = 0
    high: cython.Py_ssize_t = n - 1
    i: cython.Py_ssize_t
    j: cython.Py_ssize_t
    pivot: cython.double
    swap: cython.double
    while low < high:
        pivot = v[(low + high) // 2]
        i = low
        j = high
        while i <= j:
            while v[i] < pivot:
                i += 1
            while v[j] > pivot:
                j -= 1
            if i <= j:
                swap = v[i]
                v[i] = v[j]
                v[j] = swap
                i += 1
                j -= 1
        if k <= j:
            high = j
        elif k >= i:
            low = i
        else:
            break
    return v[k]


def median(v: cython.double[::1], n: cython.Py_ssize_t) -> cython.double:
    """Median of the first n, the mean of the middle two if n is even; reorders them. NaN of none."""
    if n == 0:
        return NAN
    k: cython.Py_ssize_t = n // 2
    i: cython.Py_ssize_t
    middle: cython.double = select_kth(v, n, k)
    if n % 2 == 1:
        return middle
    below: cython.double = v[0]
    for i in range(1, k):
        if v[i] > below:
            below = v[i]
    return 0.5 * (below + middle)
