"""Pictures to a video file.

OpenCV does not report a full disk: it goes on and returns nothing. So a finished file is opened again, and
must have as many frames as were written; FFmpeg's own messages, one a frame, are suppressed.
"""

import errno
import os
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from edge.errors import SinkError
from edge.sources.files import quiet_opencv

# OpenCV's wheels encode these (they have no H.264), by suffix; pictures of 1288x716 a second on one core.
CODECS: dict[str, str] = {
    ".mp4": "mp4v",  # 107; every video player, no browser
    ".webm": "VP80",  # 20; browsers
    ".mkv": "FFV1",  # 17; lossless
    ".avi": "MJPG",  # 56; every picture is coded on its own
}


def write_video(pictures: Iterable[NDArray[np.uint8]], path: str | Path, rate_hz: float) -> int:
    """Write BGR pictures of one size to a video. Returns their number.

    Raises  SinkError: unknown suffix, cannot be written, no pictures, another size in the middle;
            OSError: the disk is full. The caller must then remove the file
    """
    path = Path(path)
    if path.suffix.lower() not in CODECS:
        raise SinkError(
            f"video {path}: no format {path.suffix or 'without a suffix'!r}; give {', '.join(CODECS)}"
        )
    with quiet_opencv(), ExitStack() as stack:
        writer, size, n = None, (0, 0), 0
        for drawn in pictures:
            n += 1
            # Video codecs subsample colour: sides must be even.
            even = np.ascontiguousarray(drawn[: drawn.shape[0] & ~1, : drawn.shape[1] & ~1])
            new_size = (even.shape[1], even.shape[0])
            if writer is None:
                size, writer = new_size, _open(path, rate_hz, new_size)
                stack.callback(writer.release)
            elif new_size != size:
                found, wanted = ("{}x{}".format(*one) for one in (new_size, size))
                raise SinkError(f"video {path}: a picture is {found}, not {wanted}")
            writer.write(even)
            if not os.statvfs(path.parent).f_bavail:  # stop early: the rest would be lost
                raise _disk_full(path)
    if not n:
        raise SinkError(f"video {path}: no pictures; give a recording with frames in it")
    with quiet_opencv():
        capture = cv2.VideoCapture(str(path.absolute()), cv2.CAP_FFMPEG)
        written_n = capture.get(cv2.CAP_PROP_FRAME_COUNT) if capture.isOpened() else 0.0
        capture.release()
    if round(written_n) != n:
        raise _disk_full(path)
    return n


def _disk_full(path: Path) -> OSError:
    return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))


def _open(path: Path, rate_hz: float, size: tuple[int, int]) -> cv2.VideoWriter:
    codec = cv2.VideoWriter.fourcc(*CODECS[path.suffix.lower()])
    writer = cv2.VideoWriter(str(path.absolute()), cv2.CAP_FFMPEG, codec, rate_hz or 30.0, size)
    if not writer.isOpened():
        raise SinkError(f"video {path}: cannot be written; give a folder that exists and may be written to")
    return writer
