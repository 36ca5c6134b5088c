"""A stage that speaks G-code over a serial line: GRBL or Marlin, each line answered before the next.

    [stage]  port, baud, dialect, home, feed_mm_min, clear_mm, dome_radius_mm, answer_s, boot_s
    [axes.X] at, sign, min, max        machine coordinate of the tip's axis; travel
    [axes.Z]                           `at`: where the tool just touches the untouched tip on its axis

Rules
- One line is out at a time: send, wait for `ok`. `error:N`, `ALARM:N`, `Error:` and silence are RigError,
  with GRBL's own text for the number.
- A move is complete when the dialect's synchronising command is answered, not when the move itself is.
- Nothing is sent that leaves the configured travel: the limits are checked here first, because not every
  controller has its own switched on.
Sources  GRBL v1.1 interface and its error and alarm code tables; Marlin G28, M400, M115, serial "ok".
"""

import re
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import msgspec
import serial

from calib.errors import RigError
from edge.limits import Number, read_toml_as
from hostlink.wire.open_errors import message_of

# GRBL v1.1, the codes that a calibration can meet.
GRBL_ERRORS = {
    1: "G-code words consist of a letter and a value",
    2: "bad number format",
    3: "unknown $ statement",
    5: "homing is not enabled; set $22=1, or home = false",
    7: "EEPROM read failed",
    8: "not while the stage is moving",
    9: "locked out during alarm; home it",
    15: "target exceeds the machine's travel",
    16: "jog command without =, or with prohibited G-code",
    20: "unsupported G-code command",
    22: "feed rate has not been set",
    33: "motion command has an invalid target",
}
GRBL_ALARMS = {
    1: "hard limit; the position is lost, home again",
    2: "target exceeds the machine's travel; the position is kept, unlock",
    3: "reset while moving; the position is lost, home again",
    4: "probe is not in the expected state",
    5: "probe did not touch",
    6: "homing was reset",
    7: "homing: a door was open",
    8: "homing: the limit switch did not clear",
    9: "homing: no limit switch found",
}


@dataclass(frozen=True, slots=True)
class _Dialect:
    hello: str  # a line of the start-up banner begins with this
    ask: bytes  # request for identification, for a board that has booted already
    answer: str  # with a line that begins so
    ends_with_ok: bool  # and whether an `ok` follows
    home: str
    sync: str  # answered when the planner's queue is empty and the machine has stopped


DIALECTS = {
    "grbl": _Dialect("Grbl ", b"\x18", "Grbl ", False, "$H", "G4 P0.01"),
    "marlin": _Dialect("start", b"M115\n", "FIRMWARE_NAME:Marlin", True, "G28", "M400"),
}


Seconds = Annotated[float, msgspec.Meta(ge=0.01, le=3600)]


class AxisTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One axis of the stage, in its own coordinates (mm; degrees for a rotary one)."""

    at: Number = 0.0
    sign: float = 1.0
    min: Number = -1e9
    max: Number = 1e9


class StageTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    port: str
    baud: Annotated[int, msgspec.Meta(ge=1200, le=12_000_000)] = 115200
    dialect: str = "grbl"
    home: bool = True
    feed_mm_min: Annotated[float, msgspec.Meta(ge=0.1, le=1e5)] = 300.0
    clear_mm: Annotated[float, msgspec.Meta(ge=0.1, le=1000)] = 5.0
    dome_radius_mm: Annotated[float, msgspec.Meta(ge=0.1, le=1000)] = 20.0
    answer_s: Seconds = 60.0  # a homing cycle across a desktop stage takes half of this
    boot_s: Seconds = 3.0  # an Arduino's boot loader takes 2 s


class StageFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """X, Y and Z carry the tool: Z grows away from the tip. "A", if present, twists it."""

    stage: StageTable
    axes: dict[str, AxisTable] = {}


def load_stage(spec: str) -> StageFile:
    """The settings from a TOML file, or defaults for a port. Raises RigError: one line, file and key."""
    if not spec.endswith(".toml"):
        return StageFile(stage=StageTable(port=spec))
    path = Path(spec)
    try:
        _, known = read_toml_as(path, StageFile)
    except ValueError as error:
        raise RigError(f"{path}: {error}") from None
    if known.stage.dialect not in DIALECTS:
        raise RigError(f"{path}: dialect {known.stage.dialect!r} is unknown; one of {', '.join(DIALECTS)}")
    for letter in known.axes:
        if letter not in ("X", "Y", "Z", "A"):
            raise RigError(f"{path}: axes.{letter} is unknown; one of X, Y, Z, A")
        if abs(known.axes[letter].sign) != 1:
            raise RigError(f"{path}: axes.{letter}.sign = {known.axes[letter].sign:g}; give 1 or -1")
    return known


class GcodeStage:
    """The serial line and the stage behind it.

    Raises  RigError: no such port, no greeting, homing failed
    """

    def __init__(self, config: StageFile) -> None:
        self.config = config
        self._dialect = DIALECTS[config.stage.dialect]
        self._axes = {letter: config.axes.get(letter, AxisTable()) for letter in "XYZ"} | dict(config.axes)
        port = config.stage.port
        try:
            self._line: Any = serial.serial_for_url(port, baudrate=config.stage.baud, timeout=0.1)
        except (serial.SerialException, ValueError) as error:
            raise RigError(f"stage {port}: {message_of(error)}; give the stage's serial port") from None
        try:
            self._greet()
            if config.stage.home:
                self.command(self._dialect.home)
            self.command("G21")
            self.command("G90")
        except RigError:
            self._line.close()
            raise

    @property
    def letters(self) -> frozenset[str]:
        return frozenset(self._axes)

    def _greet(self) -> None:
        """Opening the port resets most boards, which then identify themselves; the others are queried."""
        stage, dialect = self.config.stage, self._dialect
        received: list[str] = []
        if self._has_line(dialect.hello, received):
            return
        self._line.write(dialect.ask)
        if self._has_line(dialect.answer, received) and (
            not dialect.ends_with_ok or self._has_line("ok", received)
        ):
            return
        what = f"received {received[-1]!r}" if received else "nothing received"
        raise RigError(
            f"stage {stage.port}: no {stage.dialect} greeting, {what}; check port, baud and dialect"
        )

    def _has_line(self, start: str, received: list[str]) -> bool:
        """Whether a line that starts so comes while a board boots."""
        deadline = time.monotonic() + self.config.stage.boot_s
        while (line := self._read(deadline)) is not None:
            if line.startswith(start):
                return True
            received.append(line)
        return False

    def _read(self, deadline: float) -> str | None:
        """A line; None: none came in time."""
        kept = bytearray()
        while time.monotonic() < deadline:
            try:
                kept += self._line.readline()
            except serial.SerialException as error:
                raise RigError(f"stage {self.config.stage.port}: {error}; check the cable") from None
            if kept.endswith(b"\n"):
                line = str(kept, "ascii", "replace").strip()
                if line:
                    return line
                kept.clear()
        return None

    def command(self, text: str) -> None:
        """Send a line and wait for its `ok`. Raises RigError."""
        port = self.config.stage.port
        try:
            self._line.write(text.encode("ascii") + b"\n")
        except serial.SerialException as error:
            raise RigError(f"stage {port}: {error}; check the cable") from None
        deadline = time.monotonic() + self.config.stage.answer_s
        while (line := self._read(deadline)) is not None:
            if line == "ok" or line.startswith("ok "):
                return
            kind, _, rest = line.partition(":")
            if kind in ("error", "ALARM"):
                table = GRBL_ERRORS if kind == "error" else GRBL_ALARMS
                known = (
                    table.get(int(rest), "see GRBL's code table") if re.fullmatch(r"\d{1,9}", rest) else rest
                )
                raise RigError(f"stage {port}: {text!r} answered {line}: {known}")
            if kind == "Error":
                raise RigError(f"stage {port}: {text!r} answered {line}")
            if line.startswith(self._dialect.hello):
                raise RigError(f"stage {port}: it restarted during {text!r}; home it and go on with --resume")
            if line.startswith("echo:busy"):
                deadline = time.monotonic() + self.config.stage.answer_s
        raise RigError(f"stage {port}: no answer to {text!r} within {self.config.stage.answer_s:g} s")

    def go(self, **mm: float) -> None:
        """Move axes (in the tip's coordinates: 0 is the tip's axis, or first touch) and wait until it stops.

        Raises  RigError: out of travel (nothing is sent then), or the stage's own fault
        """
        parts = []
        for letter, value in mm.items():
            axis = self._axes[letter]
            where = axis.at + axis.sign * value
            if not axis.min <= where <= axis.max:
                raise RigError(
                    f"stage: {letter} = {where:.3f} is out of its travel {axis.min:g}..{axis.max:g}; "
                    f"check axes.{letter} or the protocol"
                )
            parts.append(f"{letter}{where:.4f}")
        self.command(f"G1 {' '.join(parts)} F{self.config.stage.feed_mm_min:g}")
        self.command(self._dialect.sync)

    def close(self) -> None:
        self._line.close()
