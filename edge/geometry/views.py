"""Arrays that a kernel is given again in every frame. A kernel; other kernels import it through `views.pxd`.

To take an array, that is to check its type and learn its address, costs a kernel 2,000 instructions. An array
that is the same object as the last time need not be taken again.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import cython

from edge.types import Array


@cython.final
@cython.cclass
class PointsView:
    """Of one array (n, k) float64."""

    def __init__(self) -> None:
        self.array: Array | None = None

    def of(self, array: Array) -> Array:
        """The array's memory. Raises ValueError: it is of another type."""
        if array is not self.array:
            self.view = array
            self.array = array
        return self.view
