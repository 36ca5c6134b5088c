# cython: infer_types=True
"""Order statistics without sorting. A kernel; other kernels import it through `select.pxd`."""

import cython

INFINITY = cython.declare(cython.double, float("inf"))
NAN = cython.declare(cython.double, float("nan"))

#: The median absolute deviation of normal noise, times this, is its standard deviation.
SIGMA_OF_MAD = 1.4826
_SIGMA_OF_MAD = cython.declare(cython.double, SIGMA_OF_MAD)


def select_kth(v: cython.double[::1], n: cython.Py_ssize_t, k: cython.Py_ssize_t) -> cython.double:
    """k-th smallest of the first n > k, which change places: none before it is larger then, none behind it
    smaller.

    Source  Hoare, Algorithm 65: Find; Floyd and Rivest, Algorithm 489: Select; Communications of the ACM 4,
            1961, and 18, 1975
    """
    _select(v, 0, n - 1, k)
    return v[k]


@cython.cfunc
@cython.nogil
@cython.exceptval(check=False)
def _select(
    v: cython.double[::1], low: cython.Py_ssize_t, high: cython.Py_ssize_t, k: cython.Py_ssize_t
) -> cython.void:
    """The same of v[low] to v[high]."""
    while low < high:
        few = (high - low) // 16
        if few > 4:  # whose k-th is nearer to that of all than any one of them
            i = k - few * (k - low) // (high - low)
            _select(v, i, i + few, k)
        pivot = v[k]
        i = low
        j = high
        while i <= j:
            while v[i] < pivot:
                i += 1
            while pivot < v[j]:
                j -= 1
            if i <= j:
                v[i], v[j] = v[j], v[i]
                i += 1
                j -= 1
        if j < k:
            low = i
        if k < i:
            high = j


def median(v: cython.double[::1], n: cython.Py_ssize_t) -> cython.double:
    """Median of the first n, which change places; the mean of the middle two if n is even. NaN of none."""
    if n == 0:
        return NAN
    below: cython.double = -INFINITY  # the largest of those before the middle
    middle: cython.double = select_kth(v, n, n // 2)
    if n % 2 == 1:
        return middle
    for i in range(n // 2):
        below = max(below, v[i])
    return 0.5 * (below + middle)


def sigma_of(v: cython.double[::1], n: cython.Py_ssize_t) -> cython.double:
    """Standard deviation of normal noise, by the first n of its sizes, which change places."""
    return _SIGMA_OF_MAD * median(v, n)
