"""The configuration of one finger: a TOML file, checked against the tables below before anything starts.

Every key has a default that works, so an empty file is a valid one. Command-line options override keys.
"""

import json
import re
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import inspect

from edge import limits
from edge.errors import ConfigError
from edge.sources.options import EXPOSURE_MAX_US
from edge.types import Feature

Count = Annotated[int, msgspec.Meta(ge=1, le=10_000)]
Rate = Annotated[float, msgspec.Meta(ge=0, le=limits.RATE_MAX_HZ)]


class _Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table of the file: immutable, and closed to keys that it does not name."""


class SensorTable(_Table, frozen=True, kw_only=True):
    """[sensor] which finger this is."""

    serial: Annotated[str, msgspec.Meta(max_length=32)] = "unnamed"
    model: str = ""  # a name in edge/sensors, or a file; empty: found from the rest frame
    node_id: Annotated[int, msgspec.Meta(ge=1, le=127)] = 1


class SourceTable(_Table, frozen=True, kw_only=True):
    """[source] where frames come from: see `python -m edge run --help` for the forms of `spec`."""

    spec: str = "v4l2:0"
    width: Annotated[int, msgspec.Meta(ge=64, le=8192)] = 640
    height: Annotated[int, msgspec.Meta(ge=64, le=8192)] = 480
    rate_hz: Rate = 0.0  # 0: the camera's own
    exposure_us: Annotated[int, msgspec.Meta(ge=0, le=EXPOSURE_MAX_US)] = 0  # 0: unchanged
    gain: Annotated[int, msgspec.Meta(ge=0, le=100_000)] = 0  # 0: unchanged


class LinkTable(_Table, frozen=True, kw_only=True):
    """[link] where samples go, and how often."""

    sinks: tuple[str, ...] = ()
    divider: Annotated[int, msgspec.Meta(ge=1, le=1000)] = 1  # every n-th frame is sent
    heartbeat_ms: Annotated[int, msgspec.Meta(ge=0, le=60_000)] = 500  # 0: none


class TareTable(_Table, frozen=True, kw_only=True):
    """[tare] the rest frame, taken at start-up while nothing touches the tip."""

    frames_n: Count = 8
    steady_px: Annotated[float, msgspec.Meta(ge=0.01, le=100)] = (
        0.5  # largest motion of 90 % of the pins while taring
    )
    drift_px: Annotated[float, msgspec.Meta(ge=0, le=1)] = (
        0.3  # largest slow drift that is subtracted; 0: none
    )


class LimitsTable(_Table, frozen=True, kw_only=True):
    """[limits] thresholds of faults."""

    temperature_degc: Annotated[float, msgspec.Meta(ge=30, le=120)] = 80.0  # of the board
    load_pitches: Annotated[float, msgspec.Meta(ge=0.1, le=10)] = 1.6  # motion of 5 % of the pins


class CalibrationTable(_Table, frozen=True, kw_only=True):
    """[calibration] the file that turns geometry into mechanical units."""

    file: str = ""  # empty: none; values that need one are sent as invalid


class FeaturesTable(_Table, frozen=True, kw_only=True):
    """[features] what is computed and sent; nothing else is computed."""

    demand: tuple[Feature, ...] = tuple(f for f in Feature if f is not Feature.SURFACE)
    several: bool = True  # several contacts, and bars, are fitted together; false: each region is a contact


class StateTable(_Table, frozen=True, kw_only=True):
    """[state] the only folder that is written to."""

    directory: str = ""  # empty: settings are kept in memory only


class Config(_Table, frozen=True, kw_only=True):
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
    """Read and check a file; without one, the defaults.

    Raises  ConfigError, one line: file, key, what would be right
    """
    if path is None:
        return Config()
    path = Path(path)
    try:
        table = limits.read_toml(path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    except limits.BadContent as error:
        raise ConfigError(f"{path}: not a configuration: {error}") from None
    return check_config(table, str(path))


def check_config(table: dict[str, object], where: str) -> Config:
    """Check a table of keys as read from TOML. Raises ConfigError."""
    try:
        return msgspec.convert(table, Config)
    except msgspec.ValidationError as error:
        try:
            what = _explain(str(error), table)
        except LookupError:  # a key that looks like a place in msgspec's message
            what = limits.explain(str(error))
        raise ConfigError(f"{where}: {what}") from None


def _explain(message: str, table: dict[str, object]) -> str:
    """msgspec's message in terms of the file: table, key, value, and what would be right."""
    path = message.rpartition(" - at `$")[2].rstrip("`").lstrip(".") if " - at `$" in message else ""
    if "unknown field" in message:
        place = f"[{path}]" if path else "the top level"
        key = message.partition("`")[2].partition("`")[0]
        return f"unknown key {limits.quote(key)} in {place}; known keys: {', '.join(_fields(_at(path)))}"
    section, _, key = path.partition(".")
    value: Any = table[section]  # nested tables and lists
    if not key:
        return f"{section} = {_shown(value)}: a table is written [{section}], with keys below it"
    for step in re.findall(r"\w+", key):
        value = value[int(step)] if isinstance(value, list) else value[step]
    return f"[{section}] {key} = {_shown(value)}: give {_wanted(_at(path))}"


def _fields(kind: inspect.Type) -> dict[str, inspect.Type]:
    assert isinstance(kind, inspect.StructType)
    return {field.name: field.type for field in kind.fields}


def _at(path: str) -> inspect.Type:
    """The type of a key, or of one value in a list of them."""
    kind = inspect.type_info(Config)
    for step in re.findall(r"\w+", path):
        kind = kind.item_type if isinstance(kind, inspect.VarTupleType) else _fields(kind)[step]
    return kind


def _wanted(kind: inspect.Type) -> str:
    """Description of the values that a key accepts."""
    if isinstance(kind, inspect.VarTupleType):
        return f"a list, each of it {_wanted(kind.item_type)}"
    if isinstance(kind, inspect.EnumType):
        return f"one of {', '.join(member.value for member in kind.cls)}"
    if isinstance(kind, inspect.StrType):
        return "text in quotes" + (f", {kind.max_length} characters at most" if kind.max_length else "")
    if isinstance(kind, inspect.BoolType):
        return "true or false"
    assert isinstance(kind, inspect.IntType | inspect.FloatType), kind
    name = "a whole number" if isinstance(kind, inspect.IntType) else "a number"
    if kind.ge is not None and kind.le is not None:
        return f"{name} from {kind.ge:g} to {kind.le:g}"
    return name


def _shown(value: object) -> str:
    """A value in TOML notation, shortened if long."""
    text = json.dumps(value, default=str)
    return text if len(text) <= 40 else text[:37] + "..."
