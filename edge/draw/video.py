"""Pictures to a video file."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from edge.errors import SinkError

__all__ = ["CODECS", "render"]

# What OpenCV's wheels encode (they have no H.264), by suffix; pictures of 1288x716 a second on one core.
CODECS: dict[str, str] = {
    ".mp4": "mp4v",  # 107; every video player, no browser
    ".webm": "VP80",  # 20; browsers
    ".mkv": "FFV1",  # 17; lossless
    ".avi": "MJPG",  # 56; every picture stands alone
}


def render(pictures: Iterable[NDArray[np.uint8]], path: str | Path, rate_hz: float) -> int:
    """Write BGR pictures of one size to a video. Returns how many.

    Raises  SinkError: unknown suffix, cannot be written, no pictures, another size in the middle
    """
    path = Path(path)
    if path.suffix.lower() not in CODECS:
        raise SinkError(
            f"video {path}: no format {path.suffix or 'without a suffix'!r}; give {', '.join(CODECS)}"
        )
    writer: cv2.VideoWriter | None = None
    size = (0, 0)
    n = 0
    try:
        for drawn in pictures:
            # Video codecs subsample colour: sides must be even.
            even = drawn[: drawn.shape[0] & ~1, : drawn.shape[1] & ~1]
            if writer is None:
                size = (even.shape[1], even.shape[0])
                writer = _open(path, rate_hz, size)
            elif (even.shape[1], even.shape[0]) != size:
                raise SinkError(
                    f"video {path}: picture {n} is {even.shape[1]}x{even.shape[0]}, not {size[0]}x{size[1]}"
                )
            writer.write(np.ascontiguousarray(even))
            n += 1
    finally:
        if writer is not None:
            writer.release()
    if not n:
        raise SinkError(f"video {path}: no pictures; give a recording with frames in it")
    return n


def _open(path: Path, rate_hz: float, size: tuple[int, int]) -> cv2.VideoWriter:
    codec = cv2.VideoWriter.fourcc(*CODECS[path.suffix.lower()])
    writer = cv2.VideoWriter(str(path.absolute()), cv2.CAP_FFMPEG, codec, rate_hz or 30.0, size)
    if not writer.isOpened():
        raise SinkError(f"video {path}: cannot be written; give a folder that exists and may be written to")
    return writer
