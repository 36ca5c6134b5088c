"""THE table: the contents of a sample, and their places in the frame. Everything else is generated from it.

    STATE FRAME, 64 bytes, little-endian, on CAN FD and serial alike

     0        2      3       4        6        8            12       14   15
    +--------+------+-------+--------+--------+------------+--------+----+----+
    | CRC-16 | cntr | versn | sample | status | time  (us) | latency|pins|cont|   E2E profile 5, header
    +--------+------+-------+--------+--------+------------+--------+----+----+
    16       18   19       21       23       25   26       28   29   30   31       33       35
    +--------+----+--------+--------+--------+----+--------+----+----+----+--------+--------+
    | displ. |sigm| force  | force x| force y|sigm| torque |sigm|fric|marg| press. | area   |
    +--------+----+--------+--------+--------+----+--------+----+----+----+--------+--------+
    35       37       39   40       42       44       46   47   48   49
    +--------+--------+----+--------+--------+--------+----+----+----+
    | shear x| shear y|sigm| torsion| tilt x | tilt y |slip|prob|of t|   `of t`: its probability, of a twist
    +--------+--------+----+--------+--------+--------+----+----+----+
    49          54          59   60   61   62       64
    +-----------+-----------+----+----+----+--------+
    | contact 0 | contact 1 |ori.|vibr|temp| check  |
    +-----------+-----------+----+----+----+--------+

Rules
- A finite value saturates at the field's range. NaN is the type's most negative value, or the largest
  of an unsigned one; it means "not measured, not calibrated, not asked for or not to be trusted".
- `raw = round(value / scale)`, half to even; `value = raw * scale`. There are no offsets.
- A standard deviation that is more than 0 is sent as one step at least: who weighs by it divides by it.
- The range is narrower than the type if classic CAN has fewer bits, so that both carry the same values.
- The first four bytes (CRC, counter, version) stay where they are in every future version.
- `check` is the low half of the CRC-32 (zlib) over version and fields: the CRC-16 alone would let one in
  33,000 of the frames with 4, 6 or 8 flipped bits pass.
- Decoders take the versions before too: `OLDER`.
- A change of any table here changes `SCHEMA_HASH`, and with it the CRC of every frame.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import sha256
from struct import Struct, calcsize
from typing import Final

from hostlink.wire.status import STATUS

__all__ = [
    "CHECK_SIZE",
    "CLASSIC_BITS",
    "CONTACTS_MAX",
    "DATA_ID",
    "DATA_ID_CLASSIC",
    "FEATURES",
    "FIELDS",
    "HEADER_SIZE",
    "LAYOUT",
    "OLDER",
    "PARTS",
    "SCHEMA",
    "SCHEMA_HASH",
    "SCHEMA_TEXT",
    "STATE_SIZE",
    "VERSION",
    "Field",
    "Part",
    "Schema",
    "field_named",
]

VERSION: Final = 4  # of the layout; at most 255. Its low 4 bits travel in every classic part.
HEADER_SIZE: Final = 4  # E2E profile 5 (3 bytes) and the version
CHECK_SIZE: Final = 2  # at the end of the state frame
STATE_SIZE: Final = 64  # the largest CAN FD frame
CONTACTS_MAX: Final = 2

# struct's type code -> (lowest raw value, highest raw value, NaN)
_TYPES: Final = {
    "b": (-0x7F, 0x7F, -0x80),
    "B": (0, 0xFE, 0xFF),
    "h": (-0x7FFF, 0x7FFF, -0x8000),
    "H": (0, 0xFFFE, 0xFFFF),
}


@dataclass(frozen=True, slots=True)
class Shown:
    """How viewers show a value: pages beside the picture and over time, `plot` over time.

    title   of its chart; values with the same title share one, as x and y
    number  its name beside the picture; "": it is not shown there
    digits  behind the point there; a share is in percent
    sigma   the field with its standard deviation
    least   span of a live chart's axis at least, in the field's unit; 0: pages do not chart it
    """

    title: str
    number: str = ""
    digits: int = 2
    sigma: str = ""
    least: float = 0.0


@dataclass(frozen=True, slots=True)
class Field:
    """One value of the state frame.

    name       of the attribute of `State`, with its unit; contact<i>_<name> is one of `contacts[i]`
    code       struct's letter of its type in the 64-byte frame
    scale      value of one step, in `unit`; 0 for plain integers (counters, bits), which have no NaN
    low, high  range in `unit`; beyond it the value saturates (plain integers: see `state`)
    bits       width on classic CAN
    meaning    quantity, frame of reference, sign
    why        why this type, scale and range
    shown      how viewers show it; None: tables only
    """

    name: str
    code: str
    scale: float
    unit: str
    low: float
    high: float
    bits: int
    meaning: str
    why: str
    shown: Shown | None = None

    @property
    def signed(self) -> bool:
        return self.code.islower()

    @property
    def plain(self) -> bool:
        """A counter or a set of bits rather than a measured value."""
        return self.scale == 0

    @property
    def contact(self) -> bool:
        """Belongs to one of the listed contacts."""
        return self.name[:7] == "contact" and self.name[7].isdigit()

    @property
    def size(self) -> int:
        """Bytes in the 64-byte frame."""
        return calcsize("<" + self.code)

    @property
    def raw_low(self) -> int:
        return int(self.low) if self.plain else round(self.low / self.scale)

    @property
    def raw_least(self) -> int:
        """The lowest raw value of what is more than `low`."""
        return self.raw_low + ("_sigma_" in self.name)

    @property
    def raw_high(self) -> int:
        return int(self.high) if self.plain else round(self.high / self.scale)

    def raw_nan(self, bits: int) -> int:
        """The raw value that means NaN in a representation of this width."""
        return -(1 << bits - 1) if self.signed else (1 << bits) - 1


_F = Field
_S = Shown


def _contact(i: int) -> tuple[Field, ...]:
    why = "the displacement field has the resolution; this tells strong from weak contacts"
    return (
        _F(f"contact{i}_x_mm", "h", 0.002, "mm", -65, 65, 16, f"place of contact {i}, x (tip frame)",
           "65 mm holds every fingertip; contacts come strongest first"),
        _F(f"contact{i}_y_mm", "h", 0.002, "mm", -65, 65, 16, f"place of contact {i}, y (tip frame)",
           "see x; NaN in both: no such contact"),
        _F(f"contact{i}_depth_mm", "B", 0.025, "mm", 0, 6.35, 8, f"depth of contact {i} into the skin", why),
    )  # fmt: skip


# Frame of reference `tip`: mm, x right and y down in the camera's image, origin on the tip's axis,
# z out of the skin. In the order of the frame, behind the header.
LAYOUT: Final = (
    _F("sample", "H", 0, "", 0, 0xFFFF, 16,
       "sample number; counts up by one with every measurement, wraps to 0",
       "ties state, detail and classic parts together; 16 bits are 4.5 minutes at 240 Hz. Loss is where it "
       "and the E2E counter jump; with a divider only it does"),
    _F("status", "H", 0, "", 0, 0xFFFF, 16, "status bits, see the table of status bits",
       "one look tells a controller whether to trust the sample"),
    _F("capture_time_us", "I", 0, "us", 0, 0xFFFF_FFFF, 32,
       "start of exposure on the sensor's monotonic clock; wraps to 0 after 71.6 minutes",
       "capture, not sending: a controller needs the age of what it sees"),
    _F("latency_us", "H", 10, "us", 0, 655_340, 16, "time from capture to sending of this sample",
       "steps of 10 us resolve 1 ms well and still hold a camera at 2 Hz"),
    _F("pins_tracked", "B", 0.004, "", 0, 1, 8, "share of the pins whose place is known, 0..1",
       "a share, as tips differ in their number of pins; 250 steps: about one pin of 331"),
    _F("contact_n", "B", 0, "", 0, 14, 4, "number of separate contacts; up to 2 of them are listed below",
       "more than are listed may exist, and a controller should know"),
    _F("displacement_mm", "h", 0.002, "mm", -16, 16, 14,
       "depth by which the skin is pressed in, along z; positive is into the tip",
       "signed, so that noise about zero stays unbiased; 2 um is 1/20 of the sensor's noise",
       _S("depth", "Depth", sigma="displacement_sigma_mm", least=0.5)),
    _F("displacement_sigma_mm", "B", 0.008, "mm", 0, 2.032, 8, "standard deviation of the displacement",
       "lets a filter weigh the value; above 2 mm its weight is nil"),
    _F("force_n", "h", 0.002, "N", -65, 65, 16, "normal force on the tip; positive presses the tip",
       "needs a calibration with a force gauge",
       _S("normal force", "Force", least=0.5)),
    _F("force_x_n", "h", 0.002, "N", -65, 65, 16,
       "friction force on the tip along x (tip frame): what drags the skin towards x is positive",
       "as the normal force: a controller divides the two",
       _S("tangential force", "Force x", sigma="force_xy_sigma_n", least=0.2)),
    _F("force_y_n", "h", 0.002, "N", -65, 65, 16, "friction force on the tip along y (tip frame)",
       "see force_x_n",
       _S("tangential force", "Force y", sigma="force_xy_sigma_n", least=0.2)),
    _F("force_xy_sigma_n", "B", 0.01, "N", 0, 2.54, 8, "standard deviation of force_x_n and of force_y_n",
       "see displacement_sigma_mm"),
    _F("torque_z_nmm", "h", 0.02, "Nmm", -640, 640, 16,
       "torque of the friction on the tip about z, positive from x to y",
       "10 N on a contact 8 mm in radius twist with some 50 N mm",
       _S("torque", "Torque", 1, sigma="torque_z_sigma_nmm")),
    _F("torque_z_sigma_nmm", "B", 0.1, "Nmm", 0, 25.4, 8, "standard deviation of the torque",
       "see displacement_sigma_mm"),
    _F("friction", "B", 0.02, "", 0, 5.08, 8,
       "largest tangential over normal load that this contact has held, its torque included",
       "skin on most objects: 0.2..1.5; a lower bound until something slips",
       _S("friction", "Friction")),
    _F("slip_margin", "B", 0.004, "", 0, 1, 8,
       "1 less the present tangential over normal load in units of `friction`; 0: nothing more has been "
       "held; not known before the first tangential load of a contact",
       "grip harder where it is small and the load high; all through the first drag of a contact it is 0",
       _S("slip margin left", "Slip margin", least=1)),
    _F("pressure_kpa", "h", 0.05, "kPa", -1600, 1600, 16, "force over contact area",
       "fingertips: 10..1000 kPa",
       _S("pressure")),
    _F("contact_area_mm2", "H", 0.02, "mm2", 0, 1310, 16, "area of skin in contact, all contacts together",
       "the whole face of a 40 mm tip is 1257 mm2",
       _S("contact area")),
    _F("shear_x_mm", "h", 0.002, "mm", -16, 16, 14, "motion of the contact along x (tip frame) since contact",
       "same step as the displacement: a grasp controller compares the two",
       _S("shear", "Shear x", sigma="shear_sigma_mm", least=0.2)),
    _F("shear_y_mm", "h", 0.002, "mm", -16, 16, 14, "motion of the contact along y (tip frame) since contact",
       "see shear_x_mm",
       _S("shear", "Shear y", sigma="shear_sigma_mm", least=0.2)),
    _F("shear_sigma_mm", "B", 0.008, "mm", 0, 2.032, 8, "standard deviation of each axis of the shear",
       "see displacement_sigma_mm"),
    _F("torsion_deg", "h", 0.01, "deg", -180, 180, 16, "twist of the contact about z, positive from x to y",
       "one type for all angles",
       _S("torsion", "Torsion", 1, least=2)),
    _F("tilt_x_deg", "h", 0.01, "deg", -180, 180, 16, "tilt of the touched surface about x, right-handed",
       "what tactile servoing steers by",
       _S("tilt", "Tilt x", 1)),
    _F("tilt_y_deg", "h", 0.01, "deg", -180, 180, 16, "tilt of the touched surface about y, right-handed",
       "see tilt_x_deg",
       _S("tilt", "Tilt y", 1)),
    _F("slip_speed_mm_s", "B", 0.25, "mm/s", 0, 63.5, 8, "speed of the skin beyond what the load explains",
       "skin that is torn by 1 mm within four images at 240 Hz; the pins' noise is 0.25 mm/s there",
       _S("slip speed")),
    _F("slip_probability", "B", 0.004, "", 0, 1, 8,
       "probability that more than a third of the contact's area slides, 0..1; slip begins at the rim",
       "announces that all of it will slide; a threshold on it is the controller's choice",
       _S("slip probability", "Slip")),
    _F("twist_slip_probability", "B", 0.004, "", 0, 1, 8,
       "the same of a twist alone, 0..1; slip_probability is the larger one of twist and drag",
       "an object that turns in the grip is held by another force than one that is pulled out",
       _S("slip probability", "Slip, twist")),
    *_contact(0), *_contact(1),
    _F("orientation_deg", "b", 0.75, "deg", -90, 90, 8,
       "direction of the long axis of the contact (edge), from x towards y, in (-90, 90]",
       "an axis has no head: 180 degrees hold it all; the step is a quarter of the direction's error"),
    _F("vibration_mm", "B", 0.002, "mm", 0, 0.508, 8,
       "rms motion of the contact's pins above 10 Hz, up to half the rate of images; 0: no contact",
       "textures and stick-slip move skin by 0.01..0.3 mm; slower motion is shear",
       _S("vibration", "Vibration", 3)),
    _F("temperature_degc", "b", 1.0, "degC", -40, 125, 8, "temperature of the board",
       "explains drift and faults; one degree is enough for that"),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Part:
    """One 8-byte message of the classic layout: 2 bytes E2E, 5 bits of sample number, [3 bits page], fields.

    index   of the part in the sample; part of its data id, so that parts cannot be confused
    tpdo    which TPDO's CAN id carries it, 1..4
    page    value of the multiplexer; None: the message has none, and 43 bits for fields
    fields  low bits first
    always  sent with every sample; others only when one of their values is valid
    """

    index: int
    tpdo: int
    page: int | None
    fields: tuple[str, ...]
    always: bool = False


SAMPLE_LOW_BITS: Final = 5
PAGE_BITS: Final = 3

# `sample_high` is the sample number without its low 5 bits, `part_n` the number of parts of this sample,
# `check` the low byte of the state frame's.
PARTS: Final = (
    Part(0, 1, None, ("displacement_mm", "shear_x_mm", "shear_y_mm"), always=True),
    Part(1, 2, None, ("status", "sample_high", "pins_tracked", "contact_n", "part_n"), always=True),
    Part(2, 3, 0, ("capture_time_us", "check"), always=True),
    Part(3, 3, 1, ("displacement_sigma_mm", "shear_sigma_mm", "latency_us", "temperature_degc"), always=True),
    Part(4, 3, 2, ("force_n", "pressure_kpa")),
    Part(5, 3, 3, ("contact_area_mm2", "orientation_deg", "vibration_mm")),
    Part(6, 3, 4, ("tilt_x_deg", "tilt_y_deg")),
    Part(7, 3, 5, ("torsion_deg", "slip_speed_mm_s", "slip_probability", "twist_slip_probability")),
    Part(8, 3, 6, ("force_x_n", "force_y_n", "force_xy_sigma_n")),
    Part(9, 3, 7, ("torque_z_nmm", "torque_z_sigma_nmm", "friction", "slip_margin")),
    *(
        Part(10 + i, 4, i, (f"contact{i}_x_mm", f"contact{i}_y_mm", f"contact{i}_depth_mm"))
        for i in range(CONTACTS_MAX)
    ),
)

# Widths of fields of the classic layout only; plain integers.
CLASSIC_BITS: Final = {"sample_high": 16 - SAMPLE_LOW_BITS, "part_n": 4, "check": 8}

#: Names of `edge.types.Feature` that can be asked for, by the bit of the object `features`.
FEATURES: Final = (
    "displacement", "force", "pressure", "contact_area", "contacts", "shear", "torsion", "tilt", "slip",
    "orientation", "vibration",
)  # fmt: skip

# These are attributes of `State`; the contacts are tuples there.
FIELDS: Final = tuple(f for f in LAYOUT if not f.contact)


@dataclass(frozen=True, eq=False)
class Schema:
    """One version of the layout; fields and parts as `LAYOUT` and `PARTS` have them."""

    version: int
    layout: tuple[Field, ...]
    parts: tuple[Part, ...]

    @cached_property
    def text(self) -> str:
        """All that decides how bits become values, in a canonical form."""
        lines = [f"version {self.version} size {STATE_SIZE} check {CHECK_SIZE}"]
        lines += [
            f"{f.name} {f.code} {f.scale!r} {f.unit} {f.low!r} {f.high!r} {f.bits}" for f in self.layout
        ]
        lines += [f"part {p.index} {p.tpdo} {p.page} {' '.join(p.fields)} {p.always}" for p in self.parts]
        lines += [f"status {s.bit.value:#06x} {s.bit.name}" for s in STATUS]
        return "\n".join(lines) + "\n"

    @cached_property
    def hash(self) -> int:
        """32 bits of the text's."""
        return int.from_bytes(sha256(self.text.encode()).digest()[:4], "big")

    @cached_property
    def data_id(self) -> int:
        """E2E profile 5: 16 bits of the hash."""
        return self.hash & 0xFFFF

    @cached_property
    def data_id_classic(self) -> int:
        """Profile 11C: version (the nibble that is sent) and 8 bits of the hash, of which the low 4 are left
        free for the part's index.
        """
        return (self.version & 0xF) << 8 | self.hash >> 16 & 0xF0

    @cached_property
    def body(self) -> Struct:
        """Version and fields, as they lie in the state frame."""
        return Struct("<B" + "".join(f.code for f in self.layout))

    def field_named(self, name: str) -> Field:
        """The row of the table with this name. Raises KeyError."""
        return self._by_name[name]

    @cached_property
    def _by_name(self) -> dict[str, Field]:
        return {f.name: f for f in self.layout}


SCHEMA: Final = Schema(VERSION, LAYOUT, PARTS)
field_named: Final = SCHEMA.field_named


def _before(schema: Schema, new: str, finer: Field) -> Schema:
    """The version before this one, without its new field; in its place, another had more bits."""
    layout = tuple(finer if f.name == finer.name else f for f in schema.layout if f.name != new)
    parts = tuple(replace(p, fields=tuple(name for name in p.fields if name != new)) for p in schema.parts)
    return Schema(schema.version - 1, layout, parts)


_SPEED_3: Final = replace(field_named("slip_speed_mm_s"), code="H", scale=0.01, high=655, bits=16)
_VERSION_3: Final = _before(SCHEMA, "twist_slip_probability", _SPEED_3)
_DIRECTION_2: Final = replace(field_named("orientation_deg"), code="h", scale=0.01, bits=16)
_VERSION_2: Final = _before(_VERSION_3, "vibration_mm", _DIRECTION_2)

#: Older versions that receivers still decode besides this one.
OLDER: Final = {schema.version: schema for schema in (_VERSION_3, _VERSION_2)}

SCHEMA_TEXT: Final = SCHEMA.text
SCHEMA_HASH: Final = SCHEMA.hash
DATA_ID: Final = SCHEMA.data_id
DATA_ID_CLASSIC: Final = SCHEMA.data_id_classic
