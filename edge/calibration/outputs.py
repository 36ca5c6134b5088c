"""What the models of a calibration gave, read by name or by place. Compiled; runs uncompiled too.

A frame reads a dozen numbers so, one by one: an array's own reading and a call for each name cost more than
the models do.
"""

# mypy: disable-error-code="untyped-decorator,valid-type"

from __future__ import annotations

from collections.abc import Sequence

import cython
import numpy as np

if cython.compiled:
    from cython.cimports.libc.math import isfinite
else:
    from math import isfinite

#: Of each output: value, sigma, whether the model is out of its range (0 or 1).
FIELDS = 3
_NONE: frozenset[str] = frozenset()


@cython.cclass
class OutputRow:
    """Outputs of models, in the same memory again and again.

    names  of the n outputs
    rows   (n, FIELDS) float64, to be written by models
    """

    names = cython.declare(tuple, visibility="readonly")
    rows = cython.declare(object, visibility="readonly")
    _numbers: cython.double[:, ::1]  # the same memory

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        self.rows = self._numbers = np.zeros((len(self.names), FIELDS))

    def by_name(self) -> tuple[dict[str, float], dict[str, float], frozenset[str]]:
        """Values and sigmas, and the names of the known values that are out of range; all new."""
        values: dict[str, float] = {}
        sigmas: dict[str, float] = {}
        outside = _NONE
        i: cython.Py_ssize_t
        for i in range(self._numbers.shape[0]):
            name = self.names[i]
            values[name] = self._numbers[i, 0]
            sigmas[name] = self._numbers[i, 1]
            if self._numbers[i, 2] != 0.0 and isfinite(self._numbers[i, 0]):
                outside |= {name}
        return values, sigmas, outside

    def write_into(self, numbers: list[float], places: Sequence[int]) -> None:
        """Set the value of each output to its place in `numbers`.

        Raises  ValueError: another number of places, or one beyond
        """
        i: cython.Py_ssize_t
        place: cython.Py_ssize_t
        if len(places) != self._numbers.shape[0]:
            raise ValueError(f"places of {self._numbers.shape[0]} outputs are wanted, not of {len(places)}")
        for i in range(self._numbers.shape[0]):
            place = places[i]
            if not 0 <= place < len(numbers):
                raise ValueError(f"places of 0 to {len(numbers) - 1} are wanted, not {place}")
            numbers[place] = self._numbers[i, 0]
