"""The motion that the neighbours of a pin predict for it: a local affine map of least squares.

A kernel: compiled by Cython, and the same when it is not.

Idea: over two rings of neighbours the motion of the skin is nearly affine. The map is fitted to the known
neighbours of a pin, weighted by a Gaussian of their distance, and evaluated at the pin; the pin's own motion
does not enter.
"""

# mypy: disable-error-code="attr-defined,no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np

from edge.geometry.lattice import Lattice
from edge.geometry.neighbours import short_rows
from edge.types import Array, Mask

if not cython.compiled:
    #: The predicted motion, px, and the sum of the neighbours' weights.
    Fit = cython.struct(x=cython.double, y=cython.double, support=cython.double)

#: The normal equations of one pin: sums over its known neighbours of weight, offset and motion.
Sums = cython.struct(
    w=cython.double, x=cython.double, y=cython.double,
    xx=cython.double, xy=cython.double, yy=cython.double,
    mx=cython.double, my=cython.double,
    xmx=cython.double, xmy=cython.double, ymx=cython.double, ymy=cython.double,
)  # fmt: skip
#: Weight that keeps the equations solvable where no neighbour is known.
NO_NEIGHBOUR = cython.declare(cython.double, 1e-9)


@cython.cclass
class LocalAffine:
    """The maps of the n pins of one tip.

    lattice  its near (n, k) int32, weight (n, k) >= 0 and offset (n, k, 2) in pitches are used
    ridge    on the gradient, in neighbours' weights: below three neighbours the map turns into a shift
    Raises   ValueError: sizes that do not fit, a neighbour that does not exist
    """

    def __init__(self, lattice: Lattice, ridge: float) -> None:
        n, k = lattice.near.shape
        if lattice.weight.shape != (n, k) or lattice.offset.shape != (n, k, 2):
            raise ValueError(
                f"weight {(n, k)} and offset {(n, k, 2)} are wanted, not {lattice.weight.shape} and "
                f"{lattice.offset.shape}"
            )
        if not n or not k or lattice.near.min() < 0 or lattice.near.max() >= n:
            raise ValueError(f"near: 1 or more neighbours of 0 to {n - 1} are wanted for each pin")
        self.n = n
        self.k = k
        self.near = short_rows(lattice.near)
        self.weight = np.array(lattice.weight, np.float32, order="C")
        self.offset = np.array(lattice.offset, np.float32, order="C")
        self.ridge = ridge

    def predict(self, motion: Array, known: Mask) -> tuple[Array, Array, Array]:
        """Motion of each pin as predicted by its known neighbours.

        motion   (n, 2) float64, px; ignored where not known
        known    (n,) bool
        Returns  (n, 2) motion, px; (n,) sum of the neighbours' weights; (n, 2, 2) gradient, px per pitch:
                 along x, along y
        Raises   ValueError: sizes that do not fit
        """
        moved: cython.const[cython.double][:, ::1] = np.ascontiguousarray(motion, np.float64)
        is_known: cython.const[cython.uchar][::1] = np.ascontiguousarray(known, np.bool_).view(np.uint8)
        n: cython.Py_ssize_t = self.n
        if moved.shape[0] != n or moved.shape[1] != 2 or is_known.shape[0] != n:
            raise ValueError(
                f"motion ({n}, 2) and known ({n},) are wanted, not {motion.shape} and {known.shape}"
            )
        value, support, gradient = np.empty((n, 2)), np.empty(n), np.empty((n, 2, 2))
        _predict_all(self, moved, is_known, value, support, gradient)
        return value, support, gradient

    def matrix(self) -> Array:
        """(n, n) `predict` where all pins are known, as one product; most of it is zero."""
        one, known = np.eye(self.n), np.ones(self.n, np.bool_)
        columns = [self.predict(one[[k, k]].T, known)[0][:, 0] for k in range(self.n)]
        return np.stack(columns, axis=1)

    def fit(
        self,
        motion: cython.const[cython.double][:, ::1],
        known: cython.const[cython.uchar][::1],
        i: cython.Py_ssize_t,
    ) -> Fit:
        """The motion that the known neighbours of pin i predict, and the sum of their weights."""
        return _solve(_sums(self, motion, known, i))


@cython.cfunc
@cython.inline
@cython.exceptval(check=False)
@cython.nogil
def _sums(
    affine: LocalAffine,
    motion: cython.const[cython.double][:, ::1],
    known: cython.const[cython.uchar][::1],
    i: cython.Py_ssize_t,
) -> Sums:
    s: Sums = Sums(NO_NEIGHBOUR, 0, 0, affine.ridge, 0, affine.ridge, 0, 0, 0, 0, 0, 0)
    c: cython.Py_ssize_t
    at: cython.Py_ssize_t
    weight: cython.double
    u: cython.double
    v: cython.double
    x: cython.double
    y: cython.double
    for c in range(affine.k):
        at = affine.near[i, c]
        weight = cython.cast(cython.double, affine.weight[i, c])
        if not known[at] or weight <= 0:
            continue
        u = cython.cast(cython.double, affine.offset[i, c, 0])
        v = cython.cast(cython.double, affine.offset[i, c, 1])
        x = weight * u
        y = weight * v
        s.w += weight
        s.x += x
        s.y += y
        s.xx += x * u
        s.xy += x * v
        s.yy += y * v
        s.mx += weight * motion[at, 0]
        s.my += weight * motion[at, 1]
        s.xmx += x * motion[at, 0]
        s.xmy += x * motion[at, 1]
        s.ymx += y * motion[at, 0]
        s.ymy += y * motion[at, 1]
    return s


@cython.cfunc
@cython.inline
@cython.exceptval(check=False)
@cython.nogil
def _solve(s: Sums) -> Fit:
    """Cramer's rule for the value at the pin itself, where the offset is zero."""
    a: cython.double = s.xx * s.yy - s.xy * s.xy
    b: cython.double = s.xy * s.y - s.x * s.yy
    c: cython.double = s.x * s.xy - s.xx * s.y
    det: cython.double = s.w * a + s.x * b + s.y * c
    return Fit((a * s.mx + b * s.xmx + c * s.ymx) / det, (a * s.my + b * s.xmy + c * s.ymy) / det, s.w)


@cython.cfunc
@cython.exceptval(check=False)
def _predict_all(
    affine: LocalAffine,
    motion: cython.const[cython.double][:, ::1],
    known: cython.const[cython.uchar][::1],
    value: cython.double[:, ::1],
    support: cython.double[::1],
    gradient: cython.double[:, :, ::1],
) -> cython.void:
    i: cython.Py_ssize_t
    s: Sums
    one: Fit
    det: cython.double
    b: cython.double
    c: cython.double
    e: cython.double
    f: cython.double
    g: cython.double
    for i in range(affine.n):
        s = _sums(affine, motion, known, i)
        one = _solve(s)
        value[i, 0] = one.x
        value[i, 1] = one.y
        support[i] = one.support
        b = s.xy * s.y - s.x * s.yy
        c = s.x * s.xy - s.xx * s.y
        det = s.w * (s.xx * s.yy - s.xy * s.xy) + s.x * b + s.y * c
        e = s.x * s.y - s.w * s.xy
        f = s.w * s.yy - s.y * s.y
        g = s.w * s.xx - s.x * s.x
        gradient[i, 0, 0] = (b * s.mx + f * s.xmx + e * s.ymx) / det
        gradient[i, 0, 1] = (b * s.my + f * s.xmy + e * s.ymy) / det
        gradient[i, 1, 0] = (c * s.mx + e * s.xmx + g * s.ymx) / det
        gradient[i, 1, 1] = (c * s.my + e * s.xmy + g * s.ymy) / det
