import numpy as np
from numpy.typing import NDArray

from edge.types import Array, Index

def place(
    xy: Array,
    rest: Array,
    ring: tuple[Index, Array, Array, Array],
    gap: tuple[Index, Array, Array],
    points: Array,
    /,
) -> None:
    """Writes the points of a frame: the pins, lost ones filled in, and the points round them.

    xy, rest  (n, 2); of `xy`, lost rows are not used
    ring      rim (r,), its weights (r, b) in the motion of the points round, these at rest (b, 2), and
              scratch (2, b)
    gap       the lost pins (m,) ascending, their rows (m, n) of the bending matrix, and the inverse (m, m) of
              its block
    points    (n + b, 2), written
    Raises    ValueError: no such pin, none left, wrong sizes
    """

class Mesh:
    """Kept Delaunay triangulation of moving points, and the areas of their Voronoi cells.

    n_pins      how many points want an area; they come first
    n_boundary  how many points after them bound the pins' cells
    n_fence     how many after those stand round the boundary; a cell that reaches them is not bounded
    """

    def __new__(cls, n_pins: int, n_boundary: int, n_fence: int = 0) -> Mesh: ...
    def update(self, points: NDArray[np.float64], areas: NDArray[np.float64], /) -> int:
        """Moves the points and writes the pins' areas; takes any buffers of contiguous doubles.

        points   (n_pins + n_boundary + n_fence, 2)
        areas    (n_pins,), written; in square units of the points; NaN where a cell is not bounded
        Returns  how often the triangles have changed since the beginning
        Raises   ValueError: a coordinate is not finite, all points at one place, wrong size
                 RuntimeError: another thread is at it
        """

    def triangles(self) -> bytes:
        """int32 triples: the triangles that touch a pin and not the fence."""

    def counts(self) -> tuple[int, int, int]:
        """(changes, flips, builds) since the beginning."""
