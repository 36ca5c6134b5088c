"""Contact places: regional maxima of the skin's stretch, merged into contacts by prominence.

    relief on a grid -> maxima() -> above the noise -> joined where no valley parts them
                      -> one region a group: place, area, axis, ridge

Idea: a probe makes one maximum, a long edge a chain of them, a flat surface a ring or a rough plateau.
Maxima with no real valley between them are one contact: to part them the surface must go down by `VALLEY`
of the lower one on every way from one to the other. That is topographic prominence, relative.

The surface is a blend: 0.7 of the divergence of the pins' motion (`Surface.stretch`), 0.3 of the surface
through the cells' areas. The divergence is sharp: of random pairs of probes 4 mm apart, 331 pins of 2.1 mm
pitch, simulated, it parts 88 %, the areas 12 %, since a cell's area averages over two pitches. But areas
are the steadier of the two where pins are badly seen: on the published webcam videos the divergence alone
breaks single touches up more often. The mixture parts 85 %, never breaks a simulated edge (1 % before).

Rules
- Plateau semantics of MATLAB's `imregionalmax` and `skimage.morphology.local_maxima`: connected grid
  points (8 neighbours) of one height, all of whose other neighbours are lower; a grid of one height has none.
- The region of a contact is what rises above `EDGE` of its highest point: a share of the peak and not a
  fixed height, so that it does not grow with the depth alone.
- Cells bear witness: round a maximum they have grown too. At the rim, where the surface has pins on one
  side only, a single pin's noise is a slope and a slope a maximum, but no cell has grown there.
- A contact's place is where its pins are now, weighted by how much their cells have grown: the pull of
  a shear on the pattern of growth and its pull on the pins nearly cancel in it.
- Strongest first, `CONTACTS_MAX` at the most.
"""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

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


def find_contacts(
    relief: Heights, surface: Surface, threshold: Heights, growth: Heights, pins_img: Array
) -> tuple[ContactRegion, ...]:
    """Contacts of one frame, strongest first.

    relief     (k,) float32, of `blend`, at the surface's points: relative area change
    threshold  (k,) float32, what a maximum must rise above to count
    growth     (n,) float32, relative area change of each pin's cell
    pins_img   (n, 2) px, where each pin is now; finite
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
    group = _groups(grid, rows, cols, height)
    leaders = np.flatnonzero(group == np.arange(len(group)))[:CONTACTS_MAX]
    py, px = np.nonzero(grid > EDGE * float(height[leaders[-1]]))
    value = grid[py, px]
    owner = np.zeros(len(px), dtype=np.intp)
    if len(leaders) > 1:
        d2 = (px[:, None] - cols[None, :]) ** 2 + (py[:, None] - rows[None, :]) ** 2
        owner = group[np.argmin(d2, axis=1)]
    origin = np.array([surface.x_img[0], surface.y_img[0]])
    shapes, middles = [], []
    for leader in leaders:
        level = EDGE * float(height[leader])
        mine = (owner == leader) & (value > level)
        middle, *shape = _moments(px[mine], py[mine], value[mine] - np.float32(level), surface.step_px)
        shapes.append(shape)
        middles.append(middle + origin)
    found = []
    for i, leader in enumerate(leaders):
        axis_px, elongation, angle, area = shapes[i]
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
        bend = 2.0 * top - low - high
        if 0.0 < bend < math.inf:
            height += (high - low) ** 2 / (8.0 * bend)
    return height


def _groups(grid: Heights, rows: Places, cols: Places, height: Heights) -> Places:
    """For each maximum (highest first) the first, thus highest, one that no valley parts it from."""
    group = np.arange(len(height))
    for j in range(1, len(height)):
        above = (grid >= np.float32(1.0 - VALLEY) * height[j]).astype(np.uint8)
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
