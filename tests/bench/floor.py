"""Lower bound of the time of window centroids: reading the windows' pixels once."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import sysconfig
import tempfile
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from edge.pins.templates import templates_of
from edge.pipeline import Pipeline

__all__ = ["Floor"]


@lru_cache(maxsize=1)
def _library() -> Any:
    """`floor.c`, compiled as the extensions are, for this machine."""
    compiler = (sysconfig.get_config_var("CC") or "cc").split()[0]
    source = Path(__file__).with_name("floor.c")
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "floor.so"
        command = [shutil.which(compiler) or "cc", "-O3", "-march=native", "-shared", "-fPIC"]
        subprocess.run([*command, str(source), "-o", str(library)], check=True)
        loaded = ctypes.CDLL(str(library))
    loaded.read_windows.restype = ctypes.c_uint64
    return loaded


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
        self._read = _library().read_windows

    def read(self, image: np.ndarray) -> int:
        """The sum of the windows' pixels."""
        total: int = self._read(
            ctypes.c_void_p(image.ctypes.data),
            *map(ctypes.c_int64, image.strides[:1]),
            ctypes.c_void_p(self._corner.ctypes.data),
            *map(ctypes.c_int64, (len(self._corner), self._rows, self._columns)),
        )
        return total
