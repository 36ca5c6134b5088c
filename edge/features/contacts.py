"""Contact places: regional maxima of the compression surface, merged into contacts by prominence.

    grid of heights -> maxima() -> above the threshold -> linked where the saddle between two is
    shallow -> one region a group: place, area, axis, ridge

Idea: a probe makes one maximum; a long edge a chain of them, a flat surface a ring, because the paper's
surface shows the slope of the skin rather than its depth. Maxima with no real valley between them are one
contact: the valley must go down by `VALLEY` of the lower maximum to part them. Opposite points of a ring
do have a valley between, but neighbours on it have none, and links chain.

Rules
- Plateau semantics of MATLAB's `imregionalmax` and `skimage.morphology.local_maxima`: connected grid
  points (8 neighbours) of one height, all of whose other neighbours are lower; a grid of one height has none.
- The region of a contact is what rises above `EDGE` of its highest point: a share of the peak and not a
  fixed height, so that it does not grow with the depth alone.
- Strongest first, `CONTACTS_MAX` at the most.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from edge.features.surface import Surface
from edge.types import Array, ContactRegion, Mask

__all__ = ["find_contacts", "maxima"]

Grid = NDArray[np.float32]

VALLEY = 0.35
EDGE = 0.5
#: A maximum below this share of the highest one is the strongest contact's own ripple.
MINOR = 0.2
CONTACTS_MAX = 8
MAXIMA_MAX = 24
#: Below this ratio of the axes the direction is noise and not reported.
ROUND = 1.15

_BOX = np.ones((3, 3), dtype=np.uint8)
#: Least-squares parabola z = c0 + c1 x + c2 y + c3 x^2 + c4 xy + c5 y^2 through a 3 x 3 neighbourhood.
_XY3 = np.array([(x, y) for y in (-1.0, 0.0, 1.0) for x in (-1.0, 0.0, 1.0)])
_PARABOLA: Array = np.linalg.pinv(
    np.column_stack([np.ones(9), _XY3, _XY3[:, 0] ** 2, _XY3[:, 0] * _XY3[:, 1], _XY3[:, 1] ** 2])
)


def maxima(grid: Grid) -> Mask:
    """Regional maxima, plateaus included.

    grid     (h, w) float32; -inf where there is no value
    Returns  (h, w) bool, equal to skimage.morphology.local_maxima(grid)
    """
    top = cv2.dilate(grid, _BOX, borderType=cv2.BORDER_REPLICATE)
    # Candidates have no higher neighbour. Candidates that touch are equal, for else one would be higher:
    # so the connected candidates are pieces of plateaus, and such a piece is a maximum unless an equal
    # neighbour is no candidate, that is, unless the plateau goes on to where it has a higher neighbour.
    candidate = grid == top
    if candidate.all():
        return np.zeros(grid.shape, dtype=np.bool_)
    rest = np.where(candidate, np.float32(-np.inf), grid)
    spoilt = candidate & (cv2.dilate(rest, _BOX, borderType=cv2.BORDER_REPLICATE) == grid)
    spoilt |= np.isneginf(grid)
    if spoilt.any():
        # A few candidates in a float image; whole plateaus in an integer one.
        _, label = cv2.connectedComponents(candidate.astype(np.uint8), connectivity=8)
        good = np.ones(int(label.max()) + 1, dtype=np.bool_)
        good[label[spoilt]] = False
        good[0] = False
        out: Mask = good[label]
        return out
    return candidate


def find_contacts(grid: Grid, surface: Surface, threshold: float) -> tuple[ContactRegion, ...]:
    """Contacts of one frame, strongest first.

    grid       (g, g) float32, relative area change; -inf outside of the tip's circle
    threshold  contact threshold, relative area change; maxima below it are none
    Source     paper, "Contact Location and Multi-Contact Detection"
    """
    rows, cols = np.nonzero(maxima(grid))
    height = grid[rows, cols]
    if not len(height):
        return ()
    order = np.argsort(-height, kind="stable")[:MAXIMA_MAX]
    order = order[height[order] >= max(threshold, MINOR * float(height[order[0]]))]
    rows, cols, height = rows[order], cols[order], height[order]
    if not len(height):
        return ()
    group = _groups(grid, rows, cols, height) if len(height) > 1 else np.zeros(1, dtype=np.intp)
    owner: NDArray[np.intp] | None = None
    leaders = np.unique(group)[:CONTACTS_MAX]
    py, px = np.nonzero(grid > max(threshold, EDGE * float(height[leaders].min())))
    if len(leaders) > 1:
        d2 = (px[:, None] - cols[None, :]) ** 2 + (py[:, None] - rows[None, :]) ** 2
        owner = group[np.argmin(d2, axis=1)]
    value = grid[py, px]
    found = []
    for leader in leaders:
        mine = value > max(threshold, EDGE * float(height[leader]))
        if owner is not None:
            mine &= owner == leader
        member = group == leader
        found.append(_region(grid, surface, rows[member], cols[member], py[mine], px[mine], value[mine]))
    return tuple(found)


def _groups(grid: Grid, rows: NDArray[np.intp], cols: NDArray[np.intp], height: Grid) -> NDArray[np.intp]:
    """For each maximum (highest first) the index of the highest one it hangs together with."""
    k = len(height)
    i, j = np.triu_indices(k, 1)
    # Lowest height on the straight way between two: sampled at every grid step.
    t = np.linspace(0.0, 1.0, grid.shape[0] + 1)
    y = rows[i, None] + t * (rows[j] - rows[i])[:, None]
    x = cols[i, None] + t * (cols[j] - cols[i])[:, None]
    saddle = grid[np.rint(y).astype(np.intp), np.rint(x).astype(np.intp)].min(axis=1)
    linked = np.eye(k, dtype=np.bool_)
    near = saddle >= (1.0 - VALLEY) * height[j]
    linked[i[near], j[near]] = True
    linked[j[near], i[near]] = True
    for _ in range(max(1, math.ceil(math.log2(k)))):
        linked = linked @ linked
    return np.argmax(linked, axis=1)


def _region(
    grid: Grid,
    surface: Surface,
    rows: NDArray[np.intp],
    cols: NDArray[np.intp],
    py: NDArray[np.intp],
    px: NDArray[np.intp],
    value: Grid,
) -> ContactRegion:
    """One contact from its maxima (highest first) and its grid points."""
    x0, y0, step = float(surface.x_img[0]), float(surface.y_img[0]), surface.step_px
    peak = float(grid[rows[0], cols[0]])
    weight = value.astype(np.float64)
    total = float(weight.sum())
    mx, my = float(px @ weight) / total, float(py @ weight) / total
    if len(rows) == 1:
        x, y, peak = _refine(grid, int(rows[0]), int(cols[0]))
    else:
        x, y = mx, my
    dx, dy = px - mx, py - my
    # 1/12: a grid point stands for a square of one step.
    xx = float((dx * dx) @ weight) / total + 1.0 / 12.0
    yy = float((dy * dy) @ weight) / total + 1.0 / 12.0
    xy = float((dx * dy) @ weight) / total
    mean, half = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
    elongation = math.sqrt((mean + half) / max(mean - half, 1e-9))
    angle = 0.5 * math.atan2(2.0 * xy, xx - yy)
    return ContactRegion(
        xy_img=np.array([x0 + step * x, y0 + step * y]),
        peak=peak,
        area_px2=len(px) * step * step,
        orientation_rad=angle if elongation >= ROUND else math.nan,
        elongation=elongation,
        ridge_img=np.column_stack([x0 + step * cols, y0 + step * rows]),
    )


def _refine(grid: Grid, row: int, col: int) -> tuple[float, float, float]:
    """Place (col, row) and height of the parabola's top at a maximum; the grid point where there is none."""
    if 0 < row < grid.shape[0] - 1 and 0 < col < grid.shape[1] - 1:
        z = grid[row - 1 : row + 2, col - 1 : col + 2].ravel()
        if np.isfinite(z).all():
            c0, cx, cy, xx, xy, yy = (_PARABOLA @ z).tolist()
            det = 4.0 * xx * yy - xy * xy
            if xx < 0.0 and det > 0.0:
                x, y = (xy * cy - 2.0 * yy * cx) / det, (xy * cx - 2.0 * xx * cy) / det
                if abs(x) <= 1.0 and abs(y) <= 1.0:
                    return col + x, row + y, c0 + 0.5 * (cx * x + cy * y)
    return float(col), float(row), float(grid[row, col])
