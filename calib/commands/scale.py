"""`python -m calib scale`: press on a kitchen scale by hand; pictures and a table for `calib fit` come out.

    FOLDER/0_0.png ...    pictures, those of each load together; load 0 is the untouched tip
    FOLDER/targets.csv    sensor_image, force_z (N) and, with --depth, pose_z (mm)

Rules
- The tip lies on the scale, or presses on it: either way the scale shows what pushes into the tip.
- A picture counts only if the load stands still: a serial scale is read before and after, a person is asked
  to hold it. The first pictures after an answer are left out (`SettledCamera`).
- The table is written after each load: what was recorded is kept, whatever ends the command.
"""

import csv
import re
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path

import click
import cv2

from calib.commands.options import PATH
from calib.errors import CaptureError, RigError, TableError
from calib.rig.camera import SettledCamera
from calib.table import number
from edge.sources import open_source
from hostlink.cli_types import WholeNumber, counted
from hostlink.output_file import writing

UNITS = {"g": 9.80665e-3, "kg": 9.80665, "N": 1.0}  # N
STILL_N, STILL_REL = 8, 0.01  # readings of a serial scale, and their spread, that count as standing still
_NUMBER = re.compile(rb"[+-]?\s*[0-9]+(?:\.[0-9]+)?")
TABLE = "targets.csv"


class SerialScale:
    """A scale that prints its readings on a serial line, a number a line.

    Raises  RigError: cannot be opened, or prints no numbers
    """

    def __init__(self, port: str, baud: int) -> None:
        import serial

        try:
            self._line = serial.serial_for_url(port, baud, timeout=2.0)
        except (serial.SerialException, ValueError) as error:
            raise RigError(f"--scale {port}: {error}; give the scale's port, e.g. /dev/ttyUSB0") from None
        self._name = f"--scale {port}"

    def _readings(self) -> Iterator[float]:
        self._line.reset_input_buffer()
        self._line.readline()  # the rest of a line
        while line := self._line.readline():
            if found := _NUMBER.search(line):
                yield float(found[0].replace(b" ", b""))
        raise RigError(f"{self._name}: no reading for 2 s; let it print all the time, and check --baud")

    def still(self) -> float:
        """The reading, as soon as it stands still."""
        recent: deque[float] = deque(maxlen=STILL_N)
        for value in self._readings():
            recent.append(value)
            low, high = min(recent), max(recent)
            if len(recent) == STILL_N and high - low <= STILL_REL * max(abs(low), abs(high)):
                return sum(recent) / STILL_N
        raise AssertionError("readings end in an error alone")

    def close(self) -> None:
        self._line.close()


@dataclass(frozen=True, slots=True)
class Loads:
    """Asks for loads, typed or read from a serial scale.

    ask   shows a line, and returns what is typed
    unit  of the scale, one of UNITS
    most  number of loads
    """

    ask: Callable[[str], str]
    unit: str
    depth: bool
    most: int
    scale: SerialScale | None

    def truth(self, load: int) -> tuple[float, ...] | None:
        """Force N and, if asked for, depth mm of a load, by its number; None: it was the last."""
        typed = [] if self.scale else [f"the load in {self.unit}"]
        typed += ["the depth in mm"] if self.depth else []
        if load == 0:
            self.ask("Let nothing touch the tip, and set the scale to 0")
            return (0.0,) * (1 + self.depth)
        what = f"type {' and '.join(typed)}" if typed else "press Enter"
        while load <= self.most:
            cells = self.ask(f"Load {load} of {self.most}: press, hold still, {what}, and hold on").split()
            if not cells and typed:
                return None
            try:
                values = [number(word, "this") for word in cells]
            except TableError as error:
                click.echo(f"{error}; {what}", err=True)
                continue
            if len(values) == len(typed):
                force = self.scale.still() if self.scale else values.pop(0)
                if force > 0:
                    return (UNITS[self.unit] * force, *values)
            click.echo(f"no load above 0, or not {counted(len(typed), 'number')}; {what}", err=True)
        return None

    def held(self, force_n: float) -> bool:
        """Whether the load of the pictures just taken is still there, as far as that can be read."""
        if self.scale is None or not force_n:
            return True
        now_n = UNITS[self.unit] * self.scale.still()
        if abs(now_n - force_n) <= 2 * STILL_REL * force_n:
            return True
        click.echo(f"the load went from {force_n:.2f} to {now_n:.2f} N: once more", err=True)
        return False


def record(camera: SettledCamera, loads: Loads, folder: Path, frames_n: int) -> int:
    """Record pictures of each load into a folder. Returns the number of loads, with the untouched tip."""
    rows: list[tuple[str, ...]] = [("sensor_image", "force_z", "pose_z")]
    load = 0
    while (truth := loads.truth(load)) is not None:
        camera.moved()
        images = [camera.frame().image for _ in range(frames_n)]
        if not loads.held(truth[0]):
            continue
        for k, image in enumerate(images):
            cv2.imwrite(str(folder / f"{load}_{k}.png"), image)
            rows.append((f"{load}_{k}.png", *(f"{value:.5g}" for value in truth)))
        load += 1
        with (
            writing(folder / TABLE, overwrite=True) as unfinished,
            unfinished.open("w", newline="", encoding="utf-8") as file,
        ):
            csv.writer(file).writerows(row[: 1 + len(truth)] for row in rows)
    return load


@click.command("scale")
@click.option("-o", "--output", "folder", required=True, type=PATH, help="Folder to make, for the pictures.")
@click.option("--camera", default="v4l2:0", show_default=True, metavar="SPEC", help="Source of frames.")
@click.option("--scale", "port", metavar="PORT", help="Serial scale that prints its readings; else you type.")
@click.option(
    "--baud",
    type=WholeNumber(300, 4_000_000),
    default=9600,
    show_default=True,
    help="Bits a second of --scale.",
)
@click.option(
    "--unit", type=click.Choice(list(UNITS)), default="g", show_default=True, help="Unit of the scale."
)
@click.option(
    "--loads",
    "most",
    type=WholeNumber(1, 1000),
    default=12,
    show_default=True,
    help="How many loads are asked for.",
)
@click.option(
    "--frames",
    "frames_n",
    type=WholeNumber(1, 100),
    default=10,
    show_default=True,
    help="Pictures of each load.",
)
@click.option("--depth", is_flag=True, help="Type the depth too, in mm: by a ruler, or a stack of paper.")
def scale_command(
    folder: Path, camera: str, port: str | None, baud: int, unit: str, most: int, frames_n: int, depth: bool
) -> None:
    """Press on a kitchen scale by hand: pictures and forces for `calib fit`.

    Spread the loads over what the tip will carry, and the places over the tip. Hold still until the next
    load is asked for; an empty answer ends it.
    """
    if folder.exists():
        raise CaptureError(f"{folder}: exists; give the name of a new folder")
    with ExitStack() as stack:
        scale = stack.enter_context(closing(SerialScale(port, baud))) if port else None
        settled = stack.enter_context(closing(SettledCamera(open_source(camera))))
        try:
            folder.mkdir(parents=True)
        except OSError as error:
            raise CaptureError(f"{folder}: cannot be made: {error.strerror}") from None
        done = record(settled, Loads(_ask, unit, depth, most, scale), folder, frames_n)
    click.echo(
        f"{folder}: {counted(max(done - 1, 0), 'load')}; fit with\n"
        f"    python -m calib fit {folder / TABLE} --frames {folder} -o tip.json --hold-out 0.2"
    )


def _ask(text: str) -> str:
    return str(click.prompt(text, default="", show_default=False, prompt_suffix=" > ", err=True))
