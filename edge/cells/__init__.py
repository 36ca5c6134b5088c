"""Pins to bounded Voronoi cells: the area that belongs to each pin.

Idea (paper, "Construction of Voronoi Cell Data"): artificial points round the pins, denser than the
pins, bound the cells of the outer pins; the cells of the artificial points themselves are discarded.

Rules
- The boundary moves with the rim (`boundary`). Rest areas are computed by the same rule at zero motion.
- The bounded polygon is the set of places nearer to a pin than to an artificial point; its area is the sum of
  all pins' areas. A pin that broke through the boundary has no bounded cell: NaN.
- A lost pin is put where the others predict it (`missing`), so that its cell does not go to them. Its own
  area is NaN.
- Decisions and areas are as exact as `mesh` says, which keeps the triangulation from frame to frame.
"""

from edge.cells.tessellator import Tessellator, cell_polygons

__all__ = ["Tessellator", "cell_polygons"]
