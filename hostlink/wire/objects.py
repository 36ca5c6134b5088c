"""The object table: what can be read and set on a node, over SDO and over serial alike.

The node implements it, the EDS and the documentation are generated from it, the host reads and writes by
it. Values: little-endian, as in CiA 301; `pack_value` / `unpack_value`.

Rules
- 0x1000..0x1FFF are CiA 301's, 0x2000..0x2FFF ours.
- Access: ro, rw, wo, const as in CiA 301. `stored` objects survive a restart.
- A command object is wo: a write executes it, and the answer reports success or failure. If that takes
  longer than an answer may (`tare`, `calibration`: images have to be taken and checked), the answer reports
  the start, and `rest_frame_*` the outcome.
- `$NODEID` in a default is added to the base.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum
from math import isfinite
from typing import Final

from hostlink.wire.errors import CorruptFrame
from hostlink.wire.fields import FEATURES, SCHEMA_HASH, VERSION
from hostlink.wire.process_data import FRAME_DATA, MAPPING, SAMPLE_DATA

__all__ = [
    "ABORTS",
    "FEATURE_BITS",
    "FRAME_INDEX",
    "GROUPS",
    "OBJECTS",
    "REST_FRAME_REASONS",
    "REST_FRAME_STATES",
    "SAMPLE_INDEX",
    "TYPES",
    "Abort",
    "Object",
    "RestFrameReason",
    "RestFrameState",
    "Value",
    "object_at",
    "object_named",
    "pack_value",
    "unpack_value",
]

Value = int | float | str | bytes
_BITS_MAX: Final = 128  # of an integer; a real32 ends below that


@dataclass(frozen=True, slots=True)
class Object:
    """One row of the object dictionary.

    type      boolean, unsigned8/16/32/64, integer8/16/32, real32, visible_string, domain
    access    ro, rw, wo, const
    default   value at start-up, if it is fixed; None: set by the node
    low, high limits of a settable number (inclusive), else None
    unit      of the value, "" for none
    meaning   for a person
    node_id   the node id is added to the default (COB-IDs)
    stored    survives a restart
    scale     of process data: one step of the value, in `unit`
    """

    index: int
    sub: int
    name: str
    type: str
    access: str
    default: Value | None
    unit: str
    meaning: str
    low: float | None = None
    high: float | None = None
    node_id: bool = False
    stored: bool = False
    scale: float = 1.0


# CiA 301, table "object dictionary data types": EDS code, struct letter.
TYPES: Final[dict[str, tuple[int, str]]] = {
    "boolean": (0x01, "?"),
    "integer8": (0x02, "b"),
    "integer16": (0x03, "h"),
    "integer32": (0x04, "i"),
    "unsigned8": (0x05, "B"),
    "unsigned16": (0x06, "H"),
    "unsigned32": (0x07, "I"),
    "real32": (0x08, "f"),
    "visible_string": (0x09, ""),
    "domain": (0x0F, ""),
    "unsigned40": (0x18, ""),
    "unsigned64": (0x1B, "Q"),
}


class Abort:
    """CiA 301 SDO abort codes that the node answers with."""

    UNSUPPORTED = 0x06010000
    WRITE_ONLY = 0x06010001
    READ_ONLY = 0x06010002
    NO_OBJECT = 0x06020000
    HARDWARE = 0x06060000
    LENGTH = 0x06070010
    NO_SUB = 0x06090011
    VALUE_RANGE = 0x06090030
    VALUE_HIGH = 0x06090031
    VALUE_LOW = 0x06090032
    GENERAL = 0x08000000
    NOT_STORED = 0x08000020
    NOT_NOW = 0x08000022
    NO_DATA = 0x08000024
    TIMEOUT = 0x05040000
    COMMAND = 0x05040001
    BLOCK_SIZE = 0x05040002
    SEQUENCE = 0x05040003
    CRC = 0x05040004
    TOGGLE = 0x05030000


ABORTS: Final = {
    Abort.UNSUPPORTED: "unsupported access",
    Abort.WRITE_ONLY: "the object can only be written",
    Abort.READ_ONLY: "the object can only be read",
    Abort.NO_OBJECT: "no such object",
    Abort.HARDWARE: "access failed for a hardware reason",
    Abort.LENGTH: "the data's length does not fit the object's type",
    Abort.NO_SUB: "no such sub-index",
    Abort.VALUE_RANGE: "value not allowed",
    Abort.VALUE_HIGH: "value too high",
    Abort.VALUE_LOW: "value too low",
    Abort.GENERAL: "general error",
    Abort.NOT_STORED: "the value cannot be stored or applied",
    Abort.NOT_NOW: "not in the present state of the device (a tare needs an untouched tip, or force)",
    Abort.NO_DATA: "no data available",
    Abort.TIMEOUT: "the node did not answer in time",
    Abort.COMMAND: "no such command, or not now",
    Abort.BLOCK_SIZE: "a sub-block of a block transfer has 1 to 127 segments",
    Abort.SEQUENCE: "wrong number of a segment in a block transfer",
    Abort.CRC: "the CRC of a block transfer is wrong",
    Abort.TOGGLE: "segments out of step",
}


class RestFrameState(IntEnum):
    """Outcome of the last request for a rest frame: object `rest_frame_state`."""

    UNKNOWN = 0
    BUSY = 1
    ACCEPTED = 2
    REFUSED = 3
    FORCED = 4


class RestFrameReason(IntEnum):
    """Why a rest frame was refused, or why a forced one is implausible: object `rest_frame_reason`."""

    NONE = 0
    TOUCHED = 1
    UNSTEADY = 2
    TOO_FEW_PINS = 3
    NO_PIN_PATTERN = 4
    OTHER_TIP = 5
    NO_IMAGES = 6
    NOT_STORED = 7
    OTHER = 255


REST_FRAME_STATES: Final = {
    RestFrameState.UNKNOWN: "nothing was asked for yet, or the node cannot say",
    RestFrameState.BUSY: "images are being taken and judged; the rest frame before is in use",
    RestFrameState.ACCEPTED: "the new rest frame is in use",
    RestFrameState.REFUSED: "the rest frame (and the calibration) before stay in use; the reason says why",
    RestFrameState.FORCED: "in use because it was forced, although it is implausible for the given reason",
}
REST_FRAME_REASONS: Final = {
    RestFrameReason.NONE: "none",
    RestFrameReason.TOUCHED: "something touches the tip",
    RestFrameReason.UNSTEADY: "pins moved while the images were taken",
    RestFrameReason.TOO_FEW_PINS: "too few pins are seen",
    RestFrameReason.NO_PIN_PATTERN: "the image shows no pattern of pins",
    RestFrameReason.OTHER_TIP: "the pins are not those of the calibration",
    RestFrameReason.NO_IMAGES: "the camera gave no images",
    RestFrameReason.NOT_STORED: "the calibration cannot be stored",
    RestFrameReason.OTHER: "another reason, see `rest_frame_message`",
}

# Bits of `features`: what the sensor computes and sends; names of `edge.types.Feature`.
FEATURE_BITS: Final = {name: 1 << bit for bit, name in enumerate(FEATURES)}
_ALL_FEATURES: Final = sum(FEATURE_BITS.values())

# Product code in 0x1018: 1 = fingertip. We have no vendor id of CiA's: 0 is "none" there.
_VENDOR: Final = 0
_PRODUCT: Final = 1

_O = Object


SAMPLE_INDEX: Final = 0x2100  # process data: the newest sample
FRAME_INDEX: Final = 0x2101  # what only a message has
_DATA: Final = {SAMPLE_INDEX: ("sample_data", SAMPLE_DATA), FRAME_INDEX: ("pdo", FRAME_DATA)}
_PLACES: Final = {d.name: (index, i) for index, (_, rows) in _DATA.items() for i, d in enumerate(rows, 1)}


def _process_data(index: int) -> tuple[Object, ...]:
    name, rows = _DATA[index]
    return (
        _O(index, 0, f"{name}_max_sub", "unsigned8", "const", len(rows), "", "highest sub-index"),
        *(
            _O(index, i, d.name, d.type, "ro", None, d.unit, d.meaning, d.low, d.high, scale=d.scale)
            for i, d in enumerate(rows, 1)
        ),
    )


def _mapping(number: int) -> tuple[Object, ...]:
    """The parts of the TPDO: index, sub-index and bits of each object."""
    index, entries = 0x1A00 + number - 1, MAPPING[number]
    rows = []
    for i, (name, bits) in enumerate(entries, 1):
        at, sub = _PLACES[name]
        value = at << 16 | sub << 8 | bits
        rows.append(_O(index, i, f"tpdo{number}_mapped_{i}", "unsigned32", "const", value, "", name))
    meaning = "mapped objects; 0 on CAN FD, whose frames are longer than CANopen maps"
    return (_O(index, 0, f"tpdo{number}_mapped_n", "unsigned8", "ro", len(rows), "", meaning), *rows)


def _pdo(number: int, base: int) -> tuple[Object, ...]:
    """Communication and mapping parameters of one TPDO. The mapping is fixed."""
    comm = 0x1800 + number - 1
    return (
        _O(comm, 0, f"tpdo{number}_max_sub", "unsigned8", "const", 5, "", "last sub-index"),
        _O(comm, 1, f"tpdo{number}_cob_id", "unsigned32", "ro", base, "", "identifier; moved in the "
           "device's configuration", node_id=True),
        _O(comm, 2, f"tpdo{number}_transmission", "unsigned8", "rw", 254, "",
           "254: with each sample (by rate and divider); 1..240: with every n-th SYNC, the sample latched "
           "at the SYNC", 1, 254),
        _O(comm, 3, f"tpdo{number}_inhibit", "unsigned16", "ro", 0, "100us", "shortest time between two "
           "samples: that of `rate_hz`"),
        _O(comm, 5, f"tpdo{number}_event_timer", "unsigned16", "ro", 0, "ms", "no event timer"),
        *_mapping(number),
    )  # fmt: skip


OBJECTS: Final = (
    # --- CiA 301 ---
    _O(0x1000, 0, "device_type", "unsigned32", "const", 0, "", "0: no device profile of CiA's"),
    _O(0x1001, 0, "error_register", "unsigned8", "ro", 0, "", "bit 0 any error, 3 temperature, 4 "
       "communication, 7 device specific"),
    _O(0x1003, 0, "error_n", "unsigned8", "rw", 0, "", "entries in the error history; 0 clears it", 0, 0),
    *(_O(0x1003, i, f"error_{i}", "unsigned32", "ro", 0, "", "EMCY code and, in the upper half, our fault "
         "code; 1 is the newest") for i in range(1, 9)),
    _O(0x1005, 0, "sync_cob_id", "unsigned32", "ro", 0x80, "", "SYNC is accepted, not produced"),
    _O(0x1008, 0, "device_name", "visible_string", "const", "voronoi-touch", "", "product"),
    _O(0x1009, 0, "hardware_version", "visible_string", "const", None, "", "board the software runs on"),
    _O(0x100A, 0, "software_version", "visible_string", "const", None, "", "release of the firmware"),
    _O(0x1013, 0, "time_us", "unsigned32", "ro", None, "us", "the clock that stamps images, now: CiA's high "
       "resolution time stamp; a round trip bounds the error of the clock mapping"),
    _O(0x1014, 0, "emergency_cob_id", "unsigned32", "ro", 0x80, "", "identifier of EMCY", node_id=True),
    _O(0x1017, 0, "heartbeat_ms", "unsigned16", "rw", 500, "ms", "period of the heartbeat; 0 is off",
       0, 60_000, stored=True),
    _O(0x1018, 0, "identity_max_sub", "unsigned8", "const", 4, "", "highest sub-index"),
    _O(0x1018, 1, "vendor_id", "unsigned32", "const", _VENDOR, "", "0: none assigned by CiA"),
    _O(0x1018, 2, "product_code", "unsigned32", "const", _PRODUCT, "", "1: fingertip"),
    _O(0x1018, 3, "revision", "unsigned32", "const", VERSION << 16, "", "wire version in the upper half"),
    _O(0x1018, 4, "serial_short", "unsigned32", "const", None, "", "first 4 bytes of the SHA-256 of the "
       "serial number"),
    _O(0x1200, 0, "sdo_max_sub", "unsigned8", "const", 2, "", "highest sub-index"),
    _O(0x1200, 1, "sdo_request_cob_id", "unsigned32", "ro", 0x600, "", "host to node", node_id=True),
    _O(0x1200, 2, "sdo_response_cob_id", "unsigned32", "ro", 0x580, "", "node to host", node_id=True),
    *_pdo(1, 0x180), *_pdo(2, 0x280), *_pdo(3, 0x380), *_pdo(4, 0x480),
    # --- identity ---
    _O(0x2000, 0, "info_max_sub", "unsigned8", "const", 7, "", "highest sub-index"),
    _O(0x2000, 1, "wire_version", "unsigned8", "const", VERSION, "", "version of the frame layout"),
    _O(0x2000, 2, "schema_hash", "unsigned32", "const", SCHEMA_HASH, "", "hash of the field table: both ends "
       "must have the same"),
    _O(0x2000, 3, "serial_number", "visible_string", "const", None, "", "serial number of the fingertip"),
    _O(0x2000, 4, "calibration_id", "visible_string", "ro", "", "", "hash of the calibration; empty: none"),
    _O(0x2000, 5, "pin_n", "unsigned16", "ro", 0, "", "pins of the rest frame"),
    _O(0x2000, 6, "camera", "visible_string", "ro", "", "", "camera in use"),
    _O(0x2000, 7, "camera_rate_hz", "real32", "ro", 0.0, "Hz", "rate at which images come, measured"),
    # --- commands ---
    _O(0x2010, 0, "tare", "unsigned8", "wo", None, "", "1: take the rest frame, refused while touched; "
       "2: force, take it anyway", 1, 2),
    _O(0x2011, 0, "reboot", "unsigned32", "wo", None, "", "write 0x746F6F62 (the bytes 'boot'): restart "
       "the software", 0x746F6F62, 0x746F6F62),
    _O(0x2012, 0, "restore_defaults", "unsigned32", "wo", None, "", "write 0x64616F6C (the bytes 'load'): "
       "stored settings back to defaults", 0x64616F6C, 0x64616F6C),
    # --- settings ---
    _O(0x2020, 0, "settings_max_sub", "unsigned8", "const", 5, "", "highest sub-index"),
    _O(0x2020, 1, "rate_hz", "real32", "rw", 0.0, "Hz", "samples per second at the most; 0: every image",
       0, 1000, stored=True),
    _O(0x2020, 2, "divider", "unsigned16", "rw", 1, "", "send every n-th measurement", 1, 1000, stored=True),
    _O(0x2020, 3, "features", "unsigned32", "rw", _ALL_FEATURES, "", "bits of the features to compute and "
       "send; others are invalid", 0, _ALL_FEATURES, stored=True),
    _O(0x2020, 4, "detail_divider", "unsigned16", "rw", 0, "", "every pin's motion with every n-th sample; "
       "0 is off", 0, 1000, stored=True),
    _O(0x2020, 5, "settings_stored", "boolean", "ro", None, "", "1: settings and calibration survive a "
       "restart; 0: they hold until then, for there is no folder to store them in"),
    # --- calibration, and the rest frame that it is used with ---
    _O(0x2030, 0, "calibration", "domain", "rw", None, "", "the calibration file (JSON); a written one is "
       "validated, stored and applied, or refused", stored=True),
    _O(0x2031, 0, "refusal", "visible_string", "ro", "", "", "why the last write was refused, in words; "
       "empty: it was not, or its abort code says all"),
    _O(0x2032, 0, "rest_frame_max_sub", "unsigned8", "const", 4, "", "highest sub-index"),
    _O(0x2032, 1, "rest_frame_request_n", "unsigned16", "ro", 0, "", "number of the last request for a rest "
       "frame (`tare`, a written `calibration`) that was not refused at once; begins anew with a restart"),
    _O(0x2032, 2, "rest_frame_state", "unsigned8", "ro", RestFrameState.UNKNOWN, "", "what became of that "
       "request, see below"),
    _O(0x2032, 3, "rest_frame_reason", "unsigned8", "ro", RestFrameReason.NONE, "", "why it was refused, or "
       "what a forced one shows, see below"),
    _O(0x2032, 4, "rest_frame_message", "visible_string", "ro", "", "", "the same in words"),
    # --- statistics ---
    _O(0x2040, 0, "statistics_max_sub", "unsigned8", "const", 9, "", "highest sub-index"),
    _O(0x2040, 1, "uptime_s", "unsigned32", "ro", 0, "s", "since the software started"),
    _O(0x2040, 2, "samples_n", "unsigned32", "ro", 0, "", "samples measured"),
    _O(0x2040, 3, "sent_n", "unsigned32", "ro", 0, "", "samples sent"),
    _O(0x2040, 4, "unsent_n", "unsigned32", "ro", 0, "", "samples the link refused"),
    _O(0x2040, 5, "dropped_n", "unsigned32", "ro", 0, "", "images skipped"),
    _O(0x2040, 6, "link_lost_n", "unsigned32", "ro", 0, "", "times the link went down"),
    _O(0x2040, 7, "latency_p50_us", "unsigned32", "ro", 0, "us", "capture to sending, median"),
    _O(0x2040, 8, "latency_p99_us", "unsigned32", "ro", 0, "us", "capture to sending, 99th percentile"),
    _O(0x2040, 9, "detail_dropped_n", "unsigned32", "ro", 0, "", "detail frames that gave way to samples"),
    # --- process data ---
    *_process_data(SAMPLE_INDEX), *_process_data(FRAME_INDEX),
)  # fmt: skip

# Indexes with sub-indexes: name, CiA 301 object code (8 array, 9 record). All others are one variable.
GROUPS: Final = {
    0x1003: ("error_history", 8),
    0x1018: ("identity", 9),
    0x1200: ("sdo_server", 9),
    **{0x1800 + i: (f"tpdo{i + 1}_communication", 9) for i in range(4)},
    **{0x1A00 + i: (f"tpdo{i + 1}_mapping", 9) for i in range(4)},
    0x2000: ("info", 9),
    0x2020: ("settings", 9),
    0x2032: ("rest_frame", 9),
    0x2040: ("statistics", 9),
    **{index: (name, 9) for index, (name, _) in _DATA.items()},
}

_AT: Final = {(o.index, o.sub): o for o in OBJECTS}
_NAMED: Final = {o.name: o for o in OBJECTS}
assert len(_AT) == len(_NAMED) == len(OBJECTS)


def object_at(index: int, sub: int) -> Object:
    """The row. Raises KeyError."""
    return _AT[index, sub]


def object_named(name: str) -> Object:
    """The row. Raises KeyError."""
    return _NAMED[name]


def pack_value(obj: Object, value: Value) -> bytes:
    """The object's bytes, as SDO and serial carry them.

    Raises TypeError: value of the wrong kind; ValueError: outside of its limits or its type
    """
    if obj.type == "domain":
        if not isinstance(value, bytes | bytearray):
            raise TypeError(f"{obj.name}: bytes expected, not {type(value).__name__}")
        return bytes(value)
    if obj.type == "visible_string":
        if not isinstance(value, str):
            raise TypeError(f"{obj.name}: text expected, not {type(value).__name__}")
        return value.encode("utf-8")
    if not isinstance(value, int | float) or (isinstance(value, bool) and obj.type != "boolean"):
        raise TypeError(f"{obj.name}: a number ({obj.type}) expected, not {value!a:.40}")
    if isinstance(value, int) and value.bit_length() > _BITS_MAX:  # too long to be printed
        raise ValueError(f"{obj.name}: a number ({obj.type}) expected, not one of {value.bit_length()} bits")
    if obj.type != "real32" and not isfinite(value):
        raise ValueError(f"{obj.name}: a whole number ({obj.type}) expected, not {value}")
    if obj.type != "real32" and value != int(value):
        raise TypeError(f"{obj.name}: a whole number ({obj.type}) expected, not {value}")
    if obj.low is not None and obj.high is not None and not obj.low <= value <= obj.high:
        raise ValueError(f"{obj.name} = {_text(obj, value)}: give {_range(obj.low, obj.high, obj)}")
    try:
        return struct.pack("<" + TYPES[obj.type][1], value if obj.type == "real32" else int(value))
    except (struct.error, OverflowError) as error:
        raise ValueError(f"{obj.name} {value!r}: {error}") from None


def _text(obj: Object, value: float) -> str:
    number = f"{value:g}" if obj.type == "real32" or isinstance(value, float) else str(value)
    return f"{number} {obj.unit}".rstrip()


def _range(low: float, high: float, obj: Object) -> str:
    """A magic number (two equal limits) is shown in hexadecimal, as in the tables."""
    if low == high:
        return f"0x{int(low):X}" if low > 0xFFFF else _text(obj, low)
    return f"{_text(obj, low).partition(' ')[0]} to {_text(obj, high)}"


def unpack_value(obj: Object, data: bytes) -> Value:
    """The inverse of `pack_value`. Raises CorruptFrame: the length or the text does not fit the type."""
    if obj.type == "domain":
        return bytes(data)
    if obj.type == "visible_string":
        try:
            return data.decode("utf-8")
        except UnicodeDecodeError as error:
            raise CorruptFrame(f"object {obj.name}: {error}") from None
    try:
        value: Value = struct.unpack("<" + TYPES[obj.type][1], data)[0]
    except struct.error as error:
        raise CorruptFrame(f"object {obj.name}: {error}") from None
    return value
