"""Recordings as videos and as folders of images.

Opening reads the first image, so that a bad file is one clear line before anything starts. Damage further on
is counted in `faults`, and reading goes on.
"""

import os
import re
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
from cv2.utils import logging

from edge.errors import SourceError
from edge.limits import RATE_MAX_HZ
from edge.sources.image_header import check_size, is_cut_off
from edge.sources.live import PARAMS as LIVE
from edge.sources.live import rate_of
from edge.sources.options import NoKeys, Options
from edge.sources.pixels import decode_colour, decode_picture, to_grey
from edge.types import Clock, Frame, FrameSource, Image
from hostlink.input_file import read_bounded

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".webp")
_DEPTHS = (8, 10, 12, 14, 16)  # bits of a sensor's pixel
_GIVE = f"give {', '.join(IMAGE_SUFFIXES)}"

#: FFmpeg's names of grey that OpenCV gives as it is, of 8 and 16 bits; all else becomes colour of 8 bits.
_GREY_FORMATS = [int.from_bytes(name, "little") for name in (b"Y800", b"Y1\0\x10")]

os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # damage is counted here, not printed by FFmpeg


@contextmanager
def quiet_opencv() -> Iterator[None]:
    """Suppress OpenCV's own messages: the error is reported by us, in one line."""
    level = logging.getLogLevel()
    logging.setLogLevel(logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        logging.setLogLevel(level)


def _natural(path: Path) -> list[tuple[int, int, str]]:
    """frame_2 before frame_10."""
    parts = re.split(r"(\d+)", path.name.lower())
    return [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in parts if part]


def _read_image(path: Path) -> Image:
    """Raises ValueError: not an image."""
    try:
        data = read_bounded(path)
    except IsADirectoryError:
        raise ValueError("is a folder; give the images in it, one by one") from None
    except FileNotFoundError:
        raise ValueError("no such file") from None
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror}") from None
    try:
        with quiet_opencv():
            return decode_picture(data)
    except ValueError as error:
        advice = "" if ";" in str(error) else f"; {_GIVE}"  # it may have its own
        raise ValueError(f"{error}{advice}") from None


def read_image(path: str | Path) -> Image:
    """One grey image. Raises SourceError: does not exist, not an image."""
    try:
        return _read_image(Path(path))
    except ValueError as error:
        raise SourceError(f"image {path}: {error}") from error


def growing(frames: Iterable[Frame], rate_hz: float) -> Iterator[Frame]:
    """The frames with times that grow: shifted while they are not later than those before, a repeated one by
    half a period, so that the next one may be as it is.
    """
    last_ns, shift_ns = -1, 0
    for frame in frames:
        own_ns = frame.capture_ns
        if own_ns > last_ns:
            shift_ns = 0
        elif own_ns + shift_ns <= last_ns:
            shift_ns = last_ns + max(1, round(0.5e9 / rate_hz)) - own_ns
        last_ns = own_ns + shift_ns
        yield replace(frame, capture_ns=last_ns)


class FileSource(FrameSource, ABC):
    """The base of all recordings. Each iteration starts from the beginning."""

    live = False
    keeps_colour = False  # in `Frame.colour`
    frames_n = 0  # images in it; 0: not known before it has been read

    def __init__(self, kind: str, path: str | Path) -> None:
        self.path = Path(path)
        self.name = f"{kind} {self.path}"
        self.faults: Counter[str] = Counter()  # how often each damage was met, in the last reading
        self._bits = 0  # of a pixel, by the first image
        self._closed = False

    def _bits_of(self, image: Image) -> int:
        """Bits of a pixel that count, where the file does not say so: as many as the first image needs."""
        largest = int(image.max())
        self._bits = self._bits or next(bits for bits in _DEPTHS if not largest >> bits)
        return 8 * image.itemsize if largest >> self._bits else self._bits

    @abstractmethod
    def _frames(self, faults: Counter[str]) -> Iterator[Frame]:
        """The frames from the beginning, with their own times; damage is counted."""

    def __iter__(self) -> Iterator[Frame]:
        self.faults = Counter()
        for frame in growing(self._frames(self.faults), self.rate_hz or LIVE.stills_hz):
            if self._closed:
                return
            yield frame.within(self.region)

    def close(self) -> None:
        self._closed = True


class FolderSource(FileSource):
    """A folder of images in natural order, or one image. Raises SourceError: none to begin with."""

    def __init__(self, path: str | Path, rate_hz: float = 0.0) -> None:
        super().__init__("images", path)
        self.rate_hz = rate_hz or LIVE.stills_hz
        if self.path.is_dir():
            found = [p for p in self.path.iterdir() if p.suffix.lower() in IMAGE_SUFFIXES and p.is_file()]
            self.paths = sorted(found, key=_natural)
        elif self.path.is_file():
            self.paths = [self.path]
        else:
            raise SourceError(f"{self.name}: no such file or folder; give a folder of images or a recording")
        self.frames_n = len(self.paths)
        if not self.paths:
            raise SourceError(f"{self.name}: no images in it; {_GIVE}")
        try:
            image = _read_image(self.paths[0])
        except ValueError as error:
            where = self.name if self.path.is_file() else f"{self.name}: {self.paths[0].name}"
            raise SourceError(f"{where}: {error}") from error
        self.size_px = (image.shape[1], image.shape[0])
        self._bits_of(image)

    def _frames(self, faults: Counter[str]) -> Iterator[Frame]:
        """Raises SourceError on the way if an image has another size: one tip has one camera."""
        for n, path in enumerate(self.paths):
            try:
                image = _read_image(path)
            except ValueError:
                faults["damaged frame"] += 1
                continue
            if image.shape[::-1] != self.size_px:
                raise SourceError(
                    f"{self.name}: {path.name} is {image.shape[1]}x{image.shape[0]}, the first one "
                    f"{self.size_px[0]}x{self.size_px[1]}; keep one size in a folder"
                )
            capture_ns = round(n * 1e9 / self.rate_hz)
            colour = decode_colour(read_bounded(path)) if self.keeps_colour else None
            yield Frame(image, capture_ns, n, Clock.RECORDED, self._bits_of(image), colour=colour)


class VideoSource(FileSource):
    """A video file, through OpenCV's FFmpeg.

    rate_hz  0: the file's own, measured from its first images if they do not come at the stated rate
    Raises   SourceError: does not exist, not a video, no frame in it
    """

    def __init__(self, path: str | Path, rate_hz: float = 0.0) -> None:
        super().__init__("video", path)
        capture = self._open()
        try:
            stated_n = int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
            # An estimate in some files; a frame takes a byte at least.
            self.frames_n = max(0, min(stated_n, self.path.stat().st_size))
            stated_hz = float(capture.get(cv2.CAP_PROP_FPS))
            sides = (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)
            check_size(*(int(capture.get(side)) for side in sides))
            ok, image = capture.read()
            times_ms = [float(capture.get(cv2.CAP_PROP_POS_MSEC))]
            while len(times_ms) <= LIVE.rate_frames_n and capture.grab():
                times_ms.append(float(capture.get(cv2.CAP_PROP_POS_MSEC)))
        except ValueError as error:
            raise SourceError(f"{self.name}: {error}") from None
        finally:
            capture.release()
        if not ok:
            raise SourceError(f"{self.name}: no frame can be decoded; give a complete video")
        stated_hz = stated_hz if 0 < stated_hz < RATE_MAX_HZ else LIVE.stills_hz
        measured_hz = rate_of(times_ms, 1e3) or stated_hz
        self._own_times = not rate_hz and max(times_ms) > times_ms[0]
        mean_hz = (len(times_ms) - 1) * 1e3 / max(1e-3, times_ms[-1] - times_ms[0])  # of a variable rate
        as_stated = any(LIVE.slow_rel < hz / stated_hz < 1 / LIVE.slow_rel for hz in (measured_hz, mean_hz))
        self.rate_hz = rate_hz or (stated_hz if as_stated else measured_hz)
        self.size_px = (image.shape[1], image.shape[0])

    def _open(self) -> Any:
        if not self.path.is_file():
            is_there = "a folder" if self.path.is_dir() else "a pipe or a device"
            what = is_there if self.path.exists() else "no such file"
            raise SourceError(f"{self.name}: {what}; give a video file or a recording")
        with quiet_opencv():
            # The path is absolute: FFmpeg takes the start of a name with a colon for a protocol
            capture = cv2.VideoCapture(str(self.path.absolute()), cv2.CAP_FFMPEG)
        if not capture.isOpened():
            raise SourceError(f"{self.name}: not a video; give avi, mp4, mkv, or an MCAP recording")
        capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
        if int(capture.get(cv2.CAP_PROP_CODEC_PIXEL_FORMAT)) in _GREY_FORMATS:
            capture.set(cv2.CAP_PROP_CONVERT_RGB, 0)
        return capture

    def _frames(self, faults: Counter[str]) -> Iterator[Frame]:
        capture = self._open()
        n = bad_n = 0
        try:
            while not self._closed:
                ok, image = capture.read()
                if not ok:
                    bad_n += 1
                    if n + bad_n < self.frames_n and bad_n < LIVE.first_s * self.rate_hz:
                        continue  # it may go on behind the damage
                    if n < self.frames_n and is_cut_off(self.path):
                        faults["truncated"] = 1
                    return
                if bad_n:
                    faults["damaged frame"] += bad_n
                    n, bad_n = n + bad_n, 0
                own_ms = float(capture.get(cv2.CAP_PROP_POS_MSEC))
                capture_ns = round(own_ms * 1e6 if self._own_times else n * 1e9 / self.rate_hz)
                grey = to_grey(image)
                colour = image if self.keeps_colour and image.ndim == 3 else None
                yield Frame(grey, capture_ns, n, Clock.RECORDED, self._bits_of(grey), colour=colour)
                n += 1
        finally:
            capture.release()


def open_images(where: str, options: Options) -> FolderSource:
    options.own(where, NoKeys)
    return FolderSource(where, options.rate_hz)


def open_video(where: str, options: Options) -> VideoSource:
    options.own(where, NoKeys)
    return VideoSource(where, options.rate_hz)
