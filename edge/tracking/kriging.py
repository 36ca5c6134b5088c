"""The motion of each pin as predicted from the known ones near. A kernel: compiled by Cython, and the same
when it is not.

Idea: the best linear estimate from all pins near is a constant (kriging with a free affine part). Without the
unknown ones among them it follows from the inverse of all equations and its block of the unknown: few
unknown, a small block.
"""

# mypy: disable-error-code="attr-defined,no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np

from edge.types import Array, Index, Mask

if cython.compiled:
    from cython.cimports.libc.math import sqrt
else:
    from math import sqrt


@cython.final
@cython.cclass
class Kriging:
    """The equations of n pins, each from k near ones.

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
        i: cython.Py_ssize_t
        for i in range(row.shape[0]):
            variance_of[i] = self._without_unknown(row[i], is_known[i], weight_of[i])
        return weight, variance

    def predict(self, weight: Array, motion: Array) -> Array:
        """(n, 2) motion of each pin; weight (n, k), motion (n, 2).

        Raises  ValueError: sizes that do not fit
        """
        if weight.shape != (self.n, self.k) or motion.shape != (self.n, 2):
            raise ValueError(f"weight ({self.n}, {self.k}) and motion ({self.n}, 2) are wanted")
        weight_of: cython.const[cython.double][:, ::1] = np.ascontiguousarray(weight, np.float64)
        moved: cython.const[cython.double][:, ::1] = np.ascontiguousarray(motion, np.float64)
        mean = np.zeros((self.n, 2))
        mean_of: cython.double[:, ::1] = mean
        i: cython.Py_ssize_t
        c: cython.Py_ssize_t
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
        i: cython.Py_ssize_t
        c: cython.Py_ssize_t
        at: cython.Py_ssize_t
        own: cython.double
        x: cython.double
        y: cython.double
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
    @cython.exceptval(check=False)
    def _without_unknown(
        self,
        i: cython.Py_ssize_t,
        known: cython.const[cython.uchar][::1],
        weight: cython.double[::1],
    ) -> cython.double:
        """The weights of pin i, and their variance. The inverse's block of the unknown is positive definite:
        Cholesky's method.
        """
        block: cython.double[:, ::1] = self.block
        up: cython.double[::1] = self.given_up
        unknown: cython.int[::1] = self.unknown
        a: cython.Py_ssize_t
        b: cython.Py_ssize_t
        c: cython.Py_ssize_t
        m: cython.Py_ssize_t = 0
        total: cython.double
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
