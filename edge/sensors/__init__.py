"""Known sensors as data: one TOML file each. What no source gives is left out.

sensor = load_sensor("gelsight-mini")       # or the path of a file of one's own
sensor.pins.pitch_mm                        # None: nobody has published it
"""

from pathlib import Path
from typing import Annotated, Literal

import msgspec

from edge import limits
from edge.errors import ConfigError

_FOLDER = Path(__file__).resolve().parent
Length = Annotated[float, msgspec.Meta(gt=0, le=1000)]


class _Closed(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table of the file; it takes no keys but its own."""


class SensorPins(_Closed, frozen=True, kw_only=True):
    """[pins] the markers that the camera sees.

    count      of the untouched sensor, all of them in view; of a grid that the image's border cuts, at least
    pitch_mm   distance of neighbours at the middle, in the plane across the camera's axis
    """

    layout: Literal["hex", "rings", "square"] | None = None  # as `edge.geometry.layout.pin_layout` names it
    count: Annotated[int, msgspec.Meta(ge=limits.PINS_MIN, le=limits.PINS_MAX)] | None = None
    polarity: Literal["bright", "dark"] | None = None  # bright or dark against the skin
    pitch_mm: Length | None = None
    radius_mm: Length | None = None  # of a marker
    length_mm: Length | None = None  # of a lever from skin to marker


class SensorTip(_Closed, frozen=True, kw_only=True):
    """[tip] shape of the skin; radius_mm of a dome's sphere.

    skin  "pins" under it, or dots on its "surface"
    """

    shape: Literal["dome", "flat"] | None = None
    skin: Literal["pins", "surface"] | None = None
    radius_mm: Length | None = None


class SensorCamera(_Closed, frozen=True, kw_only=True):
    """[camera] the images, and their part that shows the skin, as in a source's address."""

    size_px: tuple[limits.ImageSide, limits.ImageSide] | None = None  # width, height
    mm_per_px: Length | None = None  # at their middle
    roi: str | None = None
    circle: str | None = None
    mask: str | None = None  # a file beside this one


class KnownSensor(_Closed, frozen=True, kw_only=True):
    """The whole file."""

    title: limits.Name  # what people call it
    pins: SensorPins = SensorPins()
    tip: SensorTip = SensorTip()
    camera: SensorCamera = SensorCamera()
    #: The source of each figure by the figure's key, such as "pins.pitch_mm".
    sources: dict[limits.Name, Annotated[str, msgspec.Meta(min_length=1, max_length=400)]] = {}
    name: str = ""  # of the file, without its suffix

    @property
    def on_surface(self) -> bool:
        """Whether its markers are dots on the skin's surface."""
        return self.tip.skin == "surface"

    @property
    def cut(self) -> bool:
        """Whether the image's border cuts its pins: a flat grid that is larger than the view."""
        return self.pins.layout == "square" and self.tip.shape == "flat"


def sensor_names() -> list[str]:
    return sorted(path.stem for path in _FOLDER.glob("*.toml"))


def known_sensors() -> list[KnownSensor]:
    """The sensors that come with this package."""
    return [load_sensor(name) for name in sensor_names()]


def load_sensor(name: str) -> KnownSensor:
    """A sensor by its name or its file's path (*.toml). Raises ConfigError: none such, or a fault in it."""
    path = Path(name) if name.endswith(".toml") else _FOLDER / f"{name}.toml"
    if not name.endswith(".toml") and name not in sensor_names():
        known = ", ".join(sensor_names())
        raise ConfigError(
            f"sensor {limits.quote(name)} is unknown; one of {known}, or a file of your own (.toml)"
        )
    try:
        sensor = limits.read_toml_as(path, KnownSensor, name=path.stem)[1]
    except limits.BadContent as error:
        raise ConfigError(f"{path}: {error}") from None
    if not sensor.camera.mask:
        return sensor
    mask = str(path.parent / sensor.camera.mask)
    return msgspec.structs.replace(sensor, camera=msgspec.structs.replace(sensor.camera, mask=mask))


def missing_pins(sensor: KnownSensor, found_n: int) -> str:
    """A line if fewer pins were found than the sensor has; "": all were."""
    count = sensor.pins.count
    if count is None or found_n >= count:
        return ""
    least = "at least " if sensor.cut else ""
    return f"{found_n} pins found, {sensor.title} has {least}{count}"
