"""Pins to bounded Voronoi cells: the area that belongs to each pin.

Idea (paper, "Construction of Voronoi Cell Data"): artificial points round the pins, denser than the
pins, bound the cells of the outer pins; the cells of the artificial points themselves are discarded.

Rules
- The boundary follows the outline of the pins on the rest frame, one pitch outside of them, for any layout,
  and moves with the rim (`boundary`). Rest areas are computed by the same rule at zero motion.
- A pin's area is the area of its Voronoi cell among pins and artificial points. The bounded polygon is
  the set of places nearer to a pin than to an artificial point; its area is the sum of all pins' areas.
- A lost pin is put where its neighbours predict it (the most likely place, exact for affine motion), so that
  its cell does not go to them. Its own area is NaN.
- Pins at the same place share their cell in equal parts. A pin that broke through the boundary has no bounded
  cell: NaN.
- Decisions and areas are as exact as `edge.cells.mesh` says; the triangulation is kept from frame to frame.
"""

from edge.cells.tessellator import Tessellator, cell_polygons

__all__ = ["Tessellator", "cell_polygons"]
