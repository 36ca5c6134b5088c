import numpy as np
from numpy.typing import NDArray

class Mesh:
    """Kept Delaunay triangulation of moving points, and the areas of their Voronoi cells.

    n_points  3 .. 1000000, pins first, then the points that bound them
    n_pins    how many of them want an area
    """

    def __new__(cls, n_points: int, n_pins: int) -> Mesh: ...
    def update(self, points: NDArray[np.float64], areas: NDArray[np.float64], /) -> int:
        """Moves the points and writes the pins' areas; takes any buffers of contiguous doubles.

        points   (n_points, 2)
        areas    (n_pins,), written; in square units of the points; NaN where a cell is not bounded
        Returns  how often the triangles have changed since the beginning
        Raises   ValueError: a coordinate is not finite, all points at one place, wrong size
                 RuntimeError: another thread is at it
        """

    def triangles(self) -> bytes:
        """int32 triples: the triangles that touch a pin and lie inside of the boundary."""

    def counts(self) -> tuple[int, int, int]:
        """(changes, flips, builds) since the beginning."""
