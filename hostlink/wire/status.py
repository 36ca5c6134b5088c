"""Status bits and faults: the sensor's report on itself.

Two tables. `STATUS` is the 16 bits sent with every sample; `FAULTS` lists the faults, finer than the bits: a
fault sets its bit for as long as it lasts, sends one emergency (EMCY) when it appears
and one with code 0 ("error reset") when the last fault has cleared.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum, IntFlag
from functools import cache
from typing import Final

__all__ = [
    "FAULTS",
    "NO_CONTROL",
    "REGISTER_BITS",
    "STATUS",
    "Fault",
    "FaultCode",
    "Status",
    "StatusBit",
    "status_of",
]


class Status(IntFlag):
    """Bits of the state frame's status field. Meanings: `STATUS`."""

    TOUCHED = 1 << 0
    UNCALIBRATED = 1 << 1
    SATURATED = 1 << 2
    OVERLOAD = 1 << 3
    CAMERA_FAULT = 1 << 4
    IMAGE_FAULT = 1 << 5
    PINS_LOST = 1 << 6
    TRACKER_LOST = 1 << 7
    TARE_FAULT = 1 << 8
    CAMERA_MOVED = 1 << 9
    FRAMES_DROPPED = 1 << 10
    LINK_FAULT = 1 << 11
    STORAGE_FAULT = 1 << 12
    CLOCK_STEP = 1 << 13
    OVER_TEMPERATURE = 1 << 14
    NOT_LIVE = 1 << 15


status_of: Final = cache(Status)  # making a flag from its bits costs as much as the rest of a sample


@dataclass(frozen=True, slots=True)
class StatusBit:
    """One row: the bit, its meaning, and what a controller should do.

    no_control  a sample with this bit must not move a hand
    """

    bit: Status
    meaning: str
    advice: str
    no_control: bool = False


STATUS: Final = (
    StatusBit(Status.TOUCHED, "something touches the tip", "no fault; contacts and areas are worth reading"),
    StatusBit(Status.UNCALIBRATED, "no calibration of this tip is applied", "calibrated fields are invalid"),
    StatusBit(
        Status.SATURATED,
        "a value lies outside of its calibrated range",
        "it is an end of the range, the nearer one where its sigma is small",
    ),
    StatusBit(Status.OVERLOAD, "the tip is pressed or sheared beyond its limit", "let go"),
    StatusBit(Status.CAMERA_FAULT, "no new images", "every measured field is invalid", no_control=True),
    StatusBit(Status.IMAGE_FAULT, "image too dark, too bright or out of focus", "values may be noisy"),
    StatusBit(Status.PINS_LOST, "too few pins are seen", "values that cannot be trusted are invalid"),
    StatusBit(
        Status.TRACKER_LOST,
        "which pin is which is not known",
        "all values are invalid until it is",
        no_control=True,
    ),
    StatusBit(
        Status.TARE_FAULT,
        "the last rest frame was refused, or forced although implausible",
        "tare again with nothing touching the tip",
        no_control=True,
    ),
    StatusBit(
        Status.CAMERA_MOVED,
        "the camera sits differently than at the last tare",
        "tare; calibrate again",
        no_control=True,
    ),
    StatusBit(
        Status.FRAMES_DROPPED, "images were skipped since the last sample", "the rate is lower than asked"
    ),
    StatusBit(
        Status.LINK_FAULT, "samples were lost in sending since the last one sent", "see the sample number"
    ),
    StatusBit(Status.STORAGE_FAULT, "recordings or settings cannot be written", "the measurement goes on"),
    StatusBit(Status.CLOCK_STEP, "the capture clock jumped since the last sample", "map the clock anew"),
    StatusBit(Status.OVER_TEMPERATURE, "board or camera is too warm", "improve cooling; the rate may drop"),
    StatusBit(
        Status.NOT_LIVE, "from a recording or the simulator, not from a camera", "not what is felt now",
        no_control=True,
    ),
)  # fmt: skip

#: Never move a hand on a sample that has one of these bits.
NO_CONTROL: Final = Status(sum(row.bit for row in STATUS if row.no_control))


class FaultCode(IntEnum):
    """Our own number of a fault: byte 3 of the emergency message."""

    CAMERA_LOST = 1
    CAMERA_STALLED = 2
    IMAGE_DARK = 3
    IMAGE_BRIGHT = 4
    IMAGE_BLURRED = 5
    CAMERA_MOVED = 6
    PINS_LOST = 7
    TRACKER_LOST = 8
    CALIBRATION_MISSING = 9
    CALIBRATION_FOREIGN = 10
    TARE_IMPLAUSIBLE = 11
    OVERLOAD = 12
    LINK_DOWN = 13
    BUS_OFF = 14
    DISK_FULL = 15
    CLOCK_STEP = 16
    OVER_TEMPERATURE = 17


@dataclass(frozen=True, slots=True)
class Fault:
    """One row of the fault table.

    code      our number
    status    the bit it sets
    emcy      CiA 301 emergency error code
    register  bits of the error register 0x1001: `REGISTER_BITS`
    meaning   what is wrong, for a person
    host_sees what the samples look like meanwhile
    clears    what ends it
    """

    code: FaultCode
    status: Status
    emcy: int
    register: int
    meaning: str
    host_sees: str
    clears: str


#: CiA 301, object 0x1001, from bit 0 on: name, meaning; bits that no fault sets have no name.
REGISTER_BITS: Final = (
    ("generic", "any error"),
    (None, ""),
    (None, ""),
    ("temperature", "temperature"),
    ("communication", "communication"),
    (None, ""),
    (None, ""),
    ("manufacturer", "camera, light or lens"),
)
_GENERIC: Final = 0x01
_TEMPERATURE: Final = 0x08 | _GENERIC
_COMMUNICATION: Final = 0x10 | _GENERIC
_MANUFACTURER: Final = 0x80 | _GENERIC

# Emergency codes: CiA 301 table "emergency error code classes": 0x42xx device temperature, 0x50xx device
# hardware, 0x60xx device software, 0x63xx data set, 0x81xx communication, 0x90xx external error,
# 0xFFxx device specific.
FAULTS: Final = (
    Fault(FaultCode.CAMERA_LOST, Status.CAMERA_FAULT, 0x5001, _MANUFACTURER,
          "camera unplugged or its driver failed", "samples at the slow rate, measured fields invalid",
          "by itself when the camera is back"),
    Fault(FaultCode.CAMERA_STALLED, Status.CAMERA_FAULT, 0x5002, _MANUFACTURER,
          "camera is there but sends no images", "samples at the slow rate, measured fields invalid",
          "with the next image"),
    Fault(FaultCode.IMAGE_DARK, Status.IMAGE_FAULT, 0x5003, _MANUFACTURER,
          "image too dark: light failed or exposure too short", "fewer pins tracked, more noise",
          "when the image is bright enough"),
    Fault(FaultCode.IMAGE_BRIGHT, Status.IMAGE_FAULT, 0x5004, _MANUFACTURER,
          "image overexposed: stray light or exposure too long", "fewer pins tracked, more noise",
          "when the image is no longer overexposed"),
    Fault(FaultCode.IMAGE_BLURRED, Status.IMAGE_FAULT, 0x5005, _MANUFACTURER,
          "image out of focus, or the lens is dirty", "larger sigma", "when pins are sharp again"),
    Fault(FaultCode.CAMERA_MOVED, Status.CAMERA_MOVED, 0x5006, _MANUFACTURER,
          "pins at rest are not where the rest frame has them, or all took the same step", "values offset",
          "when they are back, or with the next good tare"),
    Fault(FaultCode.PINS_LOST, Status.PINS_LOST, 0x9001, _GENERIC,
          "too few pins are seen: skin torn, covered or flooded with light", "untrusted fields invalid",
          "when enough pins are seen again"),
    Fault(FaultCode.TRACKER_LOST, Status.TRACKER_LOST, 0x6101, _GENERIC,
          "pins are seen but which is which is not known", "measured fields invalid",
          "by itself when a full search succeeds; tare if it does not"),
    Fault(FaultCode.CALIBRATION_MISSING, Status.UNCALIBRATED, 0x6301, _GENERIC,
          "no calibration file", "calibrated fields invalid", "upload a calibration"),
    Fault(FaultCode.CALIBRATION_FOREIGN, Status.UNCALIBRATED, 0x6302, _GENERIC,
          "the calibration belongs to another tip", "calibrated fields invalid",
          "upload the calibration of this tip"),
    Fault(FaultCode.TARE_IMPLAUSIBLE, Status.TARE_FAULT, 0x6303, _GENERIC,
          "the last rest frame shows a touched tip or too few pins",
          "values relative to the one before, or to that one where it was forced; invalid without either",
          "with the next rest frame that is accepted"),
    Fault(FaultCode.OVERLOAD, Status.OVERLOAD, 0x9002, _GENERIC,
          "pressed or sheared beyond the tip's limit", "values saturate", "when the load is gone"),
    Fault(FaultCode.LINK_DOWN, Status.LINK_FAULT, 0x8101, _COMMUNICATION,
          "bus or serial line refused frames", "a gap in the sample numbers", "with the first frame sent"),
    Fault(FaultCode.BUS_OFF, Status.LINK_FAULT, 0x8140, _COMMUNICATION,
          "CAN controller went bus-off and recovered", "a gap in the sample numbers",
          "with the first frame sent"),
    Fault(FaultCode.DISK_FULL, Status.STORAGE_FAULT, 0x6001, _GENERIC,
          "no room for recordings or settings", "measurement unaffected", "when there is room again"),
    Fault(FaultCode.CLOCK_STEP, Status.CLOCK_STEP, 0x6002, _GENERIC,
          "the clock that stamps images jumped", "one jump in the capture time", "with the next sample"),
    Fault(FaultCode.OVER_TEMPERATURE, Status.OVER_TEMPERATURE, 0x4201, _TEMPERATURE,
          "board or camera too warm", "temperature field; the rate may drop", "when it has cooled down"),
)  # fmt: skip
