"""A smooth surface over the tip's circle: the regular grid, and the constant matrices from pins to grid.

Idea: with the knots at the pins' rest positions, interpolation is linear in the values: one constant
matrix, made once, turns the area changes of a frame into the grid's heights. The interpolant is the
thin-plate (biharmonic) spline, MATLAB's `griddata 'v4'`. The paper's cubic (Clough-Tocher, `griddata
'cubic'`) at the current positions is the oracle in the benchmarks: at rest its heights are 0.3 % of the peak
off, and its volume is 1.43 times ours, to within 1.7 % of full scale.

The divergence of the same spline through the pins' motion is the relative area change too, but at a point
rather than of a whole cell, and it needs no cells. It separates contacts two pitches apart, which areas show
as one. So contacts are searched for in it (`contact_field` has the arithmetic of a frame); the volume needs
no grid (`area_change`).

Heights are relative area changes of material cells, at the cells' rest places: the surface is fixed to the
skin. `contacts` finds where a contact lies in the current image.
"""

import numpy as np

from edge.features.contact_field import ContactField
from edge.features.params import PARAMS
from edge.geometry.thin_plate import thin_plate_operators
from edge.types import Array, Heights, Mask, PinPattern, Rest


def grid_line(pattern: PinPattern, size: int | None = None) -> Array:
    """(g,) px from the middle of the tip's circle, columns and rows of its grid; None: by the pitch."""
    radius = pattern.tip_radius_px
    if size is None:
        wanted = round(2.0 * radius / pattern.pitch_px * PARAMS.grid_steps_per_pitch) + 1
        size = max(wanted, PARAMS.grid_min)
    return np.linspace(-radius, radius, size)


class Surface:
    """The grid of one tip, and the fields of a frame on it.

    x_img, y_img      (g,) px: places of the grid's columns and rows; `grid_img` are both
    step_px           distance of neighbouring grid points
    inside            (g, g) bool: within the tip's circle; "the k points" are these, row by row
    points_img        (k, 2) px
    divergence_noise  (k,) float32, noise of `divergence` per px of a pin's
    field             what computes the fields

    size              g, points along x and y; None: chosen from the pitch
    Raises            DegenerateLayout: fewer than 3 pins, or all on a line
    """

    def __init__(self, rest: Rest, size: int | None = None) -> None:
        pattern = rest.pattern
        radius = pattern.tip_radius_px
        self.pitch_px = pattern.pitch_px
        self.rest_img = np.ascontiguousarray(rest.xy_img)
        line = grid_line(pattern, size)
        self.step_px = float(line[1] - line[0])
        self.grid_img = self.x_img, self.y_img = line + pattern.centre_img[0], line + pattern.centre_img[1]
        self.inside: Mask = line[None, :] ** 2 + line[:, None] ** 2 <= radius * radius
        row, column = np.nonzero(self.inside)
        self.points_img = np.column_stack([self.x_img[column], self.y_img[row]])
        value, along_x, along_y = thin_plate_operators(rest.xy_img, self.points_img)
        # x and y interleaved, like the motion's rows: one product.
        divergences = np.stack([along_x, along_y], axis=2).reshape(len(value), -1)
        self.divergence_noise: Heights = np.sqrt((divergences**2).sum(axis=1)).astype(np.float32)
        self.field = ContactField(self.rest_img, self.pitch_px, self.points_img, value, divergences)

    def picture(self) -> Array:
        """The surface through the area changes set in `field`: (g, g) float64, NaN beyond the circle; new."""
        grid = np.full(self.inside.shape, np.nan)
        grid[self.inside] = self.field.whole_surface()
        return grid
