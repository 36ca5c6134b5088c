"""A smooth surface through values at the pins, evaluated on a regular grid over the tip's circle.

Idea: with the knots at the pins' rest positions, interpolation is linear in the values: one constant
matrix, made once, turns the area changes of a frame into the grid's heights. The interpolant is the
thin-plate (biharmonic) spline, the surface of least bending through the values, MATLAB's `griddata 'v4'`.
The paper's cubic (Clough-Tocher, `griddata 'cubic'`) at the current positions is the oracle in the
benchmarks; the measured difference stands beside the choice of the grid below.

Rules
- Heights are relative area changes of material cells, at the cells' rest places: the surface is fixed to
  the skin. Where a point of it lies in the current image is `contacts`' business.
- A lost pin takes the mean of its seen neighbours: never higher than they, so it makes no maximum.
- With a fixed boundary the areas sum to a constant and so does the plain integral. The volume is
  therefore that of the compressed (positive) part. Rectified noise has a positive mean; heights below the
  noise's threshold count nothing, those above twice the threshold count whole (firm shrinkage), so an
  untouched tip has volume zero and a pressed one no bias.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from edge.types import Array, Mask, Rest

__all__ = ["Surface", "firm", "thin_plate_operator"]

#: Steps of the grid per pin pitch.
STEPS_PER_PITCH = 1.5
GRID_MIN, GRID_MAX = 16, 64


def thin_plate_operator(knots: Array, points: Array) -> Array:
    """Matrix M with M @ values(knots) = thin-plate spline at points.

    knots    (n, 2) and points (m, 2), same unit; n >= 3, not all on a line
    Returns  (m, n) float64
    Source   Duchon 1977; Wahba, Spline Models for Observational Data, 1990, section 2.4
    """
    centre = knots.mean(axis=0)
    scale = float(np.sqrt(((knots - centre) ** 2).sum(axis=1).mean()))
    x, p = (knots - centre) / scale, (points - centre) / scale
    n = len(x)
    system = np.zeros((n + 3, n + 3))
    system[:n, :n] = _kernel(x, x)
    system[:n, n:] = np.column_stack([np.ones(n), x])
    system[n:, :n] = system[:n, n:].T
    right = np.hstack([_kernel(p, x), np.ones((len(p), 1)), p])
    # The system is symmetric: (S^-1 right^T)^T = right S^-1; values fill the first n rows of its input.
    return np.ascontiguousarray(np.linalg.solve(system, right.T)[:n].T)


def _kernel(a: Array, b: Array) -> Array:
    """r^2 log r, zero at r = 0."""
    r2 = ((a[:, None, :] - b[None, :, :]) ** 2).sum(axis=2)
    out: Array = 0.5 * r2 * np.log(np.where(r2 > 0.0, r2, 1.0))
    return out


def firm(height: NDArray[np.float32], threshold: float) -> NDArray[np.float32]:
    """Heights above twice the threshold as they are, those below it zero, a straight line between.

    Source  Gao and Bruce, WaveShrink with firm shrinkage, Statistica Sinica 7, 1997
    """
    ramp = np.maximum(height - np.float32(threshold), np.float32(0.0))
    ramp += ramp
    np.minimum(ramp, height, out=ramp)
    return np.maximum(ramp, np.float32(0.0), out=ramp)


class Surface:
    """The constant operator of one tip.

    size     g, points of the grid along x and y
    x_img    (g,) px, and y_img (g,) px: places of the grid's columns and rows
    step_px  distance of neighbouring grid points
    inside   (g, g) bool: within the tip's circle
    """

    def __init__(self, rest: Rest, size: int | None = None) -> None:
        pattern = rest.pattern
        radius = pattern.tip_radius_px
        if size is None:
            wanted = round(2.0 * radius / pattern.pitch_px * STEPS_PER_PITCH) + 1
            size = min(max(wanted, GRID_MIN), GRID_MAX)
        self.size = size
        line = np.linspace(-radius, radius, size)
        self.step_px = float(line[1] - line[0])
        self.x_img, self.y_img = line + pattern.centre_img[0], line + pattern.centre_img[1]
        self.inside: Mask = line[None, :] ** 2 + line[:, None] ** 2 <= radius * radius
        self._flat = np.flatnonzero(self.inside)
        points = np.column_stack([self.x_img[self._flat % size], self.y_img[self._flat // size]])
        # Single precision: 1e-7 of the height against noise of 1e-3, and half the memory to stream.
        self._operator = thin_plate_operator(rest.xy_img, points).astype(np.float32)
        d2 = ((rest.xy_img[:, None, :] - rest.xy_img[None, :, :]) ** 2).sum(axis=2)
        # Neighbours within about a pitch count, those at two pitches for 2 %.
        self._near = np.exp(-d2 / pattern.pitch_px**2).astype(np.float32)

    def fill(self, change: Array) -> NDArray[np.float32]:
        """Area changes with the gaps of lost pins closed by their neighbours' weighted mean.

        change   (n,) relative area change, NaN where lost
        Returns  (n,) float32, finite
        """
        value = change.astype(np.float32)
        lost = np.flatnonzero(np.isnan(value))
        if len(lost):
            seen = np.ones(len(value), dtype=np.float32)
            seen[lost] = 0.0
            value[lost] = 0.0
            near = self._near[lost]
            value[lost] = (near @ value) / np.maximum(near @ seen, np.float32(1e-6))
        return value

    def heights(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """Heights at the grid points inside of the circle, row by row.

        values   (n,) float32, one a pin, finite
        Returns  (k,) float32, new
        """
        out: NDArray[np.float32] = self._operator @ values
        return out

    def spread(self, heights: NDArray[np.float32], outside: float) -> NDArray[np.float32]:
        """Heights laid out as the (g, g) grid, `outside` beyond the circle; new array."""
        grid = np.full(self.size * self.size, outside, dtype=np.float32)
        grid[self._flat] = heights
        return grid.reshape(self.size, self.size)

    def volume_px2(self, heights: NDArray[np.float32], threshold: float) -> float:
        """Integral of the compressed part: relative area change times px2."""
        return float(firm(heights, threshold).sum()) * self.step_px * self.step_px
