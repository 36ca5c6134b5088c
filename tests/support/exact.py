"""Voronoi cells in exact rational arithmetic: the oracle for `edge.cells`.

It uses nothing of the code under test, and no triangulation: a cell is a square clipped by the
bisector to every other point. Coordinates are integers (doubles times a power of two), a line is three
integers, a corner the cross product of two lines; nothing is rounded.
"""

from collections import Counter
from fractions import Fraction
from math import hypot

import numpy as np
from numpy.typing import NDArray

Line = tuple[int, int, int]  # a x + b y + c >= 0 inside
Corner = tuple[int, int, int]  # x, y, w > 0: the place (x / w, y / w)


def cell_areas(points: NDArray[np.float64], n_pins: int) -> list[Fraction]:
    """Exact areas of the cells of the first `n_pins` points.

    points   (n, 2) float64, taken as exact numbers; the cells must be bounded by them
    Returns  in square units; points at the same place share their cell's area in equal parts
    """
    whole, unit = _as_integers(points)
    count = Counter(whole)
    distinct = list(count)
    place = np.array([[x * float(unit), y * float(unit)] for x, y in distinct])
    area: dict[tuple[int, int], Fraction] = {}
    for p in dict.fromkeys(whole[:n_pins]):
        area[p] = _area(_cell(p, distinct, place, float(unit))) * unit * unit / count[p]
    return [area[p] for p in whole[:n_pins]]


def relative_errors(areas: NDArray[np.float64], exact: list[Fraction]) -> NDArray[np.float64]:
    """|area - exact| / exact, computed exactly; NaN in `areas` counts as infinite."""
    pairs = zip(areas.tolist(), exact, strict=True)
    return np.array([float(abs(Fraction(a) - e) / e) if np.isfinite(a) else np.inf for a, e in pairs])


def _as_integers(points: NDArray[np.float64]) -> tuple[list[tuple[int, int]], Fraction]:
    """The points in whole multiples of a unit."""
    exact = [[Fraction(float(v)) for v in p] for p in points]
    unit = Fraction(1, max(v.denominator for p in exact for v in p))  # powers of two: the largest serves all
    return [(int(x / unit), int(y / unit)) for x, y in exact], unit


def _cell(
    p: tuple[int, int], distinct: list[tuple[int, int]], place: NDArray[np.float64], unit: float
) -> list[Corner]:
    """Corners of the cell of `p`, counter-clockwise."""
    xs, ys = [q[0] for q in distinct], [q[1] for q in distinct]
    size = 4 * (max(xs) - min(xs) + max(ys) - min(ys))
    x, y = p
    lines: list[Line] = [(0, 1, size - y), (-1, 0, size + x), (0, -1, size + y), (1, 0, size - x)]
    corners = [_meet(lines[k], lines[(k + 1) % 4]) for k in range(4)]
    distance = np.hypot(place[:, 0] - x * unit, place[:, 1] - y * unit)
    for j in np.argsort(distance, kind="stable"):
        q = distinct[j]
        if q == p:
            continue
        reach = max(hypot((c[0] - x * c[2]) / c[2], (c[1] - y * c[2]) / c[2]) for c in corners) * unit
        if distance[j] > 2.001 * reach + 1e-9 * reach:
            break  # this bisector, and all that follow, pass outside
        line = (2 * (x - q[0]), 2 * (y - q[1]), q[0] ** 2 + q[1] ** 2 - x**2 - y**2)
        lines, corners = _clip(lines, corners, line)
    return corners


def _meet(a: Line, b: Line) -> Corner:
    x, y, w = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    return (x, y, w) if w > 0 else (-x, -y, -w)


def _clip(lines: list[Line], corners: list[Corner], cut: Line) -> tuple[list[Line], list[Corner]]:
    """Part of a convex polygon on the positive side of `cut`. corners[k] = lines[k] meets lines[k + 1]."""
    outside = [cut[0] * x + cut[1] * y + cut[2] * w < 0 for x, y, w in corners]
    if not any(outside):
        return lines, corners
    k = len(corners)
    first = next(i for i in range(k) if outside[i] and not outside[i - 1])
    run = next(j for j in range(k) if not outside[(first + j) % k])
    kept = [lines[(first + run + j) % k] for j in range(k - run + 1)]  # the last one is lines[first]
    inner = [corners[(first + run + j) % k] for j in range(k - run)]
    return [*kept, cut], [*inner, _meet(kept[-1], cut), _meet(cut, kept[0])]


def _area(corners: list[Corner]) -> Fraction:
    place = [(Fraction(x, w), Fraction(y, w)) for x, y, w in corners]
    edges = zip(place, [*place[1:], place[0]], strict=True)
    return abs(sum((a[0] * b[1] - b[0] * a[1] for a, b in edges), Fraction(0))) / 2
