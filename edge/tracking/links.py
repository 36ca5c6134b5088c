"""Which matched pins form one piece: neighbours that move alike. A kernel: compiled by Cython, and the same
when it is not.
"""

# mypy: disable-error-code="attr-defined,no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np

from edge.types import Array, Index, Mask


@cython.final
@cython.cclass
class Links:
    """Pairs of the n pins that are linked where their motion differs little.

    pairs              (p, 2) pins
    max_difference_px  (p,) float64
    Raises             ValueError: sizes that do not fit, a pin that does not exist
    """

    n: cython.Py_ssize_t
    pairs: cython.int[:, ::1]
    limit: cython.double[::1]

    def __init__(self, n: int, pairs: Index, max_difference_px: Array) -> None:
        if pairs.shape != (len(pairs), 2) or max_difference_px.shape != (len(pairs),):
            raise ValueError(
                f"pairs (p, 2) and a limit for each are wanted, not {pairs.shape}, {max_difference_px.shape}"
            )
        if len(pairs) and (pairs.min() < 0 or pairs.max() >= n):
            raise ValueError(f"pairs: pins of 0 to {n - 1} are wanted, not {pairs.min()} to {pairs.max()}")
        self.n = n
        self.pairs = np.array(pairs, np.int32, order="C")
        self.limit = np.array(max_difference_px, np.float64)

    def pieces(self, motion: Array, known: Mask) -> Index:
        """(n,) int32, one pin of the piece that each known pin belongs to; itself where it is unknown.

        motion  (n, 2) float64, px; known (n,) bool
        Raises  ValueError: sizes that do not fit
        """
        if motion.shape != (self.n, 2) or known.shape != (self.n,):
            raise ValueError(
                f"motion ({self.n}, 2) and known ({self.n},) are wanted, not {motion.shape} and {known.shape}"
            )
        label = np.arange(self.n, dtype=np.int32)
        self._join(np.ascontiguousarray(motion, np.float64), known.astype(np.uint8), label)
        return label

    def largest_piece(self, motion: Array, known: Mask) -> Mask:
        """(n,) the known pins of the largest piece; as `pieces`."""
        label = self.pieces(motion, known)
        return np.asarray(label == np.bincount(label[known], minlength=1).argmax()) if known.any() else known

    @cython.cfunc
    @cython.exceptval(check=False)
    def _join(
        self, motion: cython.const[cython.double][:, ::1], known: cython.uchar[::1], label: cython.int[::1]
    ) -> cython.void:
        c: cython.Py_ssize_t
        a: cython.Py_ssize_t
        b: cython.Py_ssize_t
        dx: cython.double
        dy: cython.double
        for c in range(self.pairs.shape[0]):
            a = self.pairs[c, 0]
            b = self.pairs[c, 1]
            if not known[a] or not known[b]:
                continue
            dx = motion[a, 0] - motion[b, 0]
            dy = motion[a, 1] - motion[b, 1]
            if dx * dx + dy * dy < self.limit[c] * self.limit[c]:
                a = _root(label, a)
                label[a] = _root(label, b)
        for a in range(self.n):
            label[a] = _root(label, a)


@cython.cfunc
@cython.inline
@cython.exceptval(check=False)
def _root(label: cython.int[::1], i: cython.Py_ssize_t) -> cython.int:
    while label[i] != i:
        label[i] = label[label[i]]
        i = label[i]
    return i
