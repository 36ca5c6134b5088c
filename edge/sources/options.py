"""How a source is requested: a specification, and settings that every kind of source understands.

v4l2:0?exposure_us=2000&format=GREY
----  - ---------------------------
scheme where  keys; they win over the settings given in code or configuration
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any
from urllib.parse import parse_qsl

from edge.errors import SourceError
from edge.limits import IMAGE_SIDE_PX, NUMBER_MAX, RATE_MAX_HZ
from edge.types import Polarity

#: Dark or bright for every source; other values are the source's own: a number for the simulator.
_SHARED = "pins"


@dataclass(frozen=True, slots=True)
class Options:
    """width, height  px; 0: the camera's own
    gain           in the camera's own unit (V4L2 control, ISO for OAK, a factor for picamera2); 0: unchanged
    lens           file of `edge lens`, or factory: distortion that is removed from the pins' places; "": none
    extra          keys of the specification that are the source's own
    """

    width: int = 0
    height: int = 0
    rate_hz: float = 0.0  # frames a second; 0: the camera's own, or the recording's
    exposure_us: int = 0  # manual exposure; 0: unchanged
    gain: int = 0
    focus: int | None = None  # lens position in the camera's own unit; None: unchanged
    format: str = ""  # pixel format: GREY, Y10, Y12, Y16, MJPG, YUYV; "": the best that the camera has
    pins: Polarity = Polarity.FOUND  # dark or bright; "": found when the rest frame is taken
    lens: str = ""
    buffers: int = 1  # kernel buffers of a V4L2 camera
    check_rate: bool = True  # measure the rate at the start, and refuse a camera that is slower than asked
    extra: Mapping[str, str] = field(default_factory=dict)

    def size_or(self, default_px: tuple[int, int]) -> tuple[int, int]:
        """The width and height that are asked for, px."""
        return (self.width, self.height) if self.width and self.height else default_px

    def without_extra(self, name: str) -> Options:
        """Self; raises SourceError if the specification has a key that this source does not know."""
        for key, value in self.extra.items():
            if key == _SHARED:
                _convert(key, value, name)  # raises
            known = ", ".join(f.name for f in fields(self) if f.name != "extra")
            raise SourceError(f"source {name}: unknown key {key!r}; known keys: {known}")
        return self


@dataclass(frozen=True, slots=True)
class Spec:
    """scheme is "" if the specification is a plain path."""

    text: str
    scheme: str
    where: str
    options: Options


_SCHEME = re.compile(r"^([a-z][a-z0-9_+-]*):(.*)$", re.DOTALL)
EXPOSURE_MAX_US = 0x7FFF_FFFF  # what a control of V4L2 holds
_VIDEO_MAX_FRAME = 32  # buffers of a V4L2 device
#: Ranges of what a camera can be asked for; a key without a row takes any finite number.
_RANGES: dict[str, tuple[float, float]] = {
    "width": (0, IMAGE_SIDE_PX),
    "height": (0, IMAGE_SIDE_PX),
    "rate_hz": (0, RATE_MAX_HZ),
    "exposure_us": (0, EXPOSURE_MAX_US),
    "buffers": (1, _VIDEO_MAX_FRAME),
}
_TRUE = {"1": True, "true": True, "yes": True, "0": False, "false": False, "no": False}
#: Conversion, description and example of a key's value, by its type in `Options`.
_KINDS: dict[str, tuple[Callable[[str], Any], str, str]] = {
    "bool": (lambda text: _TRUE[text.lower()], "0 or 1", "1"),
    "float": (float, "a number", "1"),
    "int": (int, "a whole number", "1"),
    "str": (str, "text", "1"),
    "Polarity": (Polarity, "dark or bright", "dark"),
}


def convert(kind: str, name: str, text: str, spec: str) -> Any:
    """A key's value. Raises SourceError: it is not of that kind (bool, float, int, str)."""
    read, wanted, example = _KINDS[kind]
    low, high = _RANGES.get(name, (-NUMBER_MAX, NUMBER_MAX))
    try:
        value = read(text)
        if isinstance(value, int | float) and not low <= value <= high:  # nor NaN
            raise ValueError
    except (ValueError, KeyError):
        within = f" from {low:.0f} to {high:.0f}" if name in _RANGES else ""
        raise SourceError(
            f"source {spec}: {name}={text}: give {wanted}{within}, e.g. {name}={example}"
        ) from None
    return value


def _convert(name: str, text: str, spec: str) -> Any:
    kind = str({f.name: f.type for f in fields(Options)}[name]).partition(" ")[0]
    return convert(kind, name, text, spec)


def parse_spec(text: str, options: Options) -> Spec:
    """Split a specification; its keys override `options`. Raises SourceError."""
    match = _SCHEME.match(text)
    scheme, rest = match.groups() if match else ("", text)
    where, _, query = rest.partition("?")
    changes: dict[str, Any] = {}
    extra = dict(options.extra)
    for key, value in parse_qsl(query, keep_blank_values=True):
        own = key == _SHARED and value not in list(Polarity)
        if key in {f.name for f in fields(Options)} - {"extra"} and not own:
            changes[key] = _convert(key, value, text)
        else:
            extra[key] = value
    return Spec(text, scheme, where, replace(options, extra=extra, **changes))
