# cython: infer_types=True
r"""Kept Delaunay triangulation of moving points, and the areas of their Voronoi cells.

Idea
  The triangulation of one frame is nearly always that of the next, so it is kept: every frame each
  triangle is measured once, each edge checked once, and only edges that are no longer Delaunay are
  flipped (Lawson). It is built from scratch (incremental insertion) at the start and when points
  moved so far that triangles turned over.

  Everything follows from one number an edge. With alpha, beta the angles that face the edge in its two
  triangles,

           r                weight = cot(alpha) + cot(beta)
          /a\
         /   \              weight >= 0           the edge is Delaunay
        p-----q             weight length^2 / 8   area that the edge gives to the cell of p, and to that of q
         \   /              weight = -incircle(p, q, r, s) / (orient(p, q, r) orient(q, p, s))
          \b/
           s

  (length * weight / 2 is the length of the Voronoi edge, length / 2 the height of the triangle that it
  spans with p.) A cell's area is a sum of terms that are all >= 0, and at a flip the weight passes through 0,
  so areas are continuous and near-cocircular points do not matter. Parts of the two triangles that are
  positive beyond their errors are summed triangle by triangle; an edge with another part gives the rest.

Rules
  - Decisions are exact: a value with an error bound decides where it can, whole numbers elsewhere. So every
    flip lowers the lifted surface and the loop terminates; equality (cocircular) never flips.
  - Areas carry an error bound, 1e-12 of the area at most: a cell for which it may be more is summed again
    from exact weights, where each term is good to a few ulp for any input.
  - Only differences of coordinates enter: no origin, no scale.
  - Points come in this order: pins, whose areas are wanted; boundary points, that bound their cells;
    fence points, that stand round the boundary. A cell that reaches the fence is not bounded; its
    area is NaN. Four guard points far outside, added here, make a hull that never changes.
  - Why a fence: without it, boundary points that lie nearly on a line have flat triangles on their
    outer side, which turn over at the least motion. With a fence nearby these are never Delaunay.
  - Points at the same place share one vertex and one cell: each gets an equal part of its area.
  - All memory is allocated in the constructor. The GIL is held: the work is short.

Names: h, g are half-edges (3 t, 3 t + 1, 3 t + 2 belong to triangle t), tail[h] the point where h starts,
twin[h] the same edge in the neighbouring triangle or -1 on the hull. Triangles run counter-clockwise
in the coordinates' own sense (x right, y up).
"""

import cython
import numpy as np
from cython.cimports.libc.math import fabs

from edge.cells.boundary import RimMotion
from edge.errors import DegenerateLayout
from edge.geometry.neighbours import weighted_rows
from edge.limits import POINTS_MAX
from edge.types import Array, Index

if cython.compiled:
    from cython.cimports.edge.cells.triangle_parts import measure
else:
    from edge.cells.triangle_parts import measure

INFINITY = cython.declare(cython.double, float("inf"))
NAN = cython.declare(cython.double, float("nan"))
# Half an ulp of 1.
EPSILON = cython.declare(cython.double, 2.0**-53)
# Twice a triangle's area over the sum of its squared edges, below which its weights are taken exactly.
SLIVER = cython.declare(cython.double, 1e-10)
# Error bound of a triangle's parts over q (1 + q) S; S: sum of its squared edges, q = S / 4 area >= |cot|.
# The cross product's relative error is <= 4 eps q, the dot products' error 4 eps q of it: a cotangent's is
# 4 eps q^2 + 6 eps q. Its squared length and the sum of two parts add 6 eps q, and q >= sqrt(3), so that
# 8 eps q (1 + q) is enough. No edge's square is above 2/3 S.
ERROR_BOUND = cython.declare(cython.double, 16.0 / 3.0 * EPSILON)
# Largest error bound of an edge, as a share of its part of the area; larger ones are added up, and must be
# below this share of the cell's area. Otherwise the cell is summed from exact weights.
AREA_TOLERANCE = cython.declare(cython.double, 0.5e-12)
# Error of `_orient` over the sum of its terms' magnitudes: 2 differences, a product, a sum, each half an ulp.
ORIENT_BOUND = cython.declare(cython.double, 4.0 * EPSILON)
# Error of `_incircle` over the permanent of its 3 x 3 determinant: 10, and the rounding of the permanent.
INCIRCLE_BOUND = cython.declare(cython.double, 12.0 * EPSILON)
# Corners of a rectangle round the points.
N_GUARD = cython.declare(cython.Py_ssize_t, 4)
# Products of four differences must not underflow, or they are not exact: of a set at least this wide,
# coordinates smaller than this share of its width count as 0. 4 (66 + 140 + 52) bits < 1074.
EXTENT_MIN = cython.declare(cython.double, 2.0**-66)
EXTENT_MAX = cython.declare(cython.double, 2.0**66)
SNAP = cython.declare(cython.double, 2.0**-140)
# Times this, every coordinate is a whole number: the least is EXTENT_MIN SNAP, with 52 bits behind its first.
WHOLE = int(np.reciprocal(EXTENT_MIN * SNAP * np.finfo(np.float64).eps))


@cython.final
@cython.cclass
class Mesh:
    """The triangulation of one tip's points.

    n_pins      how many points want an area; they come first
    n_boundary  how many points after them bound the pins' cells
    n_fence     how many after those stand round the boundary; a cell that reaches them is not bounded
    Raises      ValueError: numbers out of range
    """

    n_pins: cython.Py_ssize_t
    n_bounded: cython.Py_ssize_t  # pins and boundary; from here on it is fence and guards
    n_points: cython.Py_ssize_t  # guards are points n_points .. n_points + 3
    n_triangles: cython.Py_ssize_t  # 0: not built
    n_stack: cython.Py_ssize_t
    n_shared: cython.Py_ssize_t  # points that share place and vertex with another
    flips: cython.Py_ssize_t  # of the kept mesh since the beginning, without those of builds
    builds: cython.Py_ssize_t
    changes: cython.Py_ssize_t  # how often the triangles changed
    marked: cython.Py_ssize_t  # changes when it was last looked which cells reach the fence
    reached: cython.bint  # a pin's does
    x: cython.double[::1]  # per point
    y: cython.double[::1]
    area: cython.double[::1]
    bound: cython.double[::1]  # per pin, of the error of the area's parts that are not accurate by themselves
    has_bounds: cython.bint  # one is above 0
    exactly: cython.uchar[::1]  # whether the area must be summed from exact weights
    same_as: cython.int[::1]  # the point whose vertex it uses, mostly itself
    sharers: cython.int[::1]  # how many use its vertex
    tail: cython.int[::1]  # per half-edge
    twin: cython.int[::1]
    stacked: cython.uchar[::1]  # whether it is on the stack
    stack: cython.int[::1]  # half-edges to check
    parts: cython.double[:, ::1]  # of each triangle, as `measure` writes them
    unsure: cython.int[::1]  # the triangles that are not certain, as it finds them
    attached: cython.bint
    # `attach` writes what follows.
    rest: cython.const[cython.double][:, ::1]
    rim: cython.const[cython.int][::1]
    fit: cython.const[cython.double][:, ::1]
    start: cython.int[::1]  # as `weighted_rows` gives them
    near: cython.ushort[::1]
    weight: cython.double[::1]
    residual: cython.double[::1]  # of the rim's motion beside the affine one: x, y, x, y, ...
    points: cython.double[:, ::1]
    areas: cython.double[::1]
    total_area = cython.declare(cython.double, visibility="readonly")  # of the pins; NaN if one's is

    def __init__(self, n_pins: int, n_boundary: int, n_fence: int = 0) -> None:
        if not (0 < n_pins <= POINTS_MAX and 0 <= n_boundary <= POINTS_MAX and 0 <= n_fence <= POINTS_MAX):
            raise ValueError(
                f"need 1 <= n_pins and 0 <= n_boundary, n_fence, each <= {POINTS_MAX}, "
                f"got {n_pins}, {n_boundary}, {n_fence}"
            )
        n = n_pins + n_boundary + n_fence
        n_all = n + N_GUARD
        n_triangles = 2 * n + 2
        self.n_pins, self.n_bounded, self.n_points = n_pins, n_pins + n_boundary, n
        self.n_triangles = self.n_stack = self.n_shared = 0
        self.flips = self.builds = self.changes = 0
        self.marked = -1
        self.reached = self.has_bounds = self.attached = False
        self.x, self.y, self.area = np.zeros((3, n_all))
        self.bound = np.zeros(n_pins)
        self.exactly = np.zeros(n_all, np.uint8)
        self.same_as, self.sharers = np.zeros((2, n_all), np.int32)
        self.tail, self.twin, self.stack = np.zeros((3, 3 * n_triangles), np.int32)
        self.stacked = np.zeros(3 * n_triangles, np.uint8)
        self.parts, self.unsure = np.zeros((n_triangles, 4)), np.zeros(n_triangles + 1, np.int32)
        self.total_area = 0.0

    def update(
        self, points: cython.const[cython.double][:, ::1], areas: cython.double[::1]
    ) -> cython.Py_ssize_t:
        """Move the points and write the pins' areas.

        points   (n_pins + n_boundary + n_fence, 2) float64, contiguous
        areas    (n_pins,) float64, written; in square units of the points; NaN where a cell is not bounded
        Returns  how often the triangles have changed since the beginning
        Raises   ValueError: wrong size
                 DegenerateLayout: a coordinate is not finite, all points at one place
        """
        if points.shape[0] != self.n_points or points.shape[1] != 2 or areas.shape[0] != self.n_pins:
            raise ValueError(f"points ({self.n_points}, 2) and areas ({self.n_pins},) are wanted")
        for i in range(self.n_points):
            self.x[i], self.y[i] = points[i, 0], points[i, 1]
        return self._update(areas)

    @cython.cfunc
    @cython.exceptval(-1)
    def _update(self, areas: cython.double[::1]) -> cython.Py_ssize_t:
        kept = self.n_triangles
        self.n_triangles = 0  # until the points have been looked at
        self._enclose()
        self.n_triangles = kept
        if not self._triangulate():
            self.n_triangles = 0
            raise DegenerateLayout("no triangulation: coordinates out of range")
        self._sum_exactly()
        self._share()
        area: cython.double[::1] = self.area
        total: cython.double = 0.0
        for i in range(self.n_pins):
            areas[i] = 0.125 * area[i] if area[i] < INFINITY else NAN
            total += areas[i]
        self.total_area = total
        return self.changes

    def attach(self, rest: Array, rim: Index, motion: RimMotion, points: Array, areas: Array) -> None:
        """Prepare for `follow`.

        rest    (n_pins + n_boundary + n_fence, 2) float64
        rim     (r,) int32, the pins that boundary and fence follow
        motion  how they do
        points  (n_pins + n_boundary + n_fence, 2) float64: `follow` writes those that are no pins
        areas   (n_pins,) float64, written too
        Raises  ValueError: sizes that do not fit, a rim pin that does not exist
        """
        n, r, around = self.n_points, len(rim), self.n_points - self.n_pins
        fit, weight = (np.ascontiguousarray(part, np.float64) for part in motion)
        sizes = (rest.shape, fit.shape, weight.shape, points.shape, areas.shape)
        wanted = ((n, 2), (3, r), (around, r), (n, 2), (self.n_pins,))
        if sizes != wanted or not (r and rim.min() >= 0 and rim.max() < self.n_pins):
            raise ValueError(f"{wanted} and 1 or more of {self.n_pins} pins are wanted, not {sizes}")
        self.points, self.areas = points, areas
        rows = weighted_rows(np.tile(np.arange(r, dtype=np.int32), (around, 1)), weight)
        self.rest, self.rim = np.array(rest, np.float64), np.array(rim, np.int32)
        self.fit, self.residual = fit, np.zeros(2 * r)
        self.start, self.near, self.weight = rows[0], rows[1], np.asarray(rows[2], np.float64)
        self.attached = True

    def follow(self, xy: cython.const[cython.double][:, ::1]) -> cython.Py_ssize_t:
        """Write the points of a frame, and their areas: boundary and fence move with the rim. As `update`.

        xy  (n_pins, 2) float64
        """
        n = self.n_pins
        if not self.attached or xy.shape[0] != n or xy.shape[1] != 2:
            raise ValueError(f"xy ({n}, 2) is wanted, after `attach`")
        points: cython.double[:, ::1] = self.points
        x_of: cython.double[::1] = self.x
        y_of: cython.double[::1] = self.y
        rest: cython.const[cython.double][:, ::1] = self.rest
        rim: cython.const[cython.int][::1] = self.rim
        residual: cython.double[::1] = self.residual
        near: cython.ushort[::1] = self.near
        weight: cython.double[::1] = self.weight
        r = rim.shape[0]
        affine_x: cython.double[3] = [0.0] * 3
        affine_y: cython.double[3] = [0.0] * 3
        x: cython.double
        y: cython.double
        for i in range(n):
            x_of[i], y_of[i] = xy[i, 0], xy[i, 1]
        for k in range(r):
            x = xy[rim[k], 0] - rest[rim[k], 0]
            y = xy[rim[k], 1] - rest[rim[k], 1]
            for i in range(3):
                affine_x[i] += self.fit[i, k] * x
                affine_y[i] += self.fit[i, k] * y
        for k in range(r):
            x = xy[rim[k], 0] - rest[rim[k], 0]
            y = xy[rim[k], 1] - rest[rim[k], 1]
            u, v = rest[rim[k], 0], rest[rim[k], 1]
            residual[2 * k] = x - affine_x[0] - affine_x[1] * u - affine_x[2] * v
            residual[2 * k + 1] = y - affine_y[0] - affine_y[1] * u - affine_y[2] * v
        for k in range(self.n_points - n):
            u, v = rest[n + k, 0], rest[n + k, 1]
            x = u + affine_x[0] + affine_x[1] * u + affine_x[2] * v
            y = v + affine_y[0] + affine_y[1] * u + affine_y[2] * v
            for i in range(self.start[k], self.start[k + 1], 2):
                for j in range(i, i + 2):
                    x += weight[j] * residual[near[j]]
                    y += weight[j] * residual[near[j] + 1]
            points[n + k, 0], points[n + k, 1] = x, y
            x_of[n + k], y_of[n + k] = x, y
        return self._update(self.areas)

    def forget(self) -> None:
        """Triangulate the next points from scratch: no rounding of theirs depends on those before."""
        self.n_triangles = 0

    def triangles(self) -> Index:
        """(k, 3) int32, read-only: the triangles that touch a pin and not the fence, counter-clockwise.

        Each triangle is written, over the last one if that was not chosen: half of them are, at random.
        """
        table: Index = np.empty((self.n_triangles, 3), np.int32)
        corners: cython.int[:, ::1] = table
        tail: cython.int[::1] = self.tail
        n = cython.cast(cython.int, self.n_pins)
        bounded = cython.cast(cython.int, self.n_bounded)
        k: cython.Py_ssize_t = 0
        for t in range(self.n_triangles):
            a, b, c = tail[3 * t], tail[3 * t + 1], tail[3 * t + 2]
            corners[k, 0], corners[k, 1], corners[k, 2] = a, b, c
            k += ((a < n) | (b < n) | (c < n)) & (a < bounded) & (b < bounded) & (c < bounded)
        chosen: Index = table[:k]
        chosen.flags.writeable = False
        return chosen

    def counts(self) -> tuple[int, int, int]:
        """Changes of the triangles, flips of the kept mesh, builds, since the beginning."""
        return self.changes, self.flips, self.builds

    # ---- one frame

    @cython.cfunc
    def _triangulate(self) -> cython.bint:
        """Make the triangles those of the points, and sum the areas; false where none can be built."""
        built: cython.bint = self.n_triangles == 0 or self._parted()
        if built and not self._build():
            return False
        while True:
            if self._sweep():
                if self.n_stack == 0:
                    return True
                self.changes += 1
                # More flips than triangles would take longer than a new triangulation.
                if self._legalize(self.n_triangles):
                    continue
            elif built:  # no triangle of a new one is turned over
                return False
            built = True
            if not self._build():
                return False

    @cython.cfunc
    def _enclose(self) -> cython.void:
        """Check the coordinates, and place the guards round them."""
        n = self.n_points
        x_of: cython.double[::1] = self.x
        y_of: cython.double[::1] = self.y
        left: cython.double = INFINITY
        right: cython.double = -INFINITY
        top: cython.double = INFINITY
        bottom: cython.double = -INFINITY
        nearest: cython.double = INFINITY  # of the products of both coordinates
        total: cython.double = 0.0  # not finite if a coordinate is not
        for i in range(n):
            x, y = x_of[i], y_of[i]
            left, right = left if left < x else x, right if right > x else x
            top, bottom = top if top < y else y, bottom if bottom > y else y
            nearest = nearest if nearest < fabs(x * y) else fabs(x * y)
            total += x + y
        if not fabs(total) < INFINITY:
            raise DegenerateLayout("a coordinate is not finite")
        size = max(right - left, bottom - top)
        if not EXTENT_MIN < size < EXTENT_MAX:
            raise DegenerateLayout("all points at one place, or farther apart than 7e19")
        least = SNAP * size
        if nearest <= least * max(fabs(left), fabs(right), fabs(top), fabs(bottom)):  # else none is so small
            for i in range(n):
                x_of[i] = x_of[i] if fabs(x_of[i]) >= least else 0.0
                y_of[i] = y_of[i] if fabs(y_of[i]) >= least else 0.0
        # The more points, the flatter triangles their outline can have, and the further out the guards are.
        half = size * n
        x_mid, y_mid = left + 0.5 * (right - left), top + 0.5 * (bottom - top)
        self.x[n] = self.x[n + 3] = x_mid - half
        self.x[n + 1] = self.x[n + 2] = x_mid + half
        self.y[n] = self.y[n + 1] = y_mid - half
        self.y[n + 2] = self.y[n + 3] = y_mid + half

    @cython.cfunc
    def _parted(self) -> cython.bint:
        """Whether points that shared a vertex have separated."""
        if self.n_shared > 0:
            for i in range(self.n_points):
                if self.x[i] != self.x[self.same_as[i]] or self.y[i] != self.y[self.same_as[i]]:
                    return True
        return False

    # ---- triangles and areas

    @cython.cfunc
    def _is_turned(self, t: cython.Py_ssize_t) -> cython.bint:
        """Whether triangle t is turned over or flat."""
        return not self._orient(self.tail[3 * t], self.tail[3 * t + 1], self.tail[3 * t + 2]) > 0.0

    @cython.cfunc
    def _sweep(self) -> cython.bint:
        """Check every edge and sum the areas; edges that are not Delaunay are put onto the stack.

        An edge both of whose parts are certain is Delaunay. Certain parts are added triangle by triangle.
        Returns false, and areas are of no use, where a triangle is turned over.
        """
        tail: cython.int[::1] = self.tail
        area: cython.double[::1] = self.area
        parts: cython.double[:, ::1] = self.parts
        twin: cython.int[::1] = self.twin
        unsure: cython.int[::1] = self.unsure
        n = self.n_pins
        for i in range(n):  # nobody reads the other points' areas
            area[i] = 0.0
        if self.has_bounds:
            self.has_bounds = False
            for i in range(n):
                self.bound[i] = 0.0
        unsure_n = measure(
            tail, self.x, self.y, self.n_triangles, 2.0 * SLIVER, 2.0 * ERROR_BOUND / AREA_TOLERANCE, parts,
            area, unsure,
        )  # fmt: skip
        for i in range(unsure_n):
            t: cython.Py_ssize_t = unsure[i]
            least = parts[t, 3]
            if least == INFINITY and self._is_turned(t):
                return False
            for k in range(3):
                h = 3 * t + k
                own = parts[t, k]
                g: cython.Py_ssize_t = twin[h]
                if g >= 0 and tail[h] >= n and tail[g] >= n:  # no pin's: it need only be Delaunay
                    other = g // 3
                    if own + parts[other, g - 3 * other] > AREA_TOLERANCE * (least + parts[other, 3]):
                        continue
                if own > least:
                    area[tail[h]] += own
                    area[tail[3 * t + (k + 1) % 3]] += own
                else:
                    self._sweep_edge(h, own, least)
        if self.reached or self.marked != self.changes:
            self.marked = self.changes
            self.reached = self._mark()
        return True

    @cython.cfunc
    @cython.exceptval(check=False)
    def _sweep_edge(self, h: cython.Py_ssize_t, own: cython.double, least: cython.double) -> cython.void:
        """Check an edge whose part of its triangle is not certain, and add what its cells lack."""
        g = self.twin[h]
        if g < 0:  # the hull
            return
        p, q, other = self.tail[h], self.tail[g], g // 3
        beyond = self.parts[other, g % 3]
        part: cython.double = own + beyond
        is_certain: cython.bint = beyond > self.parts[other, 3]
        if g < h and not is_certain:  # seen from the other side
            return
        least += self.parts[other, 3]
        if not part > least:
            part = self._part(h, g, part, AREA_TOLERANCE * least)
            if part < 0.0:
                return
        if is_certain:  # it has been added
            part -= beyond
            if part < 0.0:  # and rounding of the sums counts: of each cell, six terms a triangle at most
                self._add_bound(p, q, 6.0 * EPSILON * self.n_triangles * beyond)
        self.area[p] += part
        self.area[q] += part

    @cython.cfunc
    def _mark(self) -> cython.bint:
        """Make the areas of cells infinite that reach the fence; whether a pin's does."""
        reached: cython.bint = False
        tail: cython.int[::1] = self.tail
        area: cython.double[::1] = self.area
        for t in range(self.n_triangles):
            a, b, c = tail[3 * t], tail[3 * t + 1], tail[3 * t + 2]
            if max(a, b, c) >= self.n_bounded:
                area[a] = area[b] = area[c] = INFINITY
                reached |= min(a, b, c) < self.n_pins
        return reached

    @cython.cfunc
    @cython.exceptval(check=False)
    def _part(
        self, h: cython.Py_ssize_t, g: cython.Py_ssize_t, part: cython.double, error: cython.double
    ) -> cython.double:
        """Part of an edge with a large bound, which is added to that of its cells; -1: it is not Delaunay,
        and put onto the stack.
        """
        if not part > error:
            if self._incircle(h, g) > 0.0:
                self._push(h)
                return -1.0
            part = self._exact_part(h, g)
            # 4 roundings of the squared length, 5 of three predicates and two divisions, 1 of the product.
            error = 10.0 * EPSILON * part
        self._add_bound(self.tail[h], self.tail[g], error)
        return part

    @cython.cfunc
    @cython.exceptval(check=False)
    def _add_bound(self, p: cython.Py_ssize_t, q: cython.Py_ssize_t, error: cython.double) -> cython.void:
        """Add to the bounds of an edge's two cells; only the pins' count."""
        if p < self.n_pins:
            self.bound[p] += error
            self.has_bounds = True
        if q < self.n_pins:
            self.bound[q] += error
            self.has_bounds = True

    @cython.cfunc
    def _sum_exactly(self) -> cython.void:
        """Sum the cells again whose error bound is too large, from exact weights."""
        if not self.has_bounds:
            return
        n = self.n_pins
        area: cython.double[::1] = self.area
        bound: cython.double[::1] = self.bound
        exactly: cython.uchar[::1] = self.exactly
        found: cython.Py_ssize_t = 0
        for i in range(n):  # in vectors; never of an area that is infinite
            found = found + 1 if bound[i] > AREA_TOLERANCE * area[i] else found
        if found == 0:
            return
        for i in range(n):
            exactly[i] = bound[i] > AREA_TOLERANCE * area[i]
            area[i] = 0.0 if exactly[i] else area[i]
        for h in range(3 * self.n_triangles):
            g = self.twin[h]
            if g < h:
                continue
            p, q = self.tail[h], self.tail[g]
            if not ((p < n and exactly[p]) or (q < n and exactly[q])):
                continue
            part = self._exact_part(h, g)
            if p < n and exactly[p]:
                area[p] += part
            if q < n and exactly[q]:
                area[q] += part

    @cython.cfunc
    def _share(self) -> cython.void:
        """Points at one place: each gets an equal part of the cell."""
        if self.n_shared == 0:
            return
        sharers: cython.int[::1] = self.sharers
        for i in range(self.n_points):
            sharers[i] = 0
        for i in range(self.n_points):
            sharers[self.same_as[i]] += 1
        for i in range(self.n_points):
            first = self.same_as[i]
            if first != i:
                self.area[i] = self.area[first] / sharers[first]
        for i in range(self.n_points):
            if self.same_as[i] == i:
                self.area[i] /= sharers[i]

    @cython.cfunc
    def _exact_part(self, h: cython.Py_ssize_t, g: cython.Py_ssize_t) -> cython.double:
        p, q = self.tail[h], self.tail[g]
        r, s = self.tail[_before(h)], self.tail[_before(g)]
        dx, dy = self.x[q] - self.x[p], self.y[q] - self.y[p]
        inside = self._incircle_exact(p, q, r, s)
        first, second = self._orient_exact(p, q, r), self._orient_exact(q, p, s)
        if first == 0.0 or second == 0.0:  # flat: no weight, or any
            return NAN if inside == 0.0 else INFINITY
        return (dx * dx + dy * dy) * (-inside / first / second)

    # ---- on which side of a line, and whether within a circle

    @cython.cfunc
    def _orient(self, a: cython.Py_ssize_t, b: cython.Py_ssize_t, c: cython.Py_ssize_t) -> cython.double:
        """Above 0: points a, b, c turn counter-clockwise."""
        left = (self.x[b] - self.x[a]) * (self.y[c] - self.y[a])
        right = (self.y[b] - self.y[a]) * (self.x[c] - self.x[a])
        det = left - right
        if fabs(det) > ORIENT_BOUND * (fabs(left) + fabs(right)):
            return det
        return self._orient_exact(a, b, c)

    @cython.cfunc
    def _incircle(self, h: cython.Py_ssize_t, g: cython.Py_ssize_t) -> cython.double:
        """Above 0: the edge is not Delaunay, one of its triangles' corners is within the other's circle."""
        a, b = self.tail[h], self.tail[g]
        c, d = self.tail[_before(h)], self.tail[_before(g)]
        ax, ay = self.x[a] - self.x[d], self.y[a] - self.y[d]
        bx, by = self.x[b] - self.x[d], self.y[b] - self.y[d]
        cx, cy = self.x[c] - self.x[d], self.y[c] - self.y[d]
        bxcy, bycx = bx * cy, by * cx
        cxay, cyax = cx * ay, cy * ax
        axby, aybx = ax * by, ay * bx
        a2, b2, c2 = ax * ax + ay * ay, bx * bx + by * by, cx * cx + cy * cy
        det = a2 * (bxcy - bycx) + b2 * (cxay - cyax) + c2 * (axby - aybx)
        permanent = (
            a2 * (fabs(bxcy) + fabs(bycx)) + b2 * (fabs(cxay) + fabs(cyax)) + c2 * (fabs(axby) + fabs(aybx))
        )
        if fabs(det) > INCIRCLE_BOUND * permanent:
            return det
        return self._incircle_exact(a, b, c, d)

    @cython.cfunc
    def _orient_exact(
        self, a: cython.Py_ssize_t, b: cython.Py_ssize_t, c: cython.Py_ssize_t
    ) -> cython.double:
        """The value of `_orient`, rounded once."""
        (bx, by), (cx, cy) = self._from(a, b), self._from(a, c)
        return (bx * cy - by * cx) / WHOLE**2

    @cython.cfunc
    def _incircle_exact(
        self, a: cython.Py_ssize_t, b: cython.Py_ssize_t, c: cython.Py_ssize_t, d: cython.Py_ssize_t
    ) -> cython.double:
        """The value of `_incircle`, of corners a, b, c and d; rounded once."""
        (ax, ay), (bx, by), (cx, cy) = self._from(d, a), self._from(d, b), self._from(d, c)
        det = (
            (ax * ax + ay * ay) * (bx * cy - by * cx)
            + (bx * bx + by * by) * (cx * ay - cy * ax)
            + (cx * cx + cy * cy) * (ax * by - ay * bx)
        )
        return det / WHOLE**4

    @cython.cfunc
    def _from(self, a: cython.Py_ssize_t, b: cython.Py_ssize_t) -> tuple[int, int]:
        """The way from point a to b, in parts of `WHOLE`."""
        whole: cython.double = WHOLE
        x = int(self.x[b] * whole) - int(self.x[a] * whole)
        return x, int(self.y[b] * whole) - int(self.y[a] * whole)

    # ---- edges

    @cython.cfunc
    @cython.exceptval(check=False)
    def _link(self, h: cython.Py_ssize_t, g: cython.Py_ssize_t) -> cython.void:
        self.twin[h] = g
        if g >= 0:
            self.twin[g] = h

    @cython.cfunc
    @cython.exceptval(check=False)
    def _push(self, h: cython.Py_ssize_t) -> cython.void:
        if not self.stacked[h]:
            self.stacked[h] = 1
            self.stack[self.n_stack] = h
            self.n_stack += 1

    @cython.cfunc
    @cython.exceptval(check=False)
    def _push_round(self, h: cython.Py_ssize_t, g: cython.Py_ssize_t) -> cython.void:
        """The four edges round the one that a flip of h and its twin g has made."""
        self._push(h)
        self._push(_before(h))
        self._push(g)
        self._push(_before(g))

    @cython.cfunc
    @cython.exceptval(check=False)
    def _flip(self, h: cython.Py_ssize_t) -> cython.void:
        r"""Replace the edge p-q of half-edge h by s-r.

              r                 r
             /|\               / \
          h2/ | \h1         h2/ t0\h0'      t0 = h // 3 holds p, s, r afterwards,
           /  |  \           /     \        t1 = g // 3 holds q, r, s.
          p  h|g  q   --->  p  ...  q       (p-q was the edge, s-r is.)
        """
        g = self.twin[h]
        h1, g1 = _after(h), _after(g)
        beyond_h1, beyond_g1 = self.twin[h1], self.twin[g1]
        self.tail[h1], self.tail[g1] = self.tail[_before(g)], self.tail[_before(h)]  # s, r
        self._link(h, beyond_g1)
        self._link(g, beyond_h1)
        self._link(h1, g1)
        self.flips += 1

    @cython.cfunc
    def _legalize(self, limit: cython.Py_ssize_t) -> cython.bint:
        """Flip until each edge on the stack, or beside a flip, is Delaunay; false beyond the limit."""
        while self.n_stack > 0:
            self.n_stack -= 1
            h = self.stack[self.n_stack]
            self.stacked[h] = 0
            g = self.twin[h]
            if g < 0 or not self._incircle(h, g) > 0.0:
                continue
            if limit <= 0:
                return False
            limit -= 1
            self._flip(h)
            self._push_round(h, g)
        return True

    # ---- from scratch

    @cython.cfunc
    def _build(self) -> cython.bint:
        """Triangulate from scratch; false if the coordinates' range allows no triangulation."""
        n, flips = self.n_points, self.flips  # those made here do not count
        near = 0
        while self.n_stack > 0:
            self.n_stack -= 1
            self.stacked[self.stack[self.n_stack]] = 0
        self.n_triangles = 0
        self.n_shared = 0
        h, g = self._add_triangle(n, n + 1, n + 2), self._add_triangle(n, n + 2, n + 3)
        for i in range(6):
            self.twin[i] = -1
        self._link(h + 2, g)
        for i in range(n):
            self.same_as[i] = i
            near = self._insert(i, near)
            if near < 0:
                self.n_triangles = 0
                return False
        self.flips = flips
        self.builds += 1
        self.changes += 1
        return True

    @cython.cfunc
    def _add_triangle(
        self, a: cython.Py_ssize_t, b: cython.Py_ssize_t, c: cython.Py_ssize_t
    ) -> cython.Py_ssize_t:
        h = 3 * self.n_triangles
        self.n_triangles += 1
        self.tail[h], self.tail[h + 1], self.tail[h + 2] = a, b, c
        return h

    @cython.cfunc
    def _insert(self, i: cython.Py_ssize_t, near: cython.Py_ssize_t) -> cython.Py_ssize_t:
        """Insert point i, walking from triangle `near`. Returns a triangle near it, or -1."""
        t, came, on_edge, out = near, -1, -1, 0
        zeros = steps = 0
        while out >= 0:
            if steps > 4 * self.n_triangles + 16:
                return -1
            steps += 1
            out = on_edge = -1
            zeros = 0
            for h in range(3 * t, 3 * t + 3):
                if h == came:
                    continue
                side = self._orient(self.tail[h], self.tail[_after(h)], i)
                if side < 0.0:
                    out = h
                    break
                if side == 0.0:
                    zeros += 1
                    on_edge = h
            if out >= 0:
                came = self.twin[out]
                if came < 0:
                    return -1
                t = came // 3
        if zeros == 2:  # on the vertex that the two edges share
            for h in range(3 * t, 3 * t + 3):
                if self.x[self.tail[h]] == self.x[i] and self.y[self.tail[h]] == self.y[i]:
                    self.same_as[i] = self.tail[h]
            self.n_shared += 1
            return t
        if not self._split(i, t, on_edge if zeros == 1 else -1):
            return -1
        # Each flip adds a lasting edge to the new point: there cannot be more flips than points.
        return t if self._legalize(self.n_triangles + 8) else -1

    @cython.cfunc
    def _split(self, i: cython.Py_ssize_t, t: cython.Py_ssize_t, on_edge: cython.Py_ssize_t) -> cython.bint:
        """Make three triangles of t, with point i; if it lies on an edge, four of the two at that edge."""
        a = 3 * t
        from_a, from_b, from_c = self.tail[a], self.tail[a + 1], self.tail[a + 2]
        beyond_bc, beyond_ca = self.twin[a + 1], self.twin[a + 2]
        self.tail[a + 2] = i
        b, c = self._add_triangle(from_b, from_c, i), self._add_triangle(from_c, from_a, i)
        self._link(b, beyond_bc)
        self._link(c, beyond_ca)
        self._link(a + 1, b + 2)
        self._link(b + 1, c + 2)
        self._link(c + 1, a + 2)
        if on_edge != a:
            self._push(a)
        if on_edge != a + 1:
            self._push(b)
        if on_edge != a + 2:
            self._push(c)
        if on_edge < 0:
            return True
        # One of the three is flat: swap its edge with its neighbour.
        flat = a if on_edge == a else b if on_edge == a + 1 else c
        g = self.twin[flat]
        if g < 0:
            return False
        self._flip(flat)
        self._push_round(flat, g)
        return True


@cython.cfunc
@cython.inline
def _after(h: cython.Py_ssize_t) -> cython.Py_ssize_t:
    """The next half-edge of the same triangle."""
    return h - 2 if h % 3 == 2 else h + 1


@cython.cfunc
@cython.inline
def _before(h: cython.Py_ssize_t) -> cython.Py_ssize_t:
    """The half-edge before it in the same triangle."""
    return h + 2 if h % 3 == 0 else h - 1
