"""Lower bound of the time of window centroids: reading the windows' pixels once."""

import ctypes

import numpy as np

from edge.frame import Pipeline
from edge.pins.templates import templates_of
from tests.bench.compiled import compiled

__all__ = ["Floor"]


class Floor:
    """Reads the windows of one tip's pins at rest; windows that the image cuts are moved inside."""

    def __init__(self, pipeline: Pipeline) -> None:
        pattern, radius_px = pipeline.rest.pattern, float(pipeline.rest.pins.radius_px.max())
        half = max(templates_of((radius_px,), pattern.edge_px, pattern.pitch_px).half)
        self._rows = 2 * half + 1
        self._columns = min(-(-self._rows // 8) * 8, 32)
        corner = np.rint(pipeline.rest.xy_img).astype(np.int32) - half
        margin = np.array(pipeline.rest.pattern.size_px) - [self._columns, self._rows]
        self._corner = np.clip(corner, 0, margin).astype(np.int32)
        self._read = compiled("floor.c", "-march=native").read_windows
        self._read.restype = ctypes.c_uint64

    def read(self, image: np.ndarray) -> int:
        """The sum of the windows' pixels."""
        total: int = self._read(
            ctypes.c_void_p(image.ctypes.data),
            *map(ctypes.c_int64, image.strides[:1]),
            ctypes.c_void_p(self._corner.ctypes.data),
            *map(ctypes.c_int64, (len(self._corner), self._rows, self._columns)),
        )
        return total
