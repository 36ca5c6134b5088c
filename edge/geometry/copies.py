"""Copies, for results, of arrays that every frame writes anew, and the memory of such arrays.

A kernel; others import it by `copies.pxd`.

Idea: a result keeps its arrays for as long as somebody holds them. Nearly all are let go with the next frame,
or a few later, and then another copy is written to the same memory: to make an array and to let it go takes
3,000 instructions.
"""

import cython
import numpy as np

from edge.types import Array

if cython.compiled:
    from cython.cimports.cpython.ref import Py_REFCNT as references_to
    from cython.cimports.libc.string import memcpy
else:
    from sys import getrefcount as references_to

    def numbers_of(array: Array, n: int, are_complex: bool = False) -> Array:
        """The n float64 of an array, or n complex128 as their parts in turn; a typed memoryview takes 1,300
        instructions more. Raises ValueError: another array
        """
        if array.size != n or array.dtype != (np.complex128 if are_complex else np.float64):
            raise ValueError(f"an array of {n} numbers is wanted")
        return np.ascontiguousarray(array).reshape(-1).view(np.float64)


@cython.final
@cython.cclass
class _Copy:
    def __init__(self, source: Array) -> None:
        self.array = np.empty_like(source)
        self.memory = _bytes_of(self.array)
        self.own_n = references_to(self.array)

    def is_held(self) -> bool:
        """Whether anybody else refers to the array, or to a part of it."""
        n: cython.Py_ssize_t = references_to(self.array)
        return n > self.own_n


@cython.final
@cython.cclass
class Copies:
    """Copies of one C-contiguous array of any type, of which n or n - 1 are held at a time as a rule.

    Raises ValueError: it is none, or 256 are held or more
    """

    def __init__(self, source: Array, n: int = 2) -> None:
        if not source.flags.c_contiguous or n >= 256:
            raise ValueError(f"a C-contiguous array is wanted, not {source.strides} for {source.shape}; {n=}")
        self._array, self._source = source, _bytes_of(source)
        self._copies = [_Copy(source) for _ in range(n)]

    def take(self) -> Array:
        """What the array holds now; it stays as it is for as long as somebody holds it."""
        copy: _Copy
        for copy in self._copies:
            if not copy.is_held():
                break
        else:
            copy = _Copy(self._array)
            self._copies = [*self._copies[1:], copy]
        if cython.compiled and self._source.shape[0] > 0:
            memcpy(cython.address(copy.memory[0]), cython.address(self._source[0]), self._source.shape[0])
        else:
            copy.memory[:] = self._source
        return copy.array


def _bytes_of(array: Array) -> Array:
    return array.reshape(-1).view(np.uint8)
