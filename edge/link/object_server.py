"""The object server: reads and writes of the object table, by SDO or over serial.

An access that fails raises `Aborted` with CiA 301's code, and no other error.
"""

import logging
import math
import struct
import time
from collections import deque
from collections.abc import Callable, Mapping
from hashlib import sha256
from typing import Any, Protocol

from edge.errors import CalibrationError, RequestRefused
from edge.link.params import PARAMS
from edge.link.settings import NodeSettings, SettingsFile
from hostlink.output_file import OutputError
from hostlink.wire import Abort, CanIds, CorruptFrame, Fault, FaultCode, State
from hostlink.wire.objects import OBJECTS, SAMPLE_INDEX, TYPES, Object, object_at, pack_value, unpack_value
from hostlink.wire.state import quantise

log = logging.getLogger(__name__)
Value = int | float | str | bytes

FORCE = 2  # value of the tare object
_INDICES = frozenset(o.index for o in OBJECTS)
_SETTINGS = frozenset(NodeSettings.__dataclass_fields__)


class Aborted(Exception):
    """An access that was refused; `code` is one of `hostlink.wire.Abort`."""

    def __init__(self, code: int) -> None:
        super().__init__(f"0x{code:08X}")
        self.code = code


class Device(Protocol):
    """The application, called from the link's thread: the host waits, so it must return within some 50 ms."""

    def describe(self) -> Mapping[str, Value]:
        """Read-only objects by name (`hostlink.wire.OBJECTS`): serial_number, and others or their default."""

    def clock_us(self) -> int | None:
        """The clock that stamps the images, now, us of any width; None where it cannot be read."""

    def tare(self, force: bool) -> None:
        """Have a new rest frame taken from the next images; `rest_frame` reports the outcome.

        Raises RequestRefused: something touches the tip, and `force` is not set; or one is being taken
        """

    def rest_frame(self) -> Mapping[str, Value]:
        """Objects rest_frame_request_n, _state, _reason, _words: the outcome of the last request."""

    def calibration_bytes(self) -> bytes:
        """The calibration file in use; empty: none."""

    def upload_calibration(self, data: bytes) -> None:
        """Check another calibration file and have a rest frame taken with it; then it is stored and used.

        Raises ValueError, edge.errors.CalibrationError: not usable, nothing changed; RequestRefused: not now
        """

    def set_features(self, names: frozenset[str]) -> None:
        """Compute these features (`edge.types.Feature` values) from now on."""

    def reboot(self) -> None:
        """Restart the software, after the answer had time to leave."""

    def report(self, code: FaultCode, active: bool, message: str = "") -> None:
        """A fault of the link appeared or cleared: `FaultRegistry.report`."""


class ObjectServer:
    """on_change  called with the name of a setting that changed
    link       counters kept by the node itself: name of a statistics object -> present value
    maps       whether the link's frames are those that the TPDOs' mapping shows
    newest     sample, which process data are read from
    """

    def __init__(
        self,
        device: Device,
        settings: SettingsFile,
        node: int,
        ids: CanIds,
        on_change: Callable[[str], None],
        link: Callable[[], dict[str, int]],
        maps: bool = True,
    ) -> None:
        self._device, self._settings, self._node = device, settings, node
        self._ids, self._on_change = ids, on_change
        self._link, self._maps = link, maps
        self.newest: State | None = None
        self._description: Mapping[str, Value] = {}
        self._described_s = -math.inf
        self.error_register = 0
        self.refusal = ""  # why the last write was refused
        history_n = max(o.sub for o in OBJECTS if o.index == 0x1003)
        self._errors: deque[int] = deque(maxlen=history_n)  # newest first
        self.reset()

    def reset(self) -> None:
        """Set everything that is not stored to its power-on state."""
        self._errors.clear()
        self.transmission = dict.fromkeys(range(1, 5), 254)

    def record(self, fault: Fault) -> None:
        self._errors.appendleft(fault.emcy | int(fault.code) << 16)

    def read(self, index: int, sub: int) -> bytes:
        """The object's bytes. Raises Aborted."""
        obj = _find(index, sub)
        if obj.access == "wo":
            raise Aborted(Abort.WRITE_ONLY)
        value = self._value(obj)
        if value is None:
            raise Aborted(Abort.NO_DATA)
        try:
            return _encode(obj, value)
        except (TypeError, ValueError, struct.error) as error:
            log.error("object %s: %s", obj.name, error)
            raise Aborted(Abort.GENERAL) from None

    def write(self, index: int, sub: int, data: bytes) -> None:
        """Apply a value. Raises Aborted: it was not applied; `refusal` may say why."""
        self.refusal = ""
        obj = _find(index, sub)
        if obj.access not in ("rw", "wo"):
            raise Aborted(Abort.READ_ONLY)
        try:
            value = unpack_value(obj, data)
        except CorruptFrame:
            raise Aborted(Abort.LENGTH) from None
        if isinstance(value, int | float) and obj.low is not None and obj.high is not None:
            if not value >= obj.low:
                raise Aborted(Abort.VALUE_LOW)
            if not value <= obj.high:  # CiA 301 has a code of its own for the error history
                raise Aborted(Abort.VALUE_RANGE if obj.name == "error_n" else Abort.VALUE_HIGH)
        self._described_s = -math.inf  # the description may have changed
        try:
            self._apply(obj, value)
        except RequestRefused as error:
            self.refusal = str(error)
            raise Aborted(Abort.NOT_NOW) from None
        except (ValueError, CalibrationError) as error:
            self.refusal = str(error)
            log.warning("object %s: %s", obj.name, error)
            raise Aborted(Abort.VALUE_RANGE) from None
        except (OutputError, OSError) as error:
            advice = "; free some space, or allow writing to the state folder"
            why = f"{error.strerror}{advice}" if isinstance(error, OSError) else error
            self.refusal = f"cannot be stored: {why}"
            log.error("object %s cannot be stored: %s", obj.name, error)
            raise Aborted(Abort.NOT_STORED) from None

    def _value(self, obj: Object) -> Any:
        name = obj.name
        if name in _SETTINGS:
            return getattr(self._settings.values, name)
        if name.endswith("_cob_id"):
            base = int(getattr(self._ids, name.removesuffix("_cob_id")))
            return base + (self._node if obj.node_id else 0)
        own: dict[str, Value] = {
            "settings_stored": self._settings.is_stored,
            "refusal": self.refusal,
            "error_register": self.error_register,
            "error_n": len(self._errors),
            **self._link(),
        }
        if name in own:
            return own[name]
        if obj.index == SAMPLE_INDEX and obj.sub:
            return None if self.newest is None else quantise(self.newest)[obj.sub - 1]
        if name.endswith("_inhibit"):
            rate_hz = self._settings.values.rate_hz
            return min(0xFFFF, round(10_000 / rate_hz)) if rate_hz else 0
        if name.endswith("_mapped_n") and not self._maps:
            return 0
        if obj.index == 0x2032 and obj.sub:
            return self._device.rest_frame()[name]
        if obj.index == 0x1003:
            return self._errors[obj.sub - 1] if obj.sub <= len(self._errors) else None
        if name.endswith("_transmission"):
            return self.transmission[obj.index - 0x1800 + 1]
        if name == "calibration":
            return self._device.calibration_bytes() or None
        if name == "serial_short":
            serial = str(self._described()["serial_number"])
            return int.from_bytes(sha256(serial.encode()).digest()[:4], "big")
        if name == "time_us":
            return self._device.clock_us()
        return self._described().get(name, obj.default)

    def _described(self) -> Mapping[str, Value]:
        """The device's description, at most `check_s` old."""
        now_s = time.monotonic()
        if now_s - self._described_s > PARAMS.check_s:
            self._description, self._described_s = self._device.describe(), now_s
        return self._description

    def _apply(self, obj: Object, value: Any) -> None:
        name = obj.name
        if name in _SETTINGS:
            self._settings.change(**{name: value})
            self._on_change(name)
        elif name == "tare":
            self._device.tare(value == FORCE)
        elif name == "reboot":
            self._device.reboot()
        elif name == "restore_defaults":
            self._settings.restore_defaults()
            for setting in sorted(_SETTINGS):
                self._on_change(setting)
        elif name == "calibration":
            self._device.upload_calibration(value)
        elif name == "error_n":
            self._errors.clear()
        elif name.endswith("_transmission"):
            if not (1 <= value <= 240 or value == 254):
                raise ValueError(f"transmission type {value}: 1..240 or 254")
            self.transmission[obj.index - 0x1800 + 1] = value
        else:
            raise Aborted(Abort.UNSUPPORTED)


def _find(index: int, sub: int) -> Object:
    try:
        return object_at(index, sub)
    except KeyError:
        raise Aborted(Abort.NO_SUB if index in _INDICES else Abort.NO_OBJECT) from None


def size_of(index: int, sub: int) -> int:
    """Bytes of a number; 4, as many as a frame has, of anything else."""
    try:
        return struct.calcsize(TYPES[_find(index, sub).type][1]) or 4
    except Aborted:
        return 4


def _encode(obj: Object, value: Value) -> bytes:
    if isinstance(value, str | bytes):
        return pack_value(obj, value)
    # Counters are read modulo their width: they count for years.
    code = TYPES[obj.type][1]
    if code == "f":
        return struct.pack("<f", value)
    size = struct.calcsize(code)
    return (int(value) & (1 << 8 * size) - 1).to_bytes(size, "little")
