"""`python -m edge doctor`: is all there that a finger needs? A line a topic: ok, warn or fail, what to do.

    camera       found, rate, exposure, darkness
    pins         found, sharp, clear of the image's border, as many as the calibration knows
    calibration  belongs to this tip, age, residual
    link         CAN interface up, bit rates, error counters; serial line there
    processor, clock, disk

Rules
- Looks, and changes nothing. It needs the camera for itself: stop the service first.
- What the machine says comes through `Machine`, frames through a `FrameSource`: both can be others.
- A topic that cannot be judged because another failed is left out, not guessed.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from edge.calibration import Calibration, Curve
from edge.config import Config
from edge.errors import CalibrationError, NoPins, SinkError, UsageError
from edge.health import HOT_DEGC, ROOM_BYTES, Thermometer
from edge.judge import DARK, FULL, level_of
from edge.pins import take_rest
from edge.pipeline import in_order_of
from edge.transport import open_sink
from edge.types import Frame, FrameSource, Rest
from hostlink.wire.address import Address, AddressError, parse_address

__all__ = ["LEVELS", "Line", "Machine", "examine", "worst"]

LEVELS = ("ok", "warn", "fail")
LOOK_FRAMES, LOOK_S = 60, 3.0  # frames looked at, and the longest time to wait for them
REST_FRAMES = 8
SLOW_SHARE = 0.9  # of the rate asked for
DIM, GLARE = 0.03, 0.05  # mean level, and share of saturated pixels, that still work but are worth a lamp
SOFT = 0.45  # blur of a pin's edge over its radius; 0.15..0.3 on the published raw images
FEW, LOST = 0.97, 0.8  # share of the calibration's pins
OLD_DAYS = 365
ROUGH_MM = 0.3  # residual of the displacement's or shear's calibration
ERRORS = 96  # CAN error counter: from here on the controller warns (ISO 11898-1)
WRITE_BYTES = 16 << 20
FAST_CLOCK_NS = 1_000_000


@dataclass(frozen=True, slots=True)
class Line:
    """One finding. level: one of LEVELS; advice: what to do, empty where nothing is to be done."""

    topic: str
    level: str
    words: str
    advice: str = ""


class Machine:
    """What is asked of the machine.

    root  of its file system
    """

    def __init__(self, root: Path = Path("/")) -> None:
        self.root = root

    def interface(self, name: str) -> dict[str, Any] | None:
        """What `ip` says of a network interface; None: there is none."""
        try:
            run = subprocess.run(
                ["ip", "-details", "-statistics", "-json", "link", "show", "dev", name],
                capture_output=True, text=True, timeout=5.0, check=False,
            )  # fmt: skip
            found = json.loads(run.stdout or "[]")
        except (OSError, ValueError, subprocess.TimeoutExpired):
            return None
        return dict(found[0]) if found else None

    def governors(self) -> set[str]:
        """Frequency governors in use; empty: the processor has none."""
        files = (self.root / "sys/devices/system/cpu").glob("cpu[0-9]*/cpufreq/scaling_governor")
        return {file.read_text().strip() for file in files}

    def temperature_degc(self) -> float:
        """Of the board; NaN: unknown."""
        return Thermometer(self.root / "sys/class/thermal")()

    def clock_synchronised(self) -> bool | None:
        """Whether the wall clock follows a time server; None: unknown."""
        try:
            run = subprocess.run(
                ["timedatectl", "show", "--property=NTPSynchronized", "--value"],
                capture_output=True, text=True, timeout=5.0, check=False,
            )  # fmt: skip
        except (OSError, subprocess.TimeoutExpired):
            return None
        return {"yes": True, "no": False}.get(run.stdout.strip())

    def free_bytes(self, folder: Path) -> int:
        """Room for us in a folder. Raises OSError."""
        stat = os.statvfs(folder)
        return stat.f_bavail * stat.f_frsize

    def write_s(self, folder: Path, n_bytes: int) -> float:
        """How long so many bytes take to the disk. Raises OSError."""
        path = folder / f".doctor-{os.getpid()}"
        block = os.urandom(1 << 20)
        start = time.monotonic()
        try:
            with path.open("wb") as file:
                for _ in range(max(1, n_bytes >> 20)):
                    file.write(block)
                file.flush()
                os.fsync(file.fileno())
            return time.monotonic() - start
        finally:
            path.unlink(missing_ok=True)


def worst(lines: Sequence[Line]) -> str:
    """The worst level of all."""
    return max((line.level for line in lines), key=LEVELS.index, default="ok")


def examine(
    config: Config, open_camera: Callable[[], FrameSource], calibration_path: Path | None, machine: Machine
) -> list[Line]:
    """Look at everything; the order is the data's way.

    open_camera       opens the source; may raise SourceError
    calibration_path  the calibration in use; None: there is none
    """
    lines: list[Line] = []
    rest = None
    try:
        source = open_camera()
    except UsageError as error:
        lines.append(
            Line(
                "camera", "fail", str(error), "check cable, power and [source] spec; is the service running?"
            )
        )
        asked_hz = config.source.rate_hz
    else:
        try:
            frames, seconds = _watch(source)
        finally:
            source.close()
        asked_hz = config.source.rate_hz or source.rate_hz
        lines += camera(source, frames, seconds, config)
        if frames:
            found, rest = pins(frames[:REST_FRAMES])
            lines += found
    lines += calibration(calibration_path, rest)
    for spec in config.link.sinks:
        lines += link(spec, machine)
    if not config.link.sinks:
        lines.append(
            Line("link", "warn", "no sink: samples go nowhere", 'set [link] sinks, e.g. ["can:can0"]')
        )
    lines += [*processor(machine), *clock(machine), *disk(config, asked_hz, machine)]
    return lines


def _watch(source: FrameSource) -> tuple[list[Frame], float]:
    """Frames as they come, and the time they took."""
    frames: list[Frame] = []
    end = time.monotonic() + LOOK_S
    read: Callable[[float], Frame | None] | None = getattr(source, "read", None)
    start = time.monotonic()
    if read is None:
        for frame in source:
            frames.append(frame)
            if len(frames) == LOOK_FRAMES:
                break
    else:
        while len(frames) < LOOK_FRAMES and time.monotonic() < end:
            got = read(0.1)
            if got is not None:
                frames.append(got)
    return frames, time.monotonic() - start


def camera(source: FrameSource, frames: Sequence[Frame], seconds: float, config: Config) -> list[Line]:
    """Found, rate, light."""
    if not frames:
        why = getattr(source, "condition", "") or "no images"
        return [
            Line("camera", "fail", f"{source.name}: {why}", "unplug it and plug it in again; other program?")
        ]
    width, height = source.size_px
    lines = [Line("camera", "ok", f"{source.name}, {width}x{height}")]
    refused = getattr(source, "refused", [])
    if refused:
        lines.append(
            Line("camera", "warn", "; ".join(refused), "set what the camera has: v4l2-ctl --list-ctrls")
        )
    if source.live and len(frames) > 1:
        steps_s = np.diff([f.capture_ns for f in frames]) / 1e9
        steps_n = np.diff([f.sequence for f in frames])
        rate_hz = float(1.0 / np.median(steps_s / np.maximum(steps_n, 1)))
        asked_hz = config.source.rate_hz
        slow = rate_hz < SLOW_SHARE * asked_hz
        lines.append(
            Line(
                "rate", "fail" if slow else "ok",
                f"{rate_hz:.1f} frames/s" + (f", {asked_hz:g} asked" if asked_hz else ""),
                "shorten [source] exposure_us, or ask for less" if slow else "",
            )
        )  # fmt: skip
    return [*lines, _light(frames)]


def _light(frames: Sequence[Frame]) -> Line:
    levels = np.array([level_of(f.image, f.bits) for f in frames])
    level, full = levels.mean(axis=0)
    words = f"mean level {level:.1%} of full scale, {full:.1%} of the image at full scale"
    if level < DARK:
        return Line("light", "fail", words, "dark: is the LED lit? raise [source] exposure_us or gain")
    if full > FULL:
        return Line("light", "fail", words, "overexposed: lower [source] exposure_us, keep stray light out")
    if level < DIM:
        return Line("light", "warn", words, "dim: raise [source] exposure_us, then gain")
    if full > GLARE:
        return Line("light", "warn", words, "glare: lower [source] exposure_us")
    return Line("light", "ok", words)


def pins(frames: Sequence[Frame]) -> tuple[list[Line], Rest | None]:
    """Found, sharp, clear of the border; and the rest frame they make."""
    try:
        rest = take_rest([f.image for f in frames])
    except NoPins as error:
        return [
            Line("pins", "fail", str(error), "focus the lens; look at `python -m edge inspect IMAGE`")
        ], None
    height, width = frames[0].image.shape
    p = rest.pattern
    lines = [
        Line("pins", "ok", f"{len(rest)} found, radius {p.pin_radius_px:.1f} px, pitch {p.pitch_px:.1f} px")
    ]
    softness = p.edge_px / p.pin_radius_px
    soft = softness > SOFT
    lines.append(
        Line(
            "focus", "warn" if soft else "ok",
            f"edges are blurred by {p.edge_px:.1f} px, {softness:.0%} of a pin's radius",
            "turn the lens until `python -m edge inspect` finds the sharpest pins" if soft else "",
        )
    )  # fmt: skip
    x, y = rest.xy_img.T
    margin = float(np.min([x, y, width - 1 - x, height - 1 - y])) - p.pin_radius_px
    close = margin < p.pitch_px
    lines.append(
        Line(
            "margin", "warn" if close else "ok",
            f"outermost pin {margin:.0f} px from the image's border",
            f"centre the tip: pins need {p.pitch_px:.0f} px of room to move" if close else "",
        )
    )  # fmt: skip
    return lines, rest


def calibration(path: Path | None, rest: Rest | None) -> list[Line]:
    """Belongs to this tip, its age, how well it fits."""
    if path is None:
        return [
            Line(
                "calibration",
                "warn",
                "none: calibrated values are invalid",
                "set [calibration] file, or upload one",
            )
        ]
    try:
        loaded = Calibration.load(path)
    except CalibrationError as error:
        return [Line("calibration", "fail", str(error), "fit it again: `python -m calib fit`")]
    lines = []
    if rest is not None:
        known_n = len(loaded.rest)
        share = len(rest) / known_n
        if share < FEW:
            level = "fail" if share < LOST else "warn"
            words = f"{len(rest)} of the calibration's {known_n} pins are seen"
            lines.append(
                Line("pins", level, words, "clean lens and skin, light it evenly; is the skin torn?")
            )
        try:
            in_order_of(loaded, rest)
        except CalibrationError as error:
            lines.append(
                Line(
                    "calibration",
                    "fail",
                    str(error),
                    f"use the file of this tip; this is {loaded.content.sensor.serial}'s",
                )
            )
        else:
            lines.append(Line("calibration", "ok", f"{path}: of this tip, {loaded.content.sensor.serial}"))
    return [*lines, _age(loaded), _residual(loaded)]


def _age(loaded: Calibration) -> Line:
    text = loaded.content.data.created
    try:
        made = datetime.fromisoformat(text)
    except ValueError:
        return Line("age", "warn", f"calibration of {text!r}: no date", "")
    days = (datetime.now(UTC) - (made if made.tzinfo else made.replace(tzinfo=UTC))).days
    old = days > OLD_DAYS
    return Line(
        "age",
        "warn" if old else "ok",
        f"calibrated {days} days ago",
        "skins age: calibrate again" if old else "",
    )


def _residual(loaded: Calibration) -> Line:
    sigmas = _sigmas(loaded)
    words = ", ".join(
        f"{name} {value:.3g}" for name, value in sorted(sigmas.items()) if not name.startswith("contact_")
    )
    rough = [
        n for n, v in sigmas.items() if n in ("displacement_mm", "shear_x_mm", "shear_y_mm") and v > ROUGH_MM
    ]
    return Line(
        "residual", "warn" if rough else "ok", f"one sigma: {words or 'no models'}",
        f"{', '.join(rough)} above {ROUGH_MM:g} mm: calibrate with more data" if rough else "",
    )  # fmt: skip


def _sigmas(loaded: Calibration) -> dict[str, float]:
    """One-sigma error of each output."""
    sigmas: dict[str, float] = {}
    for model in loaded.content.models:
        if isinstance(model, Curve):
            sigmas[model.output] = model.sigma
        else:
            sigmas |= dict(zip(model.outputs, model.sigma, strict=True))
    return sigmas


def link(spec: str, machine: Machine) -> list[Line]:
    """One sink: is it there, up, with which bit rates, how many errors."""
    try:
        address = parse_address(spec)
    except AddressError as error:
        return [Line("link", "fail", str(error), "see `python -m edge run --help`")]
    if address.interface == "socketcan":
        return _can(address, machine)
    try:
        open_sink(spec).close()
    except SinkError as error:
        return [Line("link", "fail", str(error), "check the cable and its name; join the group dialout")]
    return [Line("link", "ok", f"{spec}: opens")]


def _can(address: Address, machine: Machine) -> list[Line]:
    name = address.channel
    found = machine.interface(name)
    if found is None:
        return [
            Line(
                "link", "fail", f"no CAN interface {name}", "load its driver or overlay; see deploy/README.md"
            )
        ]
    info = found.get("linkinfo", {})
    data = info.get("info_data", {})
    up = "UP" in found.get("flags", [])
    if info.get("info_kind") not in ("can", "vcan", "vxcan"):
        return [Line("link", "fail", f"{name} is no CAN interface", "name one in [link] sinks")]
    if not up:
        advice = f"deploy/can-up.sh {name}, or enable systemd-networkd"
        return [Line("link", "fail", f"{name} is down", advice)]
    lines = []
    bitrate = data.get("bittiming", {}).get("bitrate", 0)
    fast = data.get("data_bittiming", {}).get("bitrate", 0)
    words = (
        f"{name} is up"
        + (f", {bitrate / 1e6:g} Mbit/s" if bitrate else "")
        + (f" and {fast / 1e6:g}" if fast else "")
    )
    lines.append(Line("link", "ok", words))
    if address.fd and found.get("mtu", 0) < 72:
        lines.append(
            Line(
                "link",
                "fail",
                f"{name} takes classic frames only",
                f"deploy/can-up.sh {name}, or can:{name}?fd=0",
            )
        )
    state = data.get("state", "")
    errors = data.get("berr_counter", {})
    most = max(errors.get("tx", 0), errors.get("rx", 0))
    counted = data.get("can_stats", info.get("info_xstats", {}))
    words = f"{state or 'virtual bus'}, errors tx {errors.get('tx', 0)} rx {errors.get('rx', 0)}, "
    words += f"bus-off {counted.get('bus_off', 0)} times"
    if state == "BUS-OFF":
        level, advice = "fail", "the bus is not terminated, or another bit rate runs on it"
    elif most >= ERRORS or state in ("ERROR-PASSIVE", "ERROR-WARNING"):
        level, advice = (
            "warn",
            "nobody acknowledges, or the wiring is bad: two 120 ohm terminators, same bit rates",
        )
    else:
        level, advice = "ok", ""
    return [*lines, Line("errors", level, words, advice)]


def processor(machine: Machine) -> list[Line]:
    """Frequency governor and temperature."""
    governors = machine.governors()
    slow = governors - {"performance"}
    words = f"governor {', '.join(sorted(governors))}" if governors else "no frequency governor"
    advice = (
        "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor" if slow else ""
    )
    lines = [Line("processor", "warn" if slow else "ok", words, advice)]
    degc = machine.temperature_degc()
    if not math.isnan(degc):
        hot = degc >= HOT_DEGC
        lines.append(
            Line("temperature", "warn" if hot else "ok", f"{degc:.0f} degC", "cool the board" if hot else "")
        )
    return lines


def clock(machine: Machine) -> list[Line]:
    """Resolution of the clock that stamps samples; the wall clock, which stamps recordings."""
    step_ns = time.get_clock_info("monotonic").resolution * 1e9
    coarse = step_ns > FAST_CLOCK_NS
    synchronised = machine.clock_synchronised()
    words = f"steps of {step_ns:.0f} ns; wall clock " + {
        True: "follows a time server", False: "follows no time server", None: "not asked"
    }[synchronised]  # fmt: skip
    advice = (
        "samples do not need it, recordings do: timedatectl set-ntp true" if synchronised is False else ""
    )
    level = "fail" if coarse else "warn" if synchronised is False else "ok"
    return [Line("clock", level, words, advice)]


def disk(config: Config, rate_hz: float, machine: Machine) -> list[Line]:
    """Whether settings can be stored, and recordings keep up."""
    folder = Path(config.state.directory or ".")
    try:
        free = machine.free_bytes(folder)
        if free < ROOM_BYTES + WRITE_BYTES:
            return [Line("disk", "fail", f"{folder}: {free >> 20} MiB left", "make room")]
        seconds = machine.write_s(folder, WRITE_BYTES)
    except OSError as error:
        return [
            Line(
                "disk",
                "fail",
                f"{folder}: {error.strerror}",
                "set [state] directory to a folder we may write",
            )
        ]
    speed = WRITE_BYTES / 1e6 / max(seconds, 1e-6)
    need = config.source.width * config.source.height * (rate_hz or 60.0) / 1e6
    words = f"{folder}: {free >> 20} MiB left, writes {speed:.0f} MB/s; raw recording takes {need:.0f}"
    slow = speed < need
    advice = "record at a lower rate, or onto a faster disk; the measurement is not affected" if slow else ""
    lines = [Line("disk", "warn" if slow else "ok", words, advice)]
    if not config.state.directory:
        lines.append(
            Line(
                "settings",
                "warn",
                "live in memory only",
                "set [state] directory, so that they survive a restart",
            )
        )
    return lines


def as_table(lines: Sequence[Line]) -> list[dict[str, str]]:
    """For JSON."""
    return [asdict(line) for line in lines]
