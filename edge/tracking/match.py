"""Which blob each pin takes: the arithmetic of the search. A kernel: compiled by Cython, and the same when
it is not.

NearestBlob  (h, n, 2) places -> the nearest blob of each; each blob is given to one pin at most
RegionGrower a seed of matched pins -> all pins for which the motion, extrapolated from pin to pin, leads to a
             blob
"""

# mypy: disable-error-code="attr-defined,no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np

from edge.types import Array, Index, Mask

if cython.compiled:
    from cython.cimports.edge.tracking.affine import Fit, LocalAffine
else:
    from edge.tracking.affine import Fit, LocalAffine

UNMATCHED = cython.declare(cython.int, -1)
SEED = cython.declare(cython.int, -2)


@cython.final
@cython.cclass
class NearestBlob:
    """Nearest blob to a point by a raster: exact to one cell, in constant time.

    xy           (m, 2) float64, px, finite; m >= 1
    table        (rows, columns) int32, the blob nearest to each cell's centre
    origin_px    (2,) x and y of the first cell's centre
    cells_per_px
    Raises       ValueError: sizes that do not fit, a blob that does not exist
    """

    n_blobs: cython.Py_ssize_t
    xy: cython.double[:, ::1]
    table: cython.int[:, ::1]
    left: cython.double
    top: cython.double
    cells_per_px: cython.double
    owner: cython.int[::1]  # (m,) the pin that has the blob

    def __init__(self, xy: Array, table: Index, origin_px: tuple[float, float], cells_per_px: float) -> None:
        m = len(xy)
        if xy.shape != (m, 2) or table.ndim != 2 or not m or not table.size:
            raise ValueError(f"1 or more blobs (m, 2) and a table are wanted, not {xy.shape}, {table.shape}")
        if table.min() < 0 or table.max() >= m:
            raise ValueError(f"table: blobs of 0 to {m - 1} are wanted, not {table.min()} to {table.max()}")
        if not (np.isfinite(origin_px).all() and np.isfinite(cells_per_px)):
            raise ValueError(f"finite origin and cells per px are wanted, not {origin_px}, {cells_per_px}")
        self.n_blobs = m
        self.xy = np.array(xy, np.float64, order="C")
        self.table = np.array(table, np.int32, order="C")
        self.left, self.top = origin_px
        self.cells_per_px = cells_per_px
        self.owner = np.empty(m, np.int32)

    def match(self, at: Array, gate_px: Array) -> tuple[Index, Array, Mask]:
        """The nearest blob of each pin of each hypothesis.

        at       (h, n, 2) float64, px; gate_px (n,) float64
        Returns  (h, n) int32 blob; (h, n) float64 its squared distance, px2; (h, n) bool, whether the pin
                 has it: it is within the gate, and no other pin of the hypothesis is nearer to it
        Raises   ValueError: sizes that do not fit
        """
        where: cython.const[cython.double][:, :, ::1] = np.ascontiguousarray(at, np.float64)
        gate: cython.const[cython.double][::1] = np.ascontiguousarray(gate_px, np.float64)
        shape = (where.shape[0], where.shape[1])
        if where.shape[2] != 2 or gate.shape[0] != where.shape[1]:
            raise ValueError(f"at (h, n, 2) and gate (n,) are wanted, not {at.shape} and {gate_px.shape}")
        blob, square, matched = np.empty(shape, np.int32), np.empty(shape), np.empty(shape, np.bool_)
        blobs: cython.int[:, ::1] = blob
        squares: cython.double[:, ::1] = square
        has: cython.uchar[:, ::1] = matched.view(np.uint8)
        h: cython.Py_ssize_t
        for h in range(where.shape[0]):
            self._match(where[h], gate, blobs[h], squares[h], has[h])
        return blob, square, matched

    @cython.cfunc
    @cython.exceptval(check=False)
    def _match(
        self,
        at: cython.const[cython.double][:, ::1],
        gate: cython.const[cython.double][::1],
        blob: cython.int[::1],
        square: cython.double[::1],
        matched: cython.uchar[::1],
    ) -> cython.void:
        """Each pin takes the blob nearest to it within its gate; of two with the same blob the nearer."""
        i: cython.Py_ssize_t
        j: cython.Py_ssize_t
        other: cython.Py_ssize_t
        dx: cython.double
        dy: cython.double
        for j in range(self.n_blobs):
            self.owner[j] = UNMATCHED
        for i in range(at.shape[0]):
            j = self._nearest(at[i, 0], at[i, 1])
            blob[i] = j
            dx = self.xy[j, 0] - at[i, 0]
            dy = self.xy[j, 1] - at[i, 1]
            square[i] = dx * dx + dy * dy
            matched[i] = square[i] < gate[i] * gate[i]
            if not matched[i]:
                continue
            other = self.owner[j]
            if other >= 0 and square[other] <= square[i]:
                matched[i] = False
            else:
                if other >= 0:
                    matched[other] = False
                self.owner[j] = i

    @cython.cfunc
    @cython.inline
    @cython.exceptval(check=False)
    def _nearest(self, x: cython.double, y: cython.double) -> cython.Py_ssize_t:
        column: cython.double = (x - self.left) * self.cells_per_px
        row: cython.double = (y - self.top) * self.cells_per_px
        column = column if column > 0 else 0  # NaN too
        row = row if row > 0 else 0
        column = min(column, cython.cast(cython.double, self.table.shape[1] - 1))
        row = min(row, cython.cast(cython.double, self.table.shape[0] - 1))
        return self.table[
            cython.cast(cython.Py_ssize_t, row + 0.5), cython.cast(cython.Py_ssize_t, column + 0.5)
        ]


@cython.final
@cython.cclass
class RegionGrower:
    """Grows a match from pin to pin, over one tip.

    rest_xy      (n, 2) float64, px
    gate_px      (n,) float64, how far from its prediction a pin's blob may be
    support_min  sum of the weights of the neighbours that a prediction needs
    sweeps_max   over all pins
    Raises       ValueError: sizes that do not fit
    """

    n: cython.Py_ssize_t
    affine: LocalAffine
    rest: cython.double[:, ::1]
    gate: cython.double[::1]
    support_min: cython.double
    sweeps_max: cython.int
    at: cython.double[:, ::1]
    open_gate: cython.double[::1]
    square: cython.double[::1]
    before: cython.int[::1]
    changed: cython.uchar[::1]

    def __init__(
        self, affine: LocalAffine, rest_xy: Array, gate_px: Array, support_min: float, sweeps_max: int
    ) -> None:
        n = len(rest_xy)
        if affine.n != n or rest_xy.shape != (n, 2) or gate_px.shape != (n,):
            raise ValueError(
                f"rest_xy ({affine.n}, 2) and gate_px ({affine.n},) are wanted, not {rest_xy.shape} and "
                f"{gate_px.shape}"
            )
        self.n = n
        self.affine = affine
        self.rest = np.array(rest_xy, np.float64, order="C")
        self.gate = np.array(gate_px, np.float64)
        self.support_min = support_min
        self.sweeps_max = sweeps_max
        self.at = np.zeros((n, 2))
        self.open_gate = np.zeros(n)
        self.square = np.empty(n)
        self.before = np.empty(n, np.int32)
        self.changed = np.empty(n, np.uint8)

    def grow(self, blobs: NearestBlob, motion: Array, seed: Mask) -> tuple[Index, Array, Mask]:
        """The match that grows from a seed.

        motion   (n, 2) float64, px, of the pins of the seed; seed (n,) bool
        Returns  (n,) int32 blob, (n, 2) its motion, px, and (n,) bool, whether the pin has it
        Raises   ValueError: sizes that do not fit
        """
        moved, known = np.array(motion, np.float64, order="C"), np.array(seed, np.bool_)
        if moved.shape != (self.n, 2) or known.shape != (self.n,):
            raise ValueError(
                f"motion ({self.n}, 2) and seed ({self.n},) are wanted, not {moved.shape} and {known.shape}"
            )
        blob = np.zeros(self.n, np.int32)
        self._sweep(blobs, moved, known.view(np.uint8), blob)
        return blob, moved, known

    @cython.cfunc
    @cython.exceptval(check=False)
    def _sweep(
        self,
        blobs: NearestBlob,
        motion: cython.double[:, ::1],
        known: cython.uchar[::1],
        blob: cython.int[::1],
    ) -> cython.void:
        """Every sweep matches all pins anew; pins whose neighbours changed are predicted again before."""
        i: cython.Py_ssize_t
        now: cython.int
        sweep: cython.int
        fit: Fit
        moving: cython.bint
        for i in range(self.n):
            self.before[i] = SEED if known[i] else UNMATCHED
            self.changed[i] = True
        for sweep in range(self.sweeps_max):
            for i in range(self.n):
                if sweep > 0 and not self._has_changed_neighbour(i):
                    continue
                fit = self.affine.fit(motion, known, i)
                self.open_gate[i] = self.gate[i] if fit.support > self.support_min else 0
                self.at[i, 0] = self.rest[i, 0] + fit.x
                self.at[i, 1] = self.rest[i, 1] + fit.y
            blobs._match(self.at, self.open_gate, blob, self.square, known)
            moving = False
            for i in range(self.n):
                now = blob[i] if known[i] else UNMATCHED
                self.changed[i] = now != self.before[i]
                moving |= self.changed[i]
                self.before[i] = now
                motion[i, 0] = blobs.xy[blob[i], 0] - self.rest[i, 0]
                motion[i, 1] = blobs.xy[blob[i], 1] - self.rest[i, 1]
            if not moving:
                break

    @cython.cfunc
    @cython.inline
    @cython.exceptval(check=False)
    def _has_changed_neighbour(self, i: cython.Py_ssize_t) -> cython.bint:
        c: cython.Py_ssize_t
        for c in range(self.affine.k):  # noqa: SIM110 (no generators in a kernel)
            if self.changed[self.affine.near[i, c]]:
                return True
        return False
