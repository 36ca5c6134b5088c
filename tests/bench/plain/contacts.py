"""Contact places as `edge.features.contacts` finds them, in plain NumPy and OpenCV: the oracle."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from edge.features.divergence import divergence_operator
from edge.types import Array, ContactRegion, Mask
from tests.bench.plain.surface import Heights, Surface

__all__ = ["blend", "find_contacts", "maxima"]

Places = NDArray[np.intp]

#: Share of the divergence in the relief.
SHARP = 0.7
#: Share of the lower maximum by which the valley must go down to part two contacts.
VALLEY = 0.2
#: Share of the peak above which a grid point belongs to the contact. 0.3 rather than 0.5: more points carry
#: the axis; an edge's direction on the simulated 331-pin tip is off by 2.3 deg instead of 3.2 (mean of 80).
EDGE = 0.3
#: A maximum below this share of the highest one is the strongest contact's own ripple or noise; so is one
#: round which the cells have grown by less than this share of the most. Of 200 published frames, each one
#: flat contact, 23 have noise at the rim that passes the first test and none that passes the second.
MINOR = 0.2
#: As in `edge.features.contacts`.
ROUND_PITCHES, WITNESSES = 2.5, 0.4
PART, LONG, SMALL, NEAR, ALIGNED = 10.0, 1.5, 3.0, 3.0, 0.7
FINE_VALLEY, FINE_PART, FINE_STEPS_PER_PITCH = 0.3, 8.0, 2.0
CONTACTS_MAX = 8
MAXIMA_MAX = 24
#: Below this ratio of the axes the direction is noise and not reported; round probes show up to 1.4 on the
#: simulated tip, edges 3.4 in the mean.
ROUND = 1.5
#: Pins within this many pitches of a small contact's middle make its place.
REACH = 2.0

_NONE = np.float32(-np.inf)


def blend(stretch: Heights, heights: Heights) -> Heights:
    """The surface that contacts are looked for in; both (k,) float32, so is the result."""
    out: Heights = np.float32(SHARP) * stretch
    out += np.float32(1.0 - SHARP) * heights
    return out


def maxima(grid: Heights) -> Mask:
    """Regional maxima, plateaus included.

    grid     (h, w) float32; -inf where there is no value
    Returns  (h, w) bool, equal to skimage.morphology.local_maxima(grid)
    """
    top = _dilate(grid)
    # Candidates have no higher neighbour. Candidates that touch are equal, for else one would be higher:
    # so the connected candidates are pieces of plateaus, and such a piece is a maximum unless an equal
    # neighbour is no candidate, that is, unless the plateau goes on to where it has a higher neighbour.
    candidate: Mask = (grid == top) & (grid > _NONE)
    if candidate.all():
        return np.zeros(grid.shape, dtype=np.bool_)
    spoilt = candidate & (_dilate(np.where(candidate, _NONE, grid)) == grid)
    if not spoilt.any():
        return candidate
    _, label = cv2.connectedComponents(candidate.astype(np.uint8), connectivity=8)
    good = np.ones(int(label.max()) + 1, dtype=np.bool_)
    good[label[spoilt]] = False
    good[0] = False
    out: Mask = good[label]
    return out


def _dilate(grid: Heights) -> Heights:
    """Highest of each 3 x 3 neighbourhood. On 32 x 32 a third of the time of cv2.dilate."""
    height, width = grid.shape
    padded = np.full((height + 2, width + 2), _NONE)
    padded[1:-1, 1:-1] = grid
    rows = np.maximum(padded[:-2], padded[2:])
    np.maximum(rows, padded[1:-1], out=rows)
    out: Heights = np.maximum(rows[:, :-2], rows[:, 2:])
    return np.maximum(out, rows[:, 1:-1], out=out)


class FineField:
    """The sharper field on its own grid, and the surface's point that each of its points lies at."""

    def __init__(self, surface: Surface) -> None:
        x0, x1, y0, y1 = surface.x_img[0], surface.x_img[-1], surface.y_img[0], surface.y_img[-1]
        size = round((x1 - x0) / surface.pitch_px * FINE_STEPS_PER_PITCH) + 1
        self.x_img, self.y_img = np.linspace(x0, x1, size), np.linspace(y0, y1, size)
        rows = np.rint((self.y_img - y0) / surface.step_px).astype(int)
        columns = np.rint((self.x_img - x0) / surface.step_px).astype(int)
        self.coarse = surface.index[np.ix_(rows, columns)]
        inside = self.coarse >= 0
        points = np.column_stack([a[inside] for a in np.meshgrid(self.x_img, self.y_img)])
        self._inside = inside
        self._operator = divergence_operator(surface.rest_img, points, surface.pitch_px)
        self.gain = np.zeros(inside.shape)
        self.gain[inside] = np.sqrt((self._operator**2).sum(axis=1))

    def field(self, motion_px: Array) -> Array:
        """(h, w), NaN outside of the tip."""
        out = np.full(self._inside.shape, np.nan)
        out[self._inside] = self._operator @ motion_px.ravel()
        return out


def find_contacts(
    relief: Heights,
    surface: Surface,
    threshold: Heights,
    growth: Heights,
    pins_img: Array,
    noise_px: float,
    fine: FineField,
    seen: Mask,
) -> tuple[ContactRegion, ...]:
    """Contacts of one frame, strongest first.

    relief     (k,) float32, of `blend`, at the surface's points: relative area change
    threshold  (k,) float32, what a maximum must rise above to count
    growth     (n,) float32, relative area change of each pin's cell
    pins_img   (n, 2) px, where each pin is now; finite
    noise_px   of a pin, as its neighbours show it
    Source     paper, "Contact Location and Multi-Contact Detection"
    """
    grid = surface.spread(relief, -np.inf)
    rows, cols = np.nonzero(maxima(grid))
    height = grid[rows, cols]
    order = np.flatnonzero(height > threshold[surface.index[rows, cols]])
    if not len(order):
        return ()
    order = order[np.argsort(-height[order], kind="stable")[:MAXIMA_MAX]]
    order = order[height[order] >= MINOR * float(height[order[0]])]
    if len(order) > 1:
        grown = _grown(surface, growth, rows[order], cols[order])
        most = float(grown.max())
        order = order[grown >= min(MINOR * most, most)]  # under shear even the most grown one may have shrunk
    rows, cols, height = rows[order], cols[order], height[order]
    deep = np.maximum(VALLEY * height, PART * noise_px * surface.stretch_noise[surface.index[rows, cols]])
    group = _groups(grid, rows, cols, height, deep)
    leaders = np.flatnonzero(group == np.arange(len(group)))[:CONTACTS_MAX]
    shapes, owner = _shapes(grid, surface, rows, cols, height, group, leaders)
    guessed = np.array([_witnessed(surface, seen, shape[0]) < WITNESSES for shape in shapes])
    if guessed.any() and not guessed.all():
        mine = np.isin(group, leaders[~guessed])
        rows, cols, height, chosen = rows[mine], cols[mine], height[mine], leaders[~guessed]
        new = np.cumsum(mine) - 1
        group, leaders = new[group[mine]], new[chosen]
        shapes, owner = _shapes(grid, surface, rows, cols, height, group, leaders)
    field: Array | None = None
    pairs: dict[int, tuple[int, int]] = {}
    for i, leader in enumerate(leaders.tolist()):
        middle, axis_px, elongation, angle, _ = shapes[i]
        room = len(leaders) + len(pairs) < CONTACTS_MAX
        if not (elongation > LONG and axis_px < SMALL * surface.pitch_px and room):
            continue
        field = fine.field(pins_img - surface.rest_img) if field is None else field
        two = _part_in_two(field, fine, surface, owner == leader, middle, angle, noise_px)
        if two is not None:
            pairs[leader] = two
    if pairs:
        tops = [(r, c, g) for r, c, g in zip(rows, cols, group, strict=True) if g not in pairs]
        for leader, two in pairs.items():
            for k, label in zip(two, (leader, len(group) + leader), strict=True):
                r, c = np.argwhere(surface.index == k)[0]
                tops.append((r, c, label))
        rows, cols, labels = np.array(tops).T
        height = grid[rows, cols]
        group = np.array([int(np.flatnonzero(labels == g)[0]) for g in labels])
        leaders = np.unique(group)
        leaders = leaders[np.argsort(-height[leaders], kind="stable")]
        shapes, _ = _shapes(grid, surface, rows, cols, height, group, leaders)
    origin = np.array([surface.x_img[0], surface.y_img[0]])
    middles = [shape[0] for shape in shapes]
    found = []
    for i, leader in enumerate(leaders):
        _, axis_px, elongation, angle, area = shapes[i]
        member = group == leader
        ridge = origin + surface.step_px * np.column_stack([cols[member], rows[member]])
        found.append(
            ContactRegion(
                xy_img=_place(middles, i, axis_px, surface.pitch_px, growth, pins_img),
                peak=_summit(grid, int(rows[leader]), int(cols[leader])),
                area_px2=area,
                orientation_rad=angle if elongation >= ROUND else math.nan,
                elongation=elongation,
                ridge_img=ridge,
            )
        )
    return tuple(found)


def _shapes(
    grid: Heights,
    surface: Surface,
    rows: Places,
    cols: Places,
    height: Heights,
    group: Places,
    leaders: Places,
) -> tuple[list[Any], Places]:
    """Middle, axis, elongation, angle, area of each leader's region; and (h, w) whose region a point is."""
    owner = np.full(grid.shape, -1)
    py, px = np.nonzero(grid > EDGE * float(height[leaders].min()))
    nearest = np.argmin((px[:, None] - cols[None, :]) ** 2 + (py[:, None] - rows[None, :]) ** 2, axis=1)
    of = group[nearest] if len(leaders) > 1 else np.full(len(px), leaders[0])
    origin = np.array([surface.x_img[0], surface.y_img[0]])
    shapes = []
    for leader in leaders:
        level = EDGE * float(height[leader])
        mine = (of == leader) & (grid[py, px] > level)
        owner[py[mine], px[mine]] = leader
        middle, *shape = _moments(px[mine], py[mine], grid[py, px][mine] - np.float32(level), surface.step_px)
        shapes.append((middle + origin, *shape))
    return shapes, owner


def _part_in_two(
    field: Array, fine: FineField, surface: Surface, mine: Mask, middle: Array, angle: float, noise_px: float
) -> tuple[int, int] | None:
    """The two of the surface's points that a region's two maxima in the sharper field lie at."""
    member: Mask = (fine.coarse >= 0) & mine[surface.inside][np.maximum(fine.coarse, 0)]
    live = cv2.dilate(member.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool) & np.isfinite(field)
    grid = np.where(live, field, -np.inf).astype(np.float32)
    others = np.ones((3, 3), np.uint8)
    others[1, 1] = 0
    rows, cols = np.nonzero(
        member & (grid > cv2.dilate(np.where(live, grid, -3e38).astype(np.float32), others))
    )
    order = np.argsort(-grid[rows, cols], kind="stable")[:MAXIMA_MAX]
    rows, cols = rows[order], cols[order]
    at = np.column_stack([fine.x_img[cols], fine.y_img[rows]]) - middle
    along = at @ [math.cos(angle), math.sin(angle)]
    for j in range(1, len(rows)):
        h = float(grid[rows[j], cols[j]])
        deep = max(FINE_VALLEY * h, FINE_PART * noise_px * float(fine.gain[rows[j], cols[j]]))
        _, label = cv2.connectedComponents((grid >= h - deep).astype(np.uint8), connectivity=8)
        if not h > 0.0 or np.any(label[rows[:j], cols[:j]] == label[rows[j], cols[j]]):
            continue
        for i in range(j):
            apart = math.hypot(*(at[j] - at[i]))
            if (
                along[i] * along[j] < 0.0
                and apart <= NEAR * surface.pitch_px
                and abs(along[j] - along[i]) >= ALIGNED * apart
            ):
                two = int(fine.coarse[rows[i], cols[i]]), int(fine.coarse[rows[j], cols[j]])
                return two if two[0] != two[1] else None
    return None


def _grown(surface: Surface, growth: Heights, rows: Places, cols: Places) -> Array:
    """Mean growth of the cells within about a pitch of each grid point."""
    at = np.column_stack([surface.x_img[cols], surface.y_img[rows]])
    d2 = ((at[:, None, :] - surface.rest_img[None, :, :]) ** 2).sum(axis=2)
    weight = np.exp(d2 * (-1.0 / surface.pitch_px**2))
    mean: Array = (weight @ growth) / weight.sum(axis=1)
    return mean


def _summit(grid: Heights, row: int, col: int) -> float:
    """Height of the surface at a maximum between the grid points: a parabola along each axis."""
    top = float(grid[row, col])
    height = top
    for before, after in (
        (grid[max(row - 1, 0), col], grid[min(row + 1, len(grid) - 1), col]),
        (grid[row, max(col - 1, 0)], grid[row, min(col + 1, len(grid) - 1)]),
    ):
        low, high = float(before), float(after)
        if low > top or high > top:  # one of two that the sharper field has
            continue
        bend = 2.0 * top - low - high
        if 0.0 < bend < math.inf:
            height += (high - low) ** 2 / (8.0 * bend)
    return height


def _witnessed(surface: Surface, seen: Mask, middle: Array) -> float:
    """Share of the pins round a place, in px from the grid's corner, that are seen."""
    at = middle + np.array([surface.x_img[0], surface.y_img[0]])
    within = np.hypot(*(surface.rest_img - at).T) <= ROUND_PITCHES * surface.pitch_px
    return float(seen[within].mean()) if within.any() else 0.0


def _groups(grid: Heights, rows: Places, cols: Places, height: Heights, deep: Heights) -> Places:
    """For each maximum (highest first) the first, thus highest, one that no valley parts it from."""
    group = np.arange(len(height))
    for j in range(1, len(height)):
        above = (grid >= height[j] - deep[j]).astype(np.uint8)
        _, label = cv2.connectedComponents(above, connectivity=8)
        joined = np.flatnonzero(label[rows[:j], cols[:j]] == label[rows[j], cols[j]])
        if len(joined):
            group[j] = group[joined[0]]
    return group


def _moments(px: Places, py: Places, excess: Heights, step_px: float) -> tuple[Any, ...]:
    """Middle (2,) px from the grid's corner, long semi-axis px, elongation, angle rad, area px2."""
    weight = excess.astype(
        np.float64
    )  # over the region's edge: what a grid point more or less changes is small
    total = float(weight.sum())
    mx, my = float(px @ weight) / total, float(py @ weight) / total
    dx, dy = px - mx, py - my
    # 1/12: a grid point stands for a square of one step.
    xx = float((dx * dx) @ weight) / total + 1.0 / 12.0
    yy = float((dy * dy) @ weight) / total + 1.0 / 12.0
    xy = float((dx * dy) @ weight) / total
    mean, half = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
    elongation = math.sqrt((mean + half) / max(mean - half, 1e-9))
    angle = 0.5 * math.atan2(2.0 * xy, xx - yy)
    # A uniform ellipse's semi-axis is two standard deviations.
    axis_px = 2.0 * math.sqrt(mean + half) * step_px
    middle = np.array([mx, my]) * step_px
    return middle, axis_px, elongation, angle, len(px) * step_px * step_px


def _place(
    middles: list[Array], i: int, axis_px: float, pitch_px: float, growth: Heights, pins_img: Array
) -> Array:
    """Mean place of the pins round a contact's middle, weighted by their cells' growth."""
    d2 = _distance2(pins_img, middles[i])
    reach = max(REACH * pitch_px, 1.25 * axis_px)
    weight = np.maximum(growth, 0.0) * np.maximum(1.0 - d2 / (reach * reach), 0.0)
    for j, other in enumerate(middles):
        if j != i:
            weight = np.where(_distance2(pins_img, other) < d2, 0.0, weight)
    total = float(weight.sum())
    if not total > 0.0:
        return middles[i]
    place: Array = weight @ pins_img / total
    return place


def _distance2(points: Array, to: Array) -> Array:
    x: Array = points[:, 0] - to[0]
    y: Array = points[:, 1] - to[1]
    return x * x + y * y
