"""Peaks of a field on a grid, and which of them are connected above a level.

    field --regional maxima--> those above the noise, highest first --valleys--> connected or separate

Rules
- Regional maxima with plateaus, as MATLAB's `imregionalmax` and `skimage.morphology.local_maxima` have them:
  connected grid points (8 neighbours) of one height, all of whose other neighbours are lower.
- The grid has a border of -inf, so that every point has eight neighbours and no search leaves it.

A kernel: compiled by Cython (see setup.py), and the same when it is not; other kernels import it through
`peaks.pxd`.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import cython
import numpy as np

from edge.types import Heights, Index, Mask

#: The size of the tables of peaks.
PEAKS_MAX = 24

_PEAKS_MAX = cython.declare(cython.Py_ssize_t, PEAKS_MAX)
_NOTHING = cython.declare(cython.float, -np.inf)
_LOWEST = cython.declare(cython.float, float(np.finfo(np.float32).min))
# Marks of a point.
_UNKNOWN = cython.declare(cython.schar, 0)
_SLOPE = cython.declare(cython.schar, 1)
_TOP = cython.declare(cython.schar, 2)
_PLATEAU = cython.declare(cython.schar, 3)  # visited, not decided yet
_REACHED = cython.declare(cython.schar, 4)  # and upwards: reached from peak 0, 1, ...


@cython.final
@cython.cclass
class PeakFinder:
    """Peaks on the points of a grid; k points. All arrays are good until the next field.

    width    points of a padded row: point p lies in column place[p] % width, row place[p] // width
    place    (k,) int32, where in the padded grid each point lies
    grid     (h * width,) float32, the field, -inf outside
    active   (k,) int32, the first n_active: points at which the field may be other than zero, ascending
    mark     (h * width,) int8, scratch
    n_peaks  of the last field; at (PEAKS_MAX,) int32, place of each, highest first;
             point (PEAKS_MAX,) int32, which of the k points it is; height (PEAKS_MAX,) float32

    inside   (rows, columns) bool: the k points, row by row
    """

    def __init__(self, inside: Mask) -> None:
        padded = np.pad(inside, 1)
        self.width = padded.shape[1]
        self.place = np.flatnonzero(padded).astype(np.int32)
        self.grid = np.full(padded.size, -np.inf, np.float32)
        self.mark, self._stack = np.zeros(padded.size, np.int8), np.empty(padded.size, np.int32)
        self.active = np.arange(len(self.place), dtype=np.int32)
        self.n_active = len(self.place)  # of no field yet: its first one is written everywhere
        self.at, self.point = np.zeros(PEAKS_MAX, np.int32), np.zeros(PEAKS_MAX, np.int32)
        self.height, self._level = np.zeros(PEAKS_MAX, np.float32), np.zeros(PEAKS_MAX, np.float32)
        self._all_points = np.arange(len(self.place), dtype=np.int32)
        self.n_peaks = 0
        w = self.width
        self._around = np.array([-w - 1, -w, -w + 1, -1, 1, w - 1, w, w + 1], np.int32)

    def set_field(self, field: Heights, active: Index | None = None, n_active: cython.Py_ssize_t = 0) -> None:
        """The field (k,) float32 at the points, row by row.

        active   (n_active or more,) int32, points, ascending; elsewhere the field is zero. None: nowhere
        """
        i: cython.Py_ssize_t
        place: cython.int[::1] = self.place
        grid: cython.float[::1] = self.grid
        mine: cython.int[::1] = self.active
        if active is None:
            active, n_active = self._all_points, place.shape[0]
        for i in range(self.n_active):
            grid[place[mine[i]]] = 0.0
        for i in range(n_active):
            mine[i] = active[i]
            grid[place[active[i]]] = field[active[i]]
        self.n_active = n_active

    def mark_maxima(self) -> Mask:
        """(k,) bool, which points are regional maxima."""
        self.mark[:] = _UNKNOWN
        return np.array([self._is_maximum(place) for place in self.place], np.bool_)

    def find(self, noise: Heights, noise_factor: cython.float, least: cython.float) -> cython.Py_ssize_t:
        """Find the peaks, of the active points, above noise_factor times the noise there, and above `least`.

        noise    (k,) float32
        Returns  number of peaks, PEAKS_MAX at most
        """
        i: cython.Py_ssize_t
        p: cython.Py_ssize_t
        h: cython.float
        place: cython.int[::1] = self.place
        grid: cython.float[::1] = self.grid
        self.mark[:] = _UNKNOWN
        self.n_peaks = 0
        for i in range(self.n_active):
            p = self.active[i]
            h = grid[place[p]]
            # The height first: most points lie below the noise, and their neighbours need not be read.
            if h > least and h > noise[p] * noise_factor and self._is_maximum(place[p]):
                self._insert(p, h)
        return self.n_peaks

    def forget_searches(self) -> cython.void:
        """What is asked next does not depend on what was asked before. Each peak is asked about once."""
        self.mark[:] = _UNKNOWN

    def first_connected(self, j: cython.Py_ssize_t, level: cython.float) -> cython.Py_ssize_t:
        """The first, and so highest, peak that peak j is connected with at or above a level; j itself if none
        before it.
        """
        i: cython.Py_ssize_t
        self._search(j, level, False)
        for i in range(j):
            if self.mark[self.at[i]] == _REACHED + j:
                return i
        return j

    def is_connected(self, j: cython.Py_ssize_t, level: cython.float) -> cython.bint:
        """Whether peak j is connected at or above a level with any peak before it, all of which were asked
        about. Sooner than `first_connected`: it ends where another search has been.
        """
        self.mark[self.at[0]], self._level[0] = _REACHED, self.height[0]
        return j > 0 and self._search(j, level, True)

    def _search(self, j: cython.Py_ssize_t, given: cython.float, soon: cython.bint) -> cython.bint:
        """Mark what is connected with peak j at or above a level; soon: until a search from a peak before it
        is met that was not below this level. Whether one was.
        """
        d: cython.Py_ssize_t
        to: cython.int
        i: cython.Py_ssize_t = 0
        n: cython.Py_ssize_t = 1
        other: cython.Py_ssize_t
        reached: cython.schar = _REACHED + cython.cast(cython.schar, j)
        # The border is -inf: no search reaches it.
        level: cython.float = _LOWEST if given < _LOWEST else given
        self._level[j] = level
        self._stack[0] = self.at[j]
        self.mark[self.at[j]] = reached
        while i < n:
            for d in range(8):
                to = self._stack[i] + self._around[d]
                if self.grid[to] >= level and self.mark[to] != reached:
                    other = self.mark[to] - _REACHED
                    if soon and 0 <= other < j and (self._level[other] >= level or self._is_peak(to, j)):
                        return True
                    self.mark[to] = reached
                    self._stack[n] = to
                    n += 1
            i += 1
        return False

    def _is_peak(self, place: cython.int, n: cython.Py_ssize_t) -> cython.bint:
        """Whether one of the first n peaks lies there."""
        i: cython.Py_ssize_t
        for i in range(n):  # noqa: SIM110
            if self.at[i] == place:
                return True
        return False

    def _insert(self, p: cython.Py_ssize_t, h: cython.float) -> cython.void:
        """Insert point p into the list of peaks; of equal heights the first comes first."""
        i: cython.Py_ssize_t = self.n_peaks
        if i < _PEAKS_MAX:
            self.n_peaks += 1
        elif h > self.height[_PEAKS_MAX - 1]:
            i = _PEAKS_MAX - 1
        else:
            return
        while i > 0 and self.height[i - 1] < h:
            self.height[i] = self.height[i - 1]
            self.at[i] = self.at[i - 1]
            self.point[i] = self.point[i - 1]
            i -= 1
        self.height[i] = h
        self.at[i] = self.place[p]
        self.point[i] = p

    def _is_maximum(self, here: cython.Py_ssize_t) -> cython.bint:
        """Whether a place is a regional maximum; it, or the plateau it is on, is marked _TOP or _SLOPE."""
        d: cython.Py_ssize_t
        h: cython.float = self.grid[here]
        other: cython.float
        equal: cython.bint = False
        if self.mark[here] != _UNKNOWN:
            return self.mark[here] == _TOP
        self.mark[here] = _TOP
        for d in range(8):
            other = self.grid[here + self._around[d]]
            if other > h or h == _NOTHING:
                self.mark[here] = _SLOPE
                return False
            equal = equal or other == h
        if equal:
            self._mark_plateau(here)
        return self.mark[here] == _TOP

    def _mark_plateau(self, start: cython.Py_ssize_t) -> cython.void:
        """All connected points of one height are _TOP if nothing round them is higher, else _SLOPE."""
        h: cython.float = self.grid[start]
        i: cython.Py_ssize_t = 0
        d: cython.Py_ssize_t
        n: cython.Py_ssize_t = 1
        to: cython.int
        verdict: cython.schar = _TOP
        self._stack[0] = cython.cast(cython.int, start)
        self.mark[start] = _PLATEAU
        while i < n:
            for d in range(8):
                to = self._stack[i] + self._around[d]
                if self.grid[to] > h:
                    verdict = _SLOPE
                elif self.grid[to] == h and self.mark[to] != _PLATEAU:
                    self.mark[to] = _PLATEAU
                    self._stack[n] = to
                    n += 1
            i += 1
        for i in range(n):
            self.mark[self._stack[i]] = verdict
