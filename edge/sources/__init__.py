"""Where frames come from. One door: `open_source(spec)`.

    press.mcap, bag/, a.db3     a recording: MCAP, or a bag of ROS 2
    north.avi, frames/, a.png   a video, a folder of images, one image
    v4l2:0, /dev/video0         a UVC or other V4L2 camera; also v4l2:SERIAL, v4l2:NAME, /dev/v4l/by-id/...
    oak:, oak:MXID              an OAK module, through depthai
    picamera:0                  a Raspberry Pi's CSI camera, through picamera2
    sim:...                     the simulator
    example:press               a recording that every installation has

Each takes options after a question mark: `north.avi?pins=dark`, `v4l2:0?rate_hz=120&lens=lens.toml`,
`a.png?roi=40,30,560,420` (`region`).

Further schemes come from installed packages through the entry point group `voronoi_touch.sources`: a
callable `(where, options) -> FrameSource`, named as the scheme. The simulator is found that way too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from edge.errors import SourceError
from edge.limits import RATE_MIN_HZ
from edge.sources.files import IMAGE_SUFFIXES
from edge.sources.lens_file import lens_for
from edge.sources.options import Options, Spec, parse_spec
from edge.sources.region import region_of
from edge.types import FrameSource

if TYPE_CHECKING:
    from importlib.metadata import EntryPoints

GROUP = "voronoi_touch.sources"
Opener = Callable[[str, Options], FrameSource]

#: Module and function of each scheme, imported when it is first used.
_BUILT_IN = {
    "images": "edge.sources.files:open_images",
    "video": "edge.sources.files:open_video",
    "v4l2": "edge.sources.v4l2:open_v4l2",
    "oak": "edge.sources.oak:open_oak",
    "picamera": "edge.sources.picamera:open_picamera",
    "mcap": "edge.recording.reader:open_recording",
    "example": "edge.recording.reader:open_example",
}
_RECORDINGS = (".mcap", ".db3")
_FROM_EXTRA = {"sim": "voronoi-touch[calib]"}


def _from_packages(name: str | None = None) -> EntryPoints:
    from importlib.metadata import entry_points  # reads mail headers: 10 ms that no camera has to wait for

    found = entry_points(group=GROUP)
    return found if name is None else found.select(name=name)


def _opener(spec: Spec) -> Opener:
    if spec.scheme in _BUILT_IN:
        module, _, name = _BUILT_IN[spec.scheme].partition(":")
        opener: Opener = getattr(import_module(module), name)
        return opener
    for point in _from_packages(name=spec.scheme):
        try:
            opener = point.load()
            return opener
        except ImportError as error:
            hint = _FROM_EXTRA.get(spec.scheme, f"the package of {point.value}")
            raise SourceError(f"source {spec.text}: {error}; install {hint}") from error
    if spec.scheme in _FROM_EXTRA:
        raise SourceError(f"source {spec.text}: not installed here; install {_FROM_EXTRA[spec.scheme]}")
    known = ", ".join(f"{name}:" for name in sorted({*_BUILT_IN, *_from_packages().names}))
    raise SourceError(f"source {spec.text!r}: no scheme {spec.scheme!r}; known: {known}")


def _exists(where: str) -> bool:
    try:
        return bool(where) and Path(where).exists()
    except (OSError, ValueError):  # longer than a path may be, or with a zero byte
        return False


def _scheme_of(where: str) -> str:
    """Scheme of a plain path. Raises SourceError: it does not exist."""
    path = Path(where)
    if where.startswith(("/dev/video", "/dev/v4l/")):
        return "v4l2"
    if not _exists(where):
        raise SourceError(
            f"source {where}: no such file or folder; give a recording, a folder or e.g. v4l2:0"
        )
    if path.suffix.lower() in _RECORDINGS:
        return "mcap"
    if (path / "metadata.yaml").is_file() and any(file.suffix in _RECORDINGS for file in path.iterdir()):
        return "mcap"  # a bag
    return "images" if path.is_dir() or path.suffix.lower() in IMAGE_SUFFIXES else "video"


def open_source(spec: str, **settings: Any) -> FrameSource:
    """Open whatever `spec` names.

    settings  fields of `Options`: width, height, rate_hz, exposure_us, gain, focus, format, ...
    Raises    SourceError: one line: what is wrong, where, and what would be right
    """
    plain = parse_spec(spec, Options(**settings))
    if 0 < plain.options.rate_hz < RATE_MIN_HZ:
        rate_hz = plain.options.rate_hz
        raise SourceError(f"source {spec}: rate_hz={rate_hz:g}: give 0 (its own) or {RATE_MIN_HZ:g} and more")
    if _exists(spec):  # a file may have a colon or a question mark in its name
        plain = Spec(spec, _scheme_of(spec), spec, Options(**settings))
    elif not plain.scheme:
        plain = replace(plain, scheme=_scheme_of(plain.where))
    source = _opener(plain)(plain.where, plain.options)
    source.polarity = plain.options.pins
    try:
        source.lens = lens_for(source, plain.options.lens)
        parts = plain.options.roi, plain.options.circle, plain.options.mask
        source.region = region_of(source.name, source.size_px, *parts) if any(parts) else None
    except SourceError:
        source.close()
        raise
    return source
