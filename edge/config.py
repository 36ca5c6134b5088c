"""The configuration of one finger: a TOML file, checked against the tables below before anything starts.

Every key has a default that works, so an empty file is a valid one. Command-line options override keys.
"""

from pathlib import Path
from typing import Annotated

import msgspec

from edge import limits
from edge.errors import ConfigError
from edge.sources.options import EXPOSURE_MAX_US, Side
from edge.types import Feature

Count = Annotated[int, msgspec.Meta(ge=1, le=10_000)]
Rate = Annotated[float, msgspec.Meta(ge=0, le=limits.RATE_MAX_HZ)]


class SensorTable(limits.ClosedTable, frozen=True, kw_only=True):
    """[sensor] which finger this is."""

    serial: Annotated[str, msgspec.Meta(max_length=32)] = "unnamed"
    model: str = ""  # a name in edge/sensors, or a file; empty: found from the rest frame
    node_id: Annotated[int, msgspec.Meta(ge=1, le=127)] = 1


class SourceTable(limits.ClosedTable, frozen=True, kw_only=True):
    """[source] where frames come from: see `python -m edge run --help` for the forms of `spec`."""

    spec: str = "v4l2:0"
    width: Side = 0  # 0: the source's own
    height: Side = 0
    rate_hz: Rate = 0.0  # 0: the source's own
    exposure_us: Annotated[int, msgspec.Meta(ge=0, le=EXPOSURE_MAX_US)] = 0  # 0: unchanged
    gain: Annotated[int, msgspec.Meta(ge=0, le=100_000)] = 0  # 0: unchanged
    roi: str = ""  # "x,y,w,h" px, the skin's part of the images, or several: "...; ..."; empty: all
    circle: str = ""  # "x,y,r" px, the same
    mask: str = ""  # the same: a picture whose white is skin


class LinkTable(limits.ClosedTable, frozen=True, kw_only=True):
    """[link] where samples go, and how often."""

    sinks: tuple[str, ...] = ()
    divider: Annotated[int, msgspec.Meta(ge=1, le=1000)] = 1  # every n-th frame is sent
    heartbeat_ms: Annotated[int, msgspec.Meta(ge=0, le=60_000)] = 500  # 0: none


class TareTable(limits.ClosedTable, frozen=True, kw_only=True):
    """[tare] the rest frame, taken at start-up while nothing touches the tip."""

    frames_n: Count = 8
    #: Largest motion of 90 % of the pins while taring; largest slow drift that is subtracted, 0: none.
    steady_px: Annotated[float, msgspec.Meta(ge=0.01, le=100)] = 0.5
    drift_px: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.3


class LimitsTable(limits.ClosedTable, frozen=True, kw_only=True):
    """[limits] thresholds of faults."""

    temperature_degc: Annotated[float, msgspec.Meta(ge=30, le=120)] = 80.0  # of the board
    load_pitches: Annotated[float, msgspec.Meta(ge=0.1, le=10)] = 1.6  # motion of 5 % of the pins


class CalibrationTable(limits.ClosedTable, frozen=True, kw_only=True):
    """[calibration] the file that turns geometry into mechanical units."""

    file: str = ""  # empty: none; values that need one are sent as invalid


class FeaturesTable(limits.ClosedTable, frozen=True, kw_only=True):
    """[features] what is computed and sent; nothing else is computed."""

    demand: tuple[Feature, ...] = tuple(f for f in Feature if f is not Feature.SURFACE)
    several: bool = True  # several contacts, and bars, are fitted together; false: each region is a contact
    #: Calibrated values are smoothed so that they follow a step in this time, 0: not.
    smooth_ms: Annotated[float, msgspec.Meta(ge=0, le=1000)] = 0.0


class StateTable(limits.ClosedTable, frozen=True, kw_only=True):
    """[state] the only folder that is written to."""

    directory: str = ""  # empty: settings are kept in memory only


class Config(limits.ClosedTable, frozen=True, kw_only=True):
    """The whole file."""

    sensor: SensorTable = SensorTable()
    source: SourceTable = SourceTable()
    link: LinkTable = LinkTable()
    tare: TareTable = TareTable()
    limits: LimitsTable = LimitsTable()
    calibration: CalibrationTable = CalibrationTable()
    features: FeaturesTable = FeaturesTable()
    state: StateTable = StateTable()


def load_config(path: str | Path | None) -> Config:
    """Read and check a file; None: the defaults. Raises ConfigError: file, key, what would be right."""
    if path is None:
        return Config()
    try:
        return limits.read_toml_as(Path(path), Config)[1]
    except limits.BadContent as error:
        raise ConfigError(f"{path}: {error}") from None
