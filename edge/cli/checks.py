"""The checks of `edge doctor`, one function a topic. Evidence for the limits: docs/tuning.md, "Doctor"."""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

import click
import numpy as np

from edge.calibration import Calibration
from edge.calibration.file import Curve
from edge.cli.machine import Machine
from edge.config import Config
from edge.errors import CalibrationError, SinkError
from edge.faults.pin_visibility import SEEN_REL
from edge.link.sinks import open_sink
from edge.params import ASTRAY_REL
from edge.rest.sensor_match import mm_per_px, recognise
from edge.rest.tare import TareRefused
from edge.runtime.board_monitor import HOT_DEGC, STORED_BYTES
from edge.sensors import KnownSensor, known_sensors, missing_pins
from edge.sources.camera import CameraSource
from edge.sources.live import PARAMS as LIVE
from edge.sources.live import ThreadedSource
from edge.sources.options import Options, parse_spec
from edge.sources.v4l2 import lasting_name
from edge.types import Frame, FrameSource, Rest
from hostlink.wire.address import Address, AddressError, parse_address

_COLOURS = {"ok": "green", "warn": "yellow", "fail": "red"}
LEVELS = tuple(_COLOURS)
FD_MTU = 72  # bytes; MTU of a Linux interface for CAN FD
_WARNING_N = 96  # errors counted from which on a CAN controller warns (ISO 11898-1)
_STAMP_NS = 1000  # unit of the time in a sample


@dataclass(frozen=True, slots=True)
class Line:
    """One finding. level: one of LEVELS; advice: what to do; empty if nothing."""

    topic: str
    level: str
    message: str
    advice: str = ""


def judged(topic: str, message: str, *problems: tuple[bool, str, str]) -> Line:
    """A finding, with the first problem that it is: rows of (whether it is, level, advice). Fine without."""
    for is_one, level, advice in problems:
        if is_one:
            return Line(topic, level, message, advice)
    return Line(topic, "ok", message)


def print_lines(lines: Sequence[Line]) -> None:
    for line in lines:
        level = click.style(f"{line.level:4s}", _COLOURS[line.level])
        click.echo(f"{level} {line.topic:12s} {line.message}")
        if line.advice:
            click.echo(f"{'':17s} -> {line.advice}")


def worst(lines: Sequence[Line]) -> str:
    return max((line.level for line in lines), key=LEVELS.index, default="ok")


def camera(source: FrameSource, frames: Sequence[Frame], config: Config) -> Iterator[Line]:
    """Found, rate."""
    if not frames:
        why = (source.condition if isinstance(source, ThreadedSource) else "") or "no images"
        advice = "unplug it and plug it in again; other program?"
        yield Line("camera", "fail", f"{source.name}: {why}", advice)
        return
    width, height = source.size_px
    terms = f", {source.terms}" if isinstance(source, CameraSource) else ""
    yield Line("camera", "ok", f"{source.name}, {width}x{height}{terms}")
    spec = parse_spec(config.source.spec, Options())
    if spec.scheme in ("", "v4l2") and (lasting := lasting_name(spec.where)):
        finding = f"{config.source.spec} may be another camera after a restart"
        yield Line("camera", "warn", finding, f"give {lasting}, which stays")
    if refused := getattr(source, "refused", ()):
        advice = "set what the camera has: v4l2-ctl --list-ctrls"
        yield Line("camera", "warn", "; ".join(refused), advice)
    if source.live and len(frames) > 1:
        steps_s = np.diff([f.capture_ns for f in frames]) / 1e9
        steps_n = np.diff([f.sequence for f in frames])
        rate_hz = float(1.0 / np.median(steps_s / np.maximum(steps_n, 1)))
        asked_hz = config.source.rate_hz
        finding = f"{rate_hz:.1f} frames/s" + (f", {asked_hz:g} asked" if asked_hz else "")
        slow = rate_hz < LIVE.slow_rel * asked_hz
        yield judged("rate", finding, (slow, "fail", "shorten [source] exposure_us, or ask for less"))


def sensor(rest: Rest, named: KnownSensor | None) -> Line:
    """Which known sensor the rest frame looks like, or whether it is the one named."""
    match = recognise(rest, known_sensors() if named is None else [named])
    known = match.sensor if match else named
    if known is None:
        own = "python -m edge sensor IMAGE -o mine.toml describes it"
        return Line("sensor", "ok", f"looks like none of the known ones, which is no fault: {own}")
    scale = mm_per_px(known, rest)
    in_mm = "" if scale is None else f", {scale:.4f} mm a px"
    if named is None:
        return Line("sensor", "ok", f"looks like {known.title} ({known.name}){in_mm}")
    if missing := missing_pins(named, len(rest)):
        advice = "clean lens and skin, light it evenly; or is it another sensor?"
        return Line("sensor", "warn", missing, advice)
    if named.pins.layout and match is None:
        found = f"the pins do not stand as those of {named.title}"
        return Line("sensor", "warn", found, "is something touching it, or is it another sensor?")
    return Line("sensor", "ok", named.title + in_mm)


def calibration(path: Path | None, rest: Rest | None, tare: Callable[[Calibration], Any]) -> Iterator[Line]:
    """Whether the tip is tared with it, as the program does, its age, its residual."""
    if path is None:
        advice = "set [calibration] file, or upload one"
        yield Line("calibration", "warn", "none: calibrated values are invalid", advice)
        return
    try:
        loaded = Calibration.load(path)
    except CalibrationError as error:
        yield Line("calibration", "fail", str(error), "fit it again: `python -m calib fit`")
        return
    if rest is not None:
        known_n, serial = len(loaded.rest), loaded.content.sensor.serial
        share = len(rest) / known_n
        if share < 1.0 - ASTRAY_REL:
            level = "fail" if share < SEEN_REL else "warn"
            finding = f"{len(rest)} of the calibration's {known_n} pins are seen"
            advice = "clean lens and skin, light it evenly; is the skin torn?"
            yield Line("pins", level, finding, advice)
        try:
            tare(loaded)
        except TareRefused as error:
            advice = f"let go; if nothing touches it, this file is another tip's: it was made for {serial}"
            yield Line("calibration", "fail", error.problem, advice)
        else:
            yield Line("calibration", "ok", f"{path}: of this tip, {serial}")
    text = loaded.content.data.created
    try:
        made = datetime.fromisoformat(text)
        yield Line("age", "ok", f"calibrated {(datetime.now(made.tzinfo) - made).days} days ago")
    except ValueError:
        yield Line("age", "warn", f"calibration of {text!r}: no date")
    yield _residual(loaded)


def _residual(loaded: Calibration) -> Line:
    sigmas: dict[str, float] = {}  # one-sigma error of each output
    ranges: dict[str, tuple[float, float]] = {}  # of each output in the data
    for model in loaded.content.models:
        if isinstance(model, Curve):
            sigmas[model.output] = model.sigma
            ranges[model.output] = model.knots[0][1], model.knots[-1][1]
        else:
            sigmas |= dict(zip(model.outputs, model.sigma, strict=True))
            ranges |= dict(zip(model.outputs, model.valid, strict=True))
    shown = [
        f"{name} {sigma:.3g}" for name, sigma in sorted(sigmas.items()) if not name.startswith("contact_")
    ]
    lengths = ("displacement_mm", "shear_x_mm", "shear_y_mm")
    limits = {name: ASTRAY_REL * abs(ranges[name][1] - ranges[name][0]) for name in lengths if name in sigmas}
    rough = ", ".join(name for name, limit in limits.items() if sigmas[name] > limit)
    advice = f"{rough} above {ASTRAY_REL:.0%} of the calibrated range: calibrate with more data"
    return judged("residual", f"one sigma: {', '.join(shown) or 'no models'}", (bool(rough), "warn", advice))


def link(spec: str, machine: Machine) -> Iterator[Line]:
    """One sink: is it there, up, with which bit rates, how many errors."""
    try:
        address = parse_address(spec)
        if address.interface == "socketcan":
            yield from _can(address, machine)
            return
        open_sink(spec).close()
        yield Line("link", "ok", f"{spec}: opens")
    except AddressError as error:
        yield Line("link", "fail", str(error), "see `python -m edge run --help`")
    except SinkError as error:
        yield Line("link", "fail", str(error), "check the cable and its name; join the group dialout")


def _can(address: Address, machine: Machine) -> list[Line]:
    name, failed = address.channel, partial(Line, "link", "fail")
    found = machine.interface(name)
    if found is None:
        return [failed(f"no CAN interface {name}", "load its driver or overlay; see deploy/README.md")]
    info = found.get("linkinfo", {})
    data = info.get("info_data", {})
    if info.get("info_kind") not in ("can", "vcan", "vxcan"):
        return [failed(f"{name} is no CAN interface", "name one in [link] sinks")]
    if "UP" not in found.get("flags", []):
        return [failed(f"{name} is down", f"deploy/can-up.sh {name}, or enable systemd-networkd")]
    bitrate = data.get("bittiming", {}).get("bitrate", 0)
    fast = data.get("data_bittiming", {}).get("bitrate", 0)
    rates = (f", {bitrate / 1e6:g} Mbit/s" if bitrate else "") + (f" and {fast / 1e6:g}" if fast else "")
    lines = [Line("link", "ok", f"{name} is up{rates}")]
    if address.fd and found.get("mtu", 0) < FD_MTU:
        advice = f"deploy/can-up.sh {name}, or can:{name}?fd=0"
        lines.append(failed(f"{name} takes classic frames only", advice))
    return [*lines, _bus_errors(data, info)]


def _bus_errors(data: dict[str, Any], info: dict[str, Any]) -> Line:
    """The controller's state and its error counters."""
    state = data.get("state", "")
    errors = data.get("berr_counter", {})
    sent, received = errors.get("tx", 0), errors.get("rx", 0)
    off_n = data.get("can_stats", info.get("info_xstats", {})).get("bus_off", 0)
    bad = max(sent, received) >= _WARNING_N or state in ("ERROR-PASSIVE", "ERROR-WARNING")
    wiring = "nobody acknowledges, or the wiring is bad: two 120 ohm terminators, same bit rates"
    return judged(
        "errors",
        f"{state or 'virtual bus'}, errors tx {sent} rx {received}, bus-off {off_n} times",
        (state == "BUS-OFF", "fail", "the bus is not terminated, or another bit rate runs on it"),
        (bad, "warn", wiring),
    )


def processor(machine: Machine) -> Iterator[Line]:
    """Frequency governor and temperature."""
    governors = machine.governors()
    finding = f"governor {', '.join(sorted(governors))}" if governors else "no frequency governor"
    advice = "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor"
    yield judged("processor", finding, (bool(governors - {"performance"}), "warn", advice))
    degc = machine.temperature_degc()
    if not math.isnan(degc):
        yield judged("temperature", f"{degc:.0f} degC", (degc >= HOT_DEGC, "warn", "cool the board"))


def clock(machine: Machine) -> Line:
    """Resolution of the clock that stamps samples; the wall clock, which stamps recordings."""
    step_ns = time.get_clock_info("monotonic").resolution * 1e9
    wall = {
        True: "the wall clock follows a time server",
        False: "the wall clock follows no time server",
        None: "whether the wall clock follows a time server is not known",
    }
    synchronised = machine.clock_synchronised()
    return judged(
        "clock",
        f"samples are stamped to {step_ns:.0f} ns; {wall[synchronised]}",
        (step_ns > _STAMP_NS, "fail", ""),
        (synchronised is False, "warn", "samples do not need it, recordings do: timedatectl set-ntp true"),
    )


def disk(config: Config, size_px: tuple[int, int], rate_hz: float, machine: Machine) -> list[Line]:
    """Whether settings can be stored, and recordings keep up: one second of one is written."""
    folder = Path(config.state.directory or ".")
    need_bytes = round(size_px[0] * size_px[1] * (rate_hz or 60.0))
    try:
        free = machine.free_bytes(folder)
        if free < STORED_BYTES + need_bytes:
            return [Line("disk", "fail", f"{folder}: {free >> 20} MiB left", "free some space")]
        seconds = machine.write_s(folder, need_bytes)
    except OSError as error:
        advice = "set [state] directory to a folder we may write"
        return [Line("disk", "fail", f"{folder}: {error.strerror}", advice)]
    need = need_bytes / 1e6
    speed = need / max(seconds, 1e-6)
    finding = f"{folder}: {free >> 20} MiB left, writes {speed:.0f} MB/s; raw recording takes {need:.0f}"
    advice = "record at a lower rate, or onto a faster disk; the measurement is not affected"
    lines = [judged("disk", finding, (speed < need, "warn", advice))]
    if not config.state.directory:
        advice = "set [state] directory, so that they survive a restart"
        lines.append(Line("settings", "warn", "live in memory only", advice))
    return lines
