# cython: infer_types=True
"""Which blob each pin takes: the arithmetic of the search. A kernel: compiled by Cython, and the same when
it is not.

NearestBlob  (h, n, 2) places -> the nearest blob of each; each blob is given to one pin at most
RegionGrower a seed of matched pins -> all pins for which the motion, extrapolated from pin to pin, leads to a
             blob
Kriging      motion of the known pins -> that of each pin as they predict it, with its variance
assign       costs of pins and blobs -> the cheapest assignment
"""

import cython
import numpy as np
from cython.cimports.libc.math import sqrt

from edge.types import Array, Index, Mask

if cython.compiled:
    from cython.cimports.edge.tracking.outliers import LocalAffine
else:
    from edge.tracking.outliers import LocalAffine

HUGE_VAL = cython.declare(cython.double, float("inf"))
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
    all_xy = cython.declare(object, visibility="readonly")  # (m, 2) px
    xy: cython.double[:, ::1]  # the same
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
        self.xy = self.all_xy = np.array(xy, np.float64, order="C")
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
        for h in range(where.shape[0]):
            self._match(where[h], gate, blobs[h], squares[h], has[h])
        return blob, square, matched

    @cython.cfunc
    def _match(
        self,
        at: cython.const[cython.double][:, ::1],
        gate: cython.const[cython.double][::1],
        blob: cython.int[::1],
        square: cython.double[::1],
        matched: cython.uchar[::1],
    ) -> cython.void:
        """Each pin takes the blob nearest to it within its gate; of two with the same blob the nearer."""
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
    def _sweep(
        self,
        blobs: NearestBlob,
        motion: cython.double[:, ::1],
        known: cython.uchar[::1],
        blob: cython.int[::1],
    ) -> cython.void:
        """Every sweep matches all pins anew; pins whose neighbours changed are predicted again before."""
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
    def _has_changed_neighbour(self, i: cython.Py_ssize_t) -> cython.bint:
        for c in range(self.affine.k):  # noqa: SIM110 (no generators in a kernel)
            if self.changed[self.affine.near[i, c]]:
                return True
        return False


@cython.final
@cython.cclass
class Kriging:
    """The motion of each of n pins as predicted from the known ones among the k near it.

    The best linear estimate from all pins near is a constant (kriging with a free affine part). Without the
    unknown ones among them it follows from the inverse of all equations and its block of the unknown: few
    unknown, a small block.

    near      (n, k) int32
    around    (n, k) float64, how much each near pin counts in `square_around`
    inverse   (n, k + 3, k + 3) float64, of the equations where all are known; the last three are the affine
              part
    own_with  (n, k + 3) float64, covariance of each pin with those near it; 1, 0, 0 of the affine part
    own       variance of a pin's motion
    Raises    ValueError: sizes that do not fit, a pin that does not exist
    """

    n: cython.Py_ssize_t
    k: cython.Py_ssize_t
    near: cython.int[:, ::1]
    around: cython.double[:, ::1]
    inverse: cython.double[:, :, ::1]
    own_with: cython.double[:, ::1]
    own: cython.double
    weight: cython.double[:, ::1]  # where all near are known
    place: cython.int[:, ::1]  # of each pin among those that are near to its near pin; -1: not there
    unknown: cython.int[::1]
    block: cython.double[:, ::1]
    given_up: cython.double[::1]

    def __init__(self, near: Index, around: Array, inverse: Array, own_with: Array, own: float) -> None:
        n, k = near.shape
        if around.shape != (n, k) or inverse.shape != (n, k + 3, k + 3) or own_with.shape != (n, k + 3):
            raise ValueError(
                f"around {(n, k)}, inverse {(n, k + 3, k + 3)} and own_with {(n, k + 3)} are wanted, not "
                f"{around.shape}, {inverse.shape}, {own_with.shape}"
            )
        if near.size and (near.min() < 0 or near.max() >= n):
            raise ValueError(f"near: pins of 0 to {n - 1} are wanted")
        self.n, self.k, self.own = n, k, own
        near = np.array(near, np.int32, order="C")  # a mask would choose rows below
        self.near = near
        self.around = np.array(around, np.float64, order="C")
        self.inverse = np.array(inverse, np.float64, order="C")
        self.own_with = np.array(own_with, np.float64, order="C")
        self.weight = np.ascontiguousarray((inverse @ own_with[..., None])[..., 0])
        found = near[near] == np.arange(n)[:, None, None]
        self.place = np.where(found.any(2), found.argmax(2), -1).astype(np.int32)
        self.unknown = np.empty(k, np.int32)
        self.block = np.empty((k, k))
        self.given_up = np.empty(k)

    def weights(self, rows: Index, known: Mask) -> tuple[Array, Array]:
        """(r, k) the weights of the known ones among the near pins (r, k) in the prediction of these pins,
        and (r,) its variance.

        rows    (r,) int32; known (r, k) bool
        Raises  ValueError: sizes that do not fit, a pin that does not exist
        """
        r = len(rows)
        if rows.shape != (r,) or known.shape != (r, self.k):
            raise ValueError(f"rows (r,) and known (r, {self.k}) are wanted, not {rows.shape}, {known.shape}")
        if r and (rows.min() < 0 or rows.max() >= self.n):
            raise ValueError(f"rows: pins of 0 to {self.n - 1} are wanted")
        row: cython.const[cython.int][::1] = np.ascontiguousarray(rows, np.int32)
        is_known: cython.const[cython.uchar][:, ::1] = np.ascontiguousarray(known, np.bool_).view(np.uint8)
        weight, variance = np.empty((r, self.k)), np.empty(r)
        weight_of: cython.double[:, ::1] = weight
        variance_of: cython.double[::1] = variance
        for i in range(row.shape[0]):
            variance_of[i] = self._without_unknown(row[i], is_known[i], weight_of[i])
        return weight, variance

    def predict(self, weight: Array, motion: Array) -> Array:
        """(n, 2) motion of each pin; weight (n, k), motion (n, 2). Raises ValueError: other sizes."""
        if weight.shape != (self.n, self.k) or motion.shape != (self.n, 2):
            raise ValueError(f"weight ({self.n}, {self.k}) and motion ({self.n}, 2) are wanted")
        weight_of: cython.const[cython.double][:, ::1] = np.ascontiguousarray(weight, np.float64)
        moved: cython.const[cython.double][:, ::1] = np.ascontiguousarray(motion, np.float64)
        mean = np.zeros((self.n, 2))
        mean_of: cython.double[:, ::1] = mean
        for i in range(self.n):
            for c in range(self.k):
                mean_of[i, 0] += weight_of[i, c] * moved[self.near[i, c], 0]
                mean_of[i, 1] += weight_of[i, c] * moved[self.near[i, c], 1]
        return mean

    def square_around(self, error: Array, variance: Array, weight: Array, known: Mask) -> tuple[Array, Array]:
        """(n,) sum over the known pins near each of a component's square error against its variance, as it
        would be with the pin itself where it is predicted; and (n,) how many pins that counts as.

        error     (n, 2) of the motion from where it is predicted; variance (n,) of that; meaningless where
                  not known
        weight    (n, k) of the near pins in each prediction; known (n,) bool
        Raises    ValueError: sizes that do not fit
        """
        n = self.n
        if error.shape != (n, 2) or variance.shape != (n,) or known.shape != (n,):
            raise ValueError(f"error ({n}, 2), variance ({n},) and known ({n},) are wanted")
        if weight.shape != (n, self.k):
            raise ValueError(f"weight ({n}, {self.k}) is wanted, not {weight.shape}")
        off: cython.const[cython.double][:, ::1] = np.ascontiguousarray(error, np.float64)
        variance_of: cython.const[cython.double][::1] = np.ascontiguousarray(variance, np.float64)
        weight_of: cython.const[cython.double][:, ::1] = np.ascontiguousarray(weight, np.float64)
        is_known: cython.const[cython.uchar][::1] = np.ascontiguousarray(known, np.bool_).view(np.uint8)
        square, counts = np.zeros(n), np.zeros(n)
        square_of: cython.double[::1] = square
        counts_of: cython.double[::1] = counts
        for i in range(self.n):
            for c in range(self.k):
                at = self.near[i, c]
                if not is_known[at]:
                    continue
                own = weight_of[at, self.place[i, c]] if is_known[i] and self.place[i, c] >= 0 else 0.0
                x = off[at, 0] + own * off[i, 0]
                y = off[at, 1] + own * off[i, 1]
                square_of[i] += self.around[i, c] * (x * x + y * y) / (2.0 * variance_of[at])
                counts_of[i] += self.around[i, c]
        return square, counts

    @cython.cfunc
    def _without_unknown(
        self, i: cython.Py_ssize_t, known: cython.const[cython.uchar][::1], weight: cython.double[::1]
    ) -> cython.double:
        """The weights of pin i, and their variance. The inverse's block of the unknown is positive definite:
        Cholesky's method.
        """
        block: cython.double[:, ::1] = self.block
        up: cython.double[::1] = self.given_up
        unknown: cython.int[::1] = self.unknown
        total: cython.double
        m: cython.Py_ssize_t = 0
        for c in range(self.k):
            if not known[c]:
                unknown[m] = c
                m += 1
        for a in range(m):
            total = self.weight[i, unknown[a]]
            for c in range(a):
                total -= block[a, c] * up[c]
            up[a] = total
            for b in range(a, m):
                total = self.inverse[i, unknown[a], unknown[b]]
                for c in range(a):
                    total -= block[a, c] * block[b, c]
                block[b, a] = sqrt(total) if b == a else total / block[a, a]
            up[a] /= block[a, a]
        for a in range(m - 1, -1, -1):
            total = up[a]
            for b in range(a + 1, m):
                total -= block[b, a] * up[b]
            up[a] = total / block[a, a]
        variance: cython.double = self.own
        for c in range(self.own_with.shape[1]):
            total = self.weight[i, c]
            for a in range(m):
                total -= up[a] * self.inverse[i, unknown[a], c]
            if c < self.k:
                weight[c] = total if known[c] else 0.0
                total = weight[c]
            variance -= total * self.own_with[i, c]
        return variance


def assign(cost: Array) -> Index:
    """(n,) int32, the column of each row; no column twice, the sum of their costs the least that there is.

    One row after the other takes a column; those before it move on along the path that costs least. Prices
    of rows and columns keep all reduced costs at 0 and above, so that path is found as a shortest one
    (Dijkstra).

    cost    (n, m) float64
    Raises  ValueError: fewer columns than rows, a cost that is not finite
    Source  Kuhn, The Hungarian method for the assignment problem, Naval Research Logistics Quarterly 2, 1955;
            Edmonds and Karp, Theoretical improvements in algorithmic efficiency for network flow problems,
            Journal of the ACM 19, 1972
    """
    cost = np.ascontiguousarray(cost, np.float64)
    if cost.ndim != 2 or cost.shape[0] > cost.shape[1] or not np.isfinite(cost).all():
        raise ValueError(f"finite costs (n, m >= n) are wanted, not {cost.shape}")
    n, m = cost.shape
    # The last column is where the search for a row begins.
    row_of, before = np.full(m + 1, -1, np.int32), np.empty(m + 1, np.int32)
    _assign(cost, row_of, before, np.zeros(n), np.zeros(m + 1), np.empty(m + 1), np.empty(m + 1, np.uint8))
    column = np.empty(n, np.int32)
    taken = np.flatnonzero(row_of[:m] >= 0)
    column[row_of[taken]] = taken
    return column


@cython.cfunc
def _assign(
    cost: cython.const[cython.double][:, ::1],
    row_of: cython.int[::1],
    before: cython.int[::1],
    row_price: cython.double[::1],
    column_price: cython.double[::1],
    distance: cython.double[::1],
    reached: cython.uchar[::1],
) -> cython.void:
    """row_of     of each column the row that has it, -1: none
    before     the column before it on the shortest path
    distance   of each column that is not yet reached
    """
    m: cython.Py_ssize_t = cost.shape[1]
    for i in range(cost.shape[0]):
        for j in range(m + 1):
            distance[j] = HUGE_VAL
            reached[j] = False
        at = m
        row_of[m] = i
        while row_of[at] >= 0:
            reached[at] = True
            row = row_of[at]
            next_ = at
            step = HUGE_VAL
            for j in range(m):
                if reached[j]:
                    continue
                reduced = cost[row, j] - row_price[row] - column_price[j]
                if reduced < distance[j]:
                    distance[j] = reduced
                    before[j] = at
                if distance[j] < step:
                    step = distance[j]
                    next_ = j
            for j in range(m + 1):
                if reached[j]:
                    row_price[row_of[j]] += step
                    column_price[j] -= step
                else:
                    distance[j] -= step
            at = next_
        while at != m:
            row_of[at] = row_of[before[at]]
            at = before[at]
