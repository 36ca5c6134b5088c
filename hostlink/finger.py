"""One finger as the host sees it: its newest sample, and what it can be asked and told."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from hostlink.clock import ClockMap
from hostlink.decoder import Emergency, Statistics
from hostlink.errors import LinkError, ObjectAborted, UsageError, VersionMismatch
from hostlink.objects import ObjectClient
from hostlink.wire import OBJECTS, Abort, FaultCode, Object, State, object_named, pack_value, unpack_value

__all__ = ["STALE_S", "Finger", "Info", "Sample"]

Value = int | float | str | bytes

#: Aborts that leave open why.
_IN_WORDS = frozenset({Abort.VALUE_RANGE, Abort.NOT_NOW, Abort.NOT_STORED, Abort.LENGTH})
STALE_S = 0.1  # default age above which `latest` gives nothing


@dataclass(frozen=True, slots=True)
class Sample:
    """One sample of one finger.

    finger        node number
    state         the values; fields: `hostlink.wire.fields`
    host_time_s   when the image was taken, on `time.monotonic()`
    host_error_s  bound of that time's error; until `finger.sync_clock()` was called it takes the shortest way
                  of a sample to this host to last 2 ms at the most (`hostlink.clock.TRANSIT_S`)
    arrival_s     when it came in, on `time.monotonic()`
    lost_n        samples lost between the one before and this
    """

    finger: int
    state: State
    host_time_s: float
    host_error_s: float
    arrival_s: float
    lost_n: int

    @property
    def age_s(self) -> float:
        """Time since the image was taken."""
        return time.monotonic() - self.host_time_s


@dataclass(frozen=True, slots=True)
class Info:
    """Who a finger is; `values` holds every readable object by name."""

    serial_number: str
    software_version: str
    calibration_id: str
    wire_version: int
    schema_hash: int
    values: Mapping[str, Value]


class Finger:
    """One finger of a connection.

    objects     access to its objects
    statistics  what became of its samples so far
    """

    def __init__(self, node: int, objects: ObjectClient, statistics: Callable[[], Statistics]) -> None:
        self.node = node
        self.clock = ClockMap()
        self.state_nmt: int | None = None  # CiA 301; 5 is operational
        self.faults: dict[FaultCode, float] = {}  # active ones, with when they were heard of
        self.objects = objects
        self.newest: Sample | None = None
        self._statistics = statistics
        self.mismatch: VersionMismatch | None = None

    def latest(self, max_age_s: float | None = STALE_S) -> Sample | None:
        """The newest sample, or None if it is older than `max_age_s` (None: any age) or there was none.

        Raises VersionMismatch
        """
        if self.mismatch is not None:
            raise self.mismatch
        sample = self.newest
        if sample is None or (max_age_s is not None and time.monotonic() - sample.arrival_s > max_age_s):
            return None
        return sample

    @property
    def statistics(self) -> Statistics:
        """What became of this finger's samples."""
        return self._statistics()

    def get(self, name: str) -> Value:
        """Read an object by name; see WIRE.md, "Objects".

        Raises UsageError: no such object; ObjectAborted, LinkTimeout, LinkDown
        """
        obj = _object(name)
        try:
            return unpack_value(obj, self.objects.read(obj.index, obj.sub))
        except ObjectAborted as error:
            if error.code == Abort.NO_DATA and obj.type in ("visible_string", "domain"):
                return "" if obj.type == "visible_string" else b""  # SDO has no empty value
            raise

    def set(self, name: str, value: Value) -> None:
        """Write an object by name.

        Raises UsageError: no such object, or a value that it cannot take; ObjectAborted, LinkTimeout,
               LinkDown
        """
        obj = _object(name)
        try:
            data = pack_value(obj, value)
        except (TypeError, ValueError) as error:
            raise UsageError(str(error)) from None
        try:
            self.objects.write(obj.index, obj.sub, data)
        except ObjectAborted as error:
            raise self._explained(error) from None

    def _explained(self, error: ObjectAborted) -> ObjectAborted:
        """The same with the node's own words, where it has any."""
        try:
            words = self.get("refusal") if error.code in _IN_WORDS else ""
        except LinkError:  # an older node has no such object
            words = ""
        return ObjectAborted(error.index, error.sub, error.code, str(words) or error.reason, error.name)

    def info(self) -> Info:
        """Identity, settings and statistics."""
        values: dict[str, Value] = {}
        for obj in OBJECTS:
            if (
                obj.index >= 0x2000
                and obj.access != "wo"
                and obj.type != "domain"
                and "max_sub" not in obj.name
            ):
                values[obj.name] = self.get(obj.name)
        return Info(
            serial_number=str(values["serial_number"]),
            software_version=str(self.get("software_version")),
            calibration_id=str(values["calibration_id"]),
            wire_version=int(values["wire_version"]),
            schema_hash=int(values["schema_hash"]),
            values=values,
        )

    def tare(self, force: bool = False) -> None:
        """Take a new rest frame. Raises ObjectAborted: something touches the tip (and not forced)."""
        self.set("tare", 2 if force else 1)

    def set_rate(self, rate_hz: float) -> None:
        """Samples per second at the most; 0: one for every image."""
        self.set("rate_hz", rate_hz)

    def upload_calibration(self, file: Path | str | bytes) -> None:
        """Give the finger another calibration file; it validates, stores and uses it.

        Raises UsageError: no such file, or plainly no calibration; ObjectAborted: refused, nothing changed
        """
        try:
            data = file if isinstance(file, bytes) else Path(file).read_bytes()
        except OSError as error:
            raise UsageError(f"{file!s}: cannot be read: {error.strerror}") from None
        try:
            whole = isinstance(json.loads(data), dict)
        except ValueError:
            whole = False
        if not whole:  # what is wrong within, the finger says; but a picture need not go there
            where = "upload" if isinstance(file, bytes) else file
            raise UsageError(f"{where}: not a calibration file; give one that `calib fit` made (.json)")
        self.set("calibration", data)

    def calibration(self) -> bytes:
        """The calibration file in use; empty: none."""
        data = self.get("calibration")
        assert isinstance(data, bytes)  # its type in the table is domain
        return data

    def sync_clock(self) -> None:
        """Narrow the bound of `host_error_s` by a round trip: without one it rests on an assumed transit.

        Raises ObjectAborted: the finger's images are not stamped by a clock that it can read
        """
        obj = object_named("time_us")
        asked_s = time.monotonic()
        device_us = unpack_value(obj, self.objects.read(obj.index, obj.sub))
        assert isinstance(device_us, int)
        self.clock.bracket(asked_s, device_us, time.monotonic())

    def reboot(self) -> None:
        """Restart the finger's software."""
        self.set("reboot", 0x746F6F62)

    def take_emergency(self, event: Emergency) -> None:
        """Keep the set of active faults by an emergency message."""
        if event.emcy == 0 and event.fault == 0:
            self.faults.clear()
        elif event.fault in FaultCode._value2member_map_:
            code = FaultCode(event.fault)
            if event.emcy == 0:
                self.faults.pop(code, None)
            else:
                self.faults[code] = event.arrival_s


def _object(name: str) -> Object:
    try:
        return object_named(name)
    except KeyError:
        raise UsageError(f'no object {name!r}; names stand in WIRE.md, "Objects"') from None
