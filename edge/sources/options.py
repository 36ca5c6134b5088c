"""How a source is requested: a specification, and settings that every kind of source understands.

v4l2:0?exposure_us=2000&format=GREY
----  - ---------------------------
scheme where  keys; they win over the settings given in code or configuration
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Self, TypeVar
from urllib.parse import parse_qsl

import msgspec

from edge.errors import SourceError
from edge.limits import IMAGE_SIDE_PX, NUMBER_MAX, RATE_MAX_HZ, explain
from edge.types import Polarity

#: Dark or bright for every source; other values are the source's own: a number for the simulator.
_SHARED = "pins"
EXPOSURE_MAX_US = 0x7FFF_FFFF  # what a control of V4L2 holds
PARTS = ";"  # between the parts of a region, each of which may be a key of its own in an address
_VIDEO_MAX_FRAME = 32  # buffers of a V4L2 device
Side = Annotated[int, msgspec.Meta(ge=0, le=IMAGE_SIDE_PX)]
Whole = Annotated[int, msgspec.Meta(ge=-int(NUMBER_MAX), le=int(NUMBER_MAX))]
T = TypeVar("T", bound=msgspec.Struct)


class NoKeys(msgspec.Struct):
    """The own keys of a source that has none."""


class Options(msgspec.Struct, frozen=True):
    """width, height  px; 0: the source's own
    gain           in the camera's own unit (V4L2 control, ISO for OAK, a factor for picamera2); 0: unchanged
    roi            "x,y,w,h", circle: "x,y,r", several with ";" between; mask: a file: the skin; "": all
    lens           file of `calib lens`, or factory: distortion to remove from the pins' places; "": none
    extra          keys of the specification that are the source's own
    """

    width: Side = 0
    height: Side = 0
    rate_hz: Annotated[float, msgspec.Meta(ge=0, le=RATE_MAX_HZ)] = 0.0  # frames/s; 0: the source's own
    exposure_us: Annotated[int, msgspec.Meta(ge=0, le=EXPOSURE_MAX_US)] = 0  # manual exposure; 0: unchanged
    gain: Whole = 0
    focus: Whole | None = None  # lens position in the camera's own unit; None: unchanged
    format: str = ""  # pixel format, e.g. GREY, Y10P, MJPG, YUYV; "": the best that the camera has
    pins: Polarity = Polarity.FOUND  # dark or bright; "": found when the rest frame is taken
    lens: str = ""
    roi: str = ""
    circle: str = ""
    mask: str = ""
    buffers: Annotated[int, msgspec.Meta(ge=1, le=_VIDEO_MAX_FRAME)] = 1  # of the kernel, for a V4L2 camera
    check_rate: bool = True  # measure the rate at the start, and refuse a camera that is slower than asked
    extra: Mapping[str, str] = {}

    @property
    def size_px(self) -> tuple[int, int]:
        return self.width, self.height

    def or_own(self, size_px: tuple[int, int], rate_hz: float = 0.0) -> Self:
        """The same with a source's own size and rate where none is asked for."""
        width, height = self.size_px if self.width and self.height else size_px
        return msgspec.structs.replace(self, width=width, height=height, rate_hz=self.rate_hz or rate_hz)

    def own(self, name: str, kind: type[T]) -> T:
        """The source's own keys, the fields of a struct. Raises SourceError: another key or value."""
        known = kind.__struct_fields__
        if _SHARED in self.extra and _SHARED not in known:
            _convert({_SHARED: self.extra[_SHARED]}, Options, name)  # raises
        for key in self.extra.keys() - known:
            listed = ", ".join([*known, *self.__struct_fields__[:-1]])
            raise SourceError(f"source {name}: unknown key {key!r}; known keys: {listed}")
        return _convert(self.extra, kind, name)


@dataclass(frozen=True, slots=True)
class Spec:
    """scheme is "" if the specification is a plain path."""

    text: str
    scheme: str
    where: str
    options: Options


_YES_NO = {"yes": True, "no": False}  # beside what msgspec takes: true, false, 1, 0
_SCHEME = re.compile(r"^([a-z][a-z0-9_+-]*):(.*)$", re.DOTALL)


def _convert(keys: Mapping[str, str], kind: type[T], spec: str) -> T:
    """Keys with their values as text, as a struct. Raises SourceError."""
    yes_no = {field.name: _YES_NO for field in msgspec.structs.fields(kind) if field.type is bool}
    values = {key: yes_no.get(key, {}).get(text.lower(), text) for key, text in keys.items()}
    try:
        return msgspec.convert(values, kind, strict=False)
    except msgspec.ValidationError as error:
        raise SourceError(f"source {spec}: {explain(str(error), kind, keys)}") from None


def parse_spec(text: str, options: Options) -> Spec:
    """Split a specification; its keys override `options`. Raises SourceError."""
    match = _SCHEME.match(text)
    scheme, rest = match.groups() if match else ("", text)
    where, _, query = rest.partition("?")
    shared: dict[str, str] = {}
    changes: dict[str, Any] = {"extra": dict(options.extra)}
    for key, value in parse_qsl(query, keep_blank_values=True):
        own = key not in Options.__struct_fields__[:-1] or (key == _SHARED and value not in list(Polarity))
        if key in ("roi", "circle") and key in shared:
            value = shared[key] + PARTS + value
        (changes["extra"] if own else shared)[key] = value
    read = _convert(shared, Options, text)
    changes |= {key: getattr(read, key) for key in shared}
    return Spec(text, scheme, where, msgspec.structs.replace(options, **changes))
