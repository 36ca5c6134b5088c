"""One finger as the host sees it: its newest sample, its objects and commands."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from hostlink.errors import (
    LinkError,
    LinkTimeout,
    ObjectAborted,
    RestFrameRefused,
    UsageError,
    VersionMismatch,
)
from hostlink.events import Emergency, Sample
from hostlink.hand_file import Mount
from hostlink.input_file import UPLOAD_BYTES, read_bounded
from hostlink.objects import ObjectClient
from hostlink.order_and_time import ClockMap, LinkStatistics
from hostlink.wire import (
    OBJECTS,
    Abort,
    FaultCode,
    Object,
    RestFrameReason,
    RestFrameState,
    object_named,
    pack_value,
    unpack_value,
)
from hostlink.wire.objects import REST_FRAME_REASONS, SAMPLE_INDEX

__all__ = ["STALE_S", "Finger", "Info", "RestFrameOutcome", "read_upload"]

Value = int | float | str | bytes

#: Abort codes whose reason object `refusal` explains.
_EXPLAINED = frozenset({Abort.VALUE_RANGE, Abort.NOT_NOW, Abort.NOT_STORED, Abort.LENGTH})
_REASONS = frozenset(RestFrameReason)
_NOT_THERE = frozenset({Abort.NO_OBJECT, Abort.NO_SUB})  # an older release
STALE_S = 0.1  # default age above which `latest` gives nothing
TARE_S = 15.0  # a rest frame of 60 images at 10 Hz, and some retries
POLL_S = 0.05  # the object with the outcome sends no events: it is polled


@dataclass(frozen=True, slots=True)
class Info:
    """Identity of a finger; `values` has every readable object, by name."""

    serial_number: str
    software_version: str
    calibration_id: str
    wire_version: int
    schema_hash: int
    values: Mapping[str, Value]


@dataclass(frozen=True, slots=True)
class RestFrameOutcome:
    """The outcome of a request for a rest frame.

    state    ACCEPTED, or FORCED: in use although it is implausible
    reason   why a forced one is implausible
    message  the same as text from the finger
    """

    state: RestFrameState
    reason: RestFrameReason = RestFrameReason.NONE
    message: str = ""


class Finger:
    """One finger of a connection.

    mount          its number, name and place in the hand
    objects        access to its objects
    statistics     counts of its samples so far
    clock          the mapping of its clock to the host's
    second_sender  whether another sender uses the same number
    """

    def __init__(
        self,
        mount: Mount,
        objects: ObjectClient,
        statistics: Callable[[], LinkStatistics],
        clock: Callable[[], ClockMap],
    ) -> None:
        self.mount = mount
        self.node, self.name = mount.node, mount.name
        self._clock = clock
        self.second_sender = False
        self.state_nmt: int | None = None  # CiA 301; 5 is operational
        self.faults: dict[FaultCode, float] = {}  # active ones, with the times of their messages
        self.objects = objects
        self.newest: Sample | None = None
        self._statistics = statistics
        self.mismatch: VersionMismatch | None = None

    def latest(self, max_age_s: float | None = STALE_S) -> Sample | None:
        """The newest sample; None: there was none, or its `age_s` is over `max_age_s` (None: any age).

        Raises VersionMismatch
        """
        if self.mismatch is not None:
            raise self.mismatch
        sample = self.newest
        # Not by the arrival: after a halt of the host, what had waited arrives only now.
        fresh = sample is not None and (max_age_s is None or sample.age_s <= max_age_s)
        return sample if fresh else None

    @property
    def clock(self) -> ClockMap:
        """The mapping of this finger's clock to the host's."""
        return self._clock()

    @property
    def statistics(self) -> LinkStatistics:
        """Counts of this finger's samples."""
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
        """The same error with the node's own reason, if it gives one."""
        try:
            message = self.get("refusal") if error.code in _EXPLAINED else ""
        except LinkError:  # an older release has no such object
            message = ""
        return ObjectAborted(error.index, error.sub, error.code, str(message) or error.reason, error.name)

    def info(self) -> Info:
        """Identity, settings and statistics."""
        values: dict[str, Value] = {}
        for obj in OBJECTS:
            described = 0x2000 <= obj.index < SAMPLE_INDEX and "max_sub" not in obj.name
            if not described or obj.access == "wo" or obj.type == "domain":
                continue
            try:
                values[obj.name] = self.get(obj.name)
            except ObjectAborted as error:
                if error.code not in _NOT_THERE:
                    raise
        return Info(
            serial_number=str(values["serial_number"]),
            software_version=str(self.get("software_version")),
            calibration_id=str(values["calibration_id"]),
            wire_version=int(values["wire_version"]),
            schema_hash=int(values["schema_hash"]),
            values=values,
        )

    def tare(self, force: bool = False, timeout_s: float = TARE_S) -> RestFrameOutcome:
        """Take a new rest frame, and wait until it is in use.

        force   accept it even if something touches the tip; the result gives the reason
        Raises  ObjectAborted: refused at once; RestFrameRefused: refused after checking the images; in both
                cases the previous one stays in use. LinkTimeout, LinkDown, LinkError: outcome not known
        """
        self.set("tare", 2 if force else 1)
        return self._rest_frame("tare", timeout_s)

    def _rest_frame(self, what: str, timeout_s: float) -> RestFrameOutcome:
        """The outcome of the request just made; see WIRE.md, "Whether a tare succeeded"."""
        end_s = time.monotonic() + timeout_s
        try:
            request_n = int(self.get("rest_frame_request_n"))
            while time.monotonic() < end_s:
                state = RestFrameState(int(self.get("rest_frame_state")))
                if state is RestFrameState.UNKNOWN:
                    break
                if state is RestFrameState.BUSY:
                    threading.Event().wait(POLL_S)
                    continue
                reason, message = self._reason(), str(self.get("rest_frame_message"))
                newest_n = int(self.get("rest_frame_request_n"))
                if newest_n == request_n:
                    return self._accepted(what, RestFrameOutcome(state, reason, message))
                if (newest_n - request_n) & 0xFFFF > 0x8000:
                    raise LinkError(f"the finger restarted during the {what}; ask again")
                request_n = newest_n  # another host made a later request: its outcome counts
            else:
                raise LinkTimeout(f"no outcome of the {what} for {timeout_s:g} s; does its camera run?")
        except ObjectAborted as error:
            if error.code not in _NOT_THERE:
                raise
        raise LinkError(f"{what} begun, but this release cannot say what became of it")

    def _reason(self) -> RestFrameReason:
        number = int(self.get("rest_frame_reason"))
        return RestFrameReason(number) if number in _REASONS else RestFrameReason.OTHER  # of a newer release

    def _accepted(self, what: str, frame: RestFrameOutcome) -> RestFrameOutcome:
        if frame.state is not RestFrameState.REFUSED:
            return frame
        message = frame.message.removeprefix("tare: ") or REST_FRAME_REASONS[frame.reason]
        raise RestFrameRefused(f"{what} refused: {message}", frame.reason)

    def set_rate(self, rate_hz: float) -> None:
        """Largest number of samples per second; 0: one for every image."""
        self.set("rate_hz", rate_hz)

    def upload_calibration(self, file: Path | str | bytes, timeout_s: float = TARE_S) -> RestFrameOutcome:
        """Give the finger another calibration file; wait until it is in use, with a new rest frame.

        Raises UsageError: no such file, or obviously not a calibration; ObjectAborted, RestFrameRefused:
               refused, the previous one stays in use; LinkTimeout, LinkDown, LinkError: outcome not known
        """
        self.set("calibration", read_upload(file))
        return self._rest_frame("calibration", timeout_s)

    def calibration(self) -> bytes:
        """The calibration file in use; empty: none."""
        data = self.get("calibration")
        assert isinstance(data, bytes)  # its type in the table is domain
        return data

    def sync_clock(self) -> None:
        """Narrow the bound of `host_error_s` by a round trip; before, it is based on an assumed transit.

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
        """Update the set of active faults from an emergency message."""
        if event.emcy == 0 and event.fault == 0:
            self.faults.clear()
        elif event.fault in FaultCode._value2member_map_:
            code = FaultCode(event.fault)
            if event.emcy == 0:
                self.faults.pop(code, None)
            else:
                self.faults[code] = event.arrival_s


def read_upload(file: Path | str | bytes) -> bytes:
    """A calibration file's bytes. Raises UsageError: no such file, or obviously not a calibration."""
    try:
        data = file if isinstance(file, bytes) else read_bounded(file, UPLOAD_BYTES)
    except OSError as error:
        raise UsageError(f"{file!s}: cannot be read: {error.strerror}") from None
    try:
        whole = isinstance(json.loads(data), dict)
    except (ValueError, RecursionError):
        whole = False
    if not whole:  # the finger checks the content; do not upload other kinds of file
        where = "upload" if isinstance(file, bytes) else file
        raise UsageError(f"{where}: not a calibration file; give one that `calib fit` made (.json)")
    return data


def _object(name: str) -> Object:
    try:
        return object_named(name)
    except KeyError:
        raise UsageError(f'no object {name!r}; the names are listed in WIRE.md, "Objects"') from None
