"""Version and fields of a sample, as they lie in its 64-byte frame, in a sixth of the time that Python takes.

A kernel (`CONTRIBUTING.md`, "Kernels"). It packs the numbers that `hostlink.wire.state.quantise` gives, by
the same table of fields; that function explains the rules.
"""

from typing import Any

import cython
import numpy as np

from hostlink.wire.fields import SCHEMA

if cython.compiled:
    from cython.cimports.cpython.long import PyLong_AsUnsignedLongLongMask as low_bits
    from cython.cimports.libc.math import NAN, isnan, rint
else:
    from math import isnan
    from math import nan as NAN  # noqa: N812

    rint = round

    def low_bits(number: int) -> int:
        return number & 0xFFFF_FFFF


@cython.cclass
class StatePacker:
    """Packs one sample after the other."""

    plain: cython.uchar[::1]
    place: cython.int[::1]  # of each field but the contacts' in the table
    step: cython.double[::1]
    low: cython.double[::1]
    high: cython.double[::1]
    raw_low: cython.longlong[::1]
    raw_high: cython.longlong[::1]
    raw_nan: cython.longlong[::1]
    size: cython.int[::1]  # bytes
    mask: cython.longlong[::1]
    values: cython.double[::1]
    raws: cython.longlong[::1]
    body: cython.uchar[::1]
    memory: bytearray
    places: cython.Py_ssize_t  # of the contacts' fields, from here up to there
    behind: cython.Py_ssize_t
    count: cython.Py_ssize_t

    def __init__(self) -> None:
        rows = SCHEMA.layout
        self.plain = np.array([f.plain for f in rows], np.uint8)
        self.step, self.low, self.high = (
            np.array([getattr(f, name) for f in rows], np.float64) for name in ("scale", "low", "high")
        )
        self.raw_low, self.raw_high = (
            np.array([getattr(f, name) for f in rows], np.int64) for name in ("raw_low", "raw_high")
        )
        self.raw_nan = np.array([f.raw_nan(8 * f.size) for f in rows], np.int64)
        self.size = np.array([f.size for f in rows], np.int32)
        self.mask = np.array([(1 << 8 * f.size) - 1 for f in rows])
        self.values, self.raws = np.empty(len(rows)), np.empty(len(rows), np.int64)
        self.memory = bytearray(SCHEMA.body.size)
        self.body = self.memory
        self.body[0] = SCHEMA.version
        self.place = np.array([i for i, f in enumerate(rows) if not f.contact], np.int32)
        names = [f.name for f in rows]
        self.places, self.count = names.index("contact0_x_mm"), names.index("contact_n")
        self.behind = self.places + sum(f.contact for f in rows)

    def pack(self, values: dict[str, Any]) -> bytes:
        """values  `vars(State(...))`: all fields in the order of the table, then the contacts."""
        n: cython.Py_ssize_t
        i: cython.Py_ssize_t
        k: cython.Py_ssize_t
        at: cython.Py_ssize_t = 1
        raw: cython.longlong
        for n, given in enumerate(values.values()):
            if n == self.place.shape[0]:
                break
            i = self.place[n]
            if self.plain[i]:
                self.raws[i] = low_bits(given) & self.mask[i]
            else:
                self.values[i] = given
        placed: cython.longlong = self._place(values["contacts"])
        self.raws[self.count] = min(max(values["contact_n"], placed), self.raw_high[self.count])
        for i in range(self.size.shape[0]):
            raw = self.raws[i] if self.plain[i] else self._quantise(i)
            for k in range(self.size[i]):
                self.body[at + k] = raw >> 8 * k & 0xFF
            at += self.size[i]
        return bytes(self.memory)

    @cython.cfunc
    def _quantise(self, i: cython.Py_ssize_t) -> cython.longlong:
        value: cython.double = self.values[i]
        if isnan(value):
            return self.raw_nan[i]
        if value >= self.high[i]:
            return self.raw_high[i]
        if value <= self.low[i]:
            return self.raw_low[i]
        return cython.cast(cython.longlong, rint(value / self.step[i]))

    @cython.cfunc
    def _place(self, contacts: tuple[Any, ...]) -> cython.longlong:
        """Write the contacts that have a place; how many they are."""
        n: cython.longlong = 0
        at: cython.Py_ssize_t
        for at in range(self.places, self.behind):
            self.values[at] = NAN
        for contact in contacts:
            x: cython.double = contact.x_mm
            y: cython.double = contact.y_mm
            if not (isnan(x) or isnan(y)):
                at = self.places + 3 * n
                self.values[at], self.values[at + 1], self.values[at + 2] = x, y, contact.depth_mm
                n += 1
        return n
