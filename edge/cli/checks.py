"""The checks of `edge doctor`, one function a topic. Evidence for the limits: docs/tuning.md, "Doctor"."""

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from edge.calibration import Calibration
from edge.calibration.file import Curve
from edge.cli.machine import Machine
from edge.config import Config
from edge.errors import CalibrationError, NoPins, SinkError
from edge.faults.image_quality import ONE_LEVEL, level_of
from edge.faults.image_quality import PARAMS as IMAGE
from edge.faults.pin_visibility import PARAMS as SEEN
from edge.link.sinks import open_sink
from edge.params import ASTRAY_REL
from edge.pins import take_rest
from edge.rest.sensor_match import mm_per_px, recognise
from edge.rest.symmetry import symmetry_of
from edge.rest.tip_match import in_order_of
from edge.runtime.board_monitor import PARAMS as BOARD
from edge.runtime.board_monitor import STORED_BYTES
from edge.sensors import KnownSensor, known_sensors, missing_pins
from edge.sources.camera import CameraSource
from edge.sources.live import PARAMS as LIVE
from edge.sources.options import Options, parse_spec
from edge.sources.v4l2 import lasting_name
from edge.types import AdjustableSource, Frame, FrameSource, Lens, LiveSource, Polarity, Rest
from hostlink.wire.address import Address, AddressError, parse_address

LEVELS = ("ok", "warn", "fail")
FD_MTU = 72  # bytes; MTU of a Linux interface for CAN FD
_WARNING_N = 96  # errors counted from which on a CAN controller warns (ISO 11898-1)
_STAMP_NS = 1000  # unit of the time in a sample


@dataclass(frozen=True, slots=True)
class DoctorLimits:
    """Limits beyond which a topic is a warning or a failure."""

    rough_mm: float = 0.3  # residual of the calibration of displacement or shear


LIMITS = DoctorLimits()


@dataclass(frozen=True, slots=True)
class Line:
    """One finding. level: one of LEVELS; advice: what to do; empty if nothing."""

    topic: str
    level: str
    message: str
    advice: str = ""


def judged(topic: str, bad: bool, message: str, advice: str, level: str = "warn") -> Line:
    """A finding that is either fine, or of this level and in need of the advice."""
    return Line(topic, level, message, advice) if bad else Line(topic, "ok", message)


def worst(lines: Sequence[Line]) -> str:
    """The worst level of all."""
    return max((line.level for line in lines), key=LEVELS.index, default="ok")


def camera(source: FrameSource, frames: Sequence[Frame], config: Config) -> Iterator[Line]:
    """Found, rate, brightness."""
    if not frames:
        why = (source.condition if isinstance(source, LiveSource) else "") or "no images"
        yield Line(
            "camera", "fail", f"{source.name}: {why}", "unplug it and plug it in again; other program?"
        )
        return
    width, height = source.size_px
    terms = f", {source.terms}" if isinstance(source, CameraSource) else ""
    yield Line("camera", "ok", f"{source.name}, {width}x{height}{terms}")
    spec = parse_spec(config.source.spec, Options())
    if spec.scheme in ("", "v4l2") and (lasting := lasting_name(spec.where)):
        finding = f"{config.source.spec} may be another camera after a restart"
        yield Line("camera", "warn", finding, f"give {lasting}, which stays")
    if isinstance(source, AdjustableSource) and source.refused:
        advice = "set what the camera has: v4l2-ctl --list-ctrls"
        yield Line("camera", "warn", "; ".join(source.refused), advice)
    if source.live and len(frames) > 1:
        steps_s = np.diff([f.capture_ns for f in frames]) / 1e9
        steps_n = np.diff([f.sequence for f in frames])
        rate_hz = float(1.0 / np.median(steps_s / np.maximum(steps_n, 1)))
        asked_hz = config.source.rate_hz
        slow = rate_hz < LIVE.slow_rel * asked_hz
        finding = f"{rate_hz:.1f} frames/s" + (f", {asked_hz:g} asked" if asked_hz else "")
        advice = "shorten [source] exposure_us, or ask for less"
        yield judged("rate", slow, finding, advice, "fail")
    yield _brightness(frames)


def _brightness(frames: Sequence[Frame]) -> Line:
    levels = np.array([level_of(f.image, f.bits) for f in frames])
    level, full = levels.mean(axis=0)
    finding = f"mean level {level:.1%} of full scale, {full:.1%} of the image at full scale"
    if level < ONE_LEVEL:
        return Line("light", "fail", finding, "dark: is the LED lit? raise [source] exposure_us or gain")
    if full > 1.0 - IMAGE.half_rel:
        return Line("light", "fail", finding, "overexposed: lower [source] exposure_us, keep stray light out")
    if level**2 * (1 << frames[0].bits) < 1.0:  # by ratios, nearer to one level than to white
        return Line("light", "warn", finding, "dim: raise [source] exposure_us, then gain")
    if full > ASTRAY_REL:
        return Line("light", "warn", finding, "glare: lower [source] exposure_us")
    return Line("light", "ok", finding)


def pins(
    frames: Sequence[Frame], polarity: Polarity = Polarity.FOUND, lens: Lens | None = None
) -> tuple[list[Line], Rest | None]:
    """Found, sharp, clear of the border, untouched; and their rest frame."""
    try:
        rest = take_rest([f.image for f in frames], polarity, lens)
    except NoPins as error:
        return [Line("pins", "fail", str(error), "focus the lens; see `python -m edge inspect IMAGE`")], None
    height, width = frames[0].image.shape
    p = rest.pattern
    kind = "dark" if p.dark else "bright"
    finding = f"{len(rest)} found, {kind}, radius {p.pin_radius_px:.1f} px, pitch {p.pitch_px:.1f} px"
    softness = p.edge_px / p.pin_radius_px
    blur = f"edges are blurred by {p.edge_px:.1f} px, {softness:.0%} of a pin's radius"
    x, y = rest.xy_img.T
    margin = float(np.min([x, y, width - 1 - x, height - 1 - y])) - p.pin_radius_px
    symmetry = symmetry_of(rest)
    in_contact = symmetry.in_contact
    return [
        Line("pins", "ok", finding),
        judged(
            "focus", softness > IMAGE.half_rel, blur,
            "turn the lens until `python -m edge inspect` finds the sharpest pins",
        ),
        judged(
            "margin", margin < p.pitch_px, f"outermost pin {margin:.0f} px from the image's border",
            f"centre the tip: pins need {p.pitch_px:.0f} px of space to move",
        ),
        judged(
            "touch", in_contact,
            f"something touches the tip: {symmetry.message}" if in_contact else "none seen",
            "let go; or is the camera not square to the tip?",
        ),
    ], rest  # fmt: skip


def sensor(rest: Rest, named: KnownSensor | None) -> Line:
    """Which known sensor the rest frame looks like, or whether it is the one named."""
    if named is None:
        match = recognise(rest, known_sensors())
        if match is None:
            return Line("sensor", "ok", "looks like none of the known ones, which is no fault")
        known = match.sensor
        return Line("sensor", "ok", f"looks like {known.title} ({known.name}){_scale(known, rest)}")
    if missing := missing_pins(named, len(rest)):
        advice = "clean lens and skin, light it evenly; or is it another sensor?"
        return Line("sensor", "warn", missing, advice)
    if named.pins.layout and recognise(rest, [named]) is None:
        found = f"the pins do not stand as those of {named.title}"
        return Line("sensor", "warn", found, "is something touching it, or is it another sensor?")
    return Line("sensor", "ok", named.title + _scale(named, rest))


def _scale(known: KnownSensor, rest: Rest) -> str:
    scale = mm_per_px(known, rest)
    return "" if scale is None else f", {scale:.4f} mm a px"


def calibration(path: Path | None, rest: Rest | None) -> Iterator[Line]:
    """Whether it belongs to this tip, its age, its residual."""
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
            level = "fail" if share < SEEN.seen_rel else "warn"
            finding = f"{len(rest)} of the calibration's {known_n} pins are seen"
            advice = "clean lens and skin, light it evenly; is the skin torn?"
            yield Line("pins", level, finding, advice)
        try:
            in_order_of(loaded, rest)
        except CalibrationError as error:
            advice = f"this file was made for tip {serial}; use the one of this tip"
            yield Line("calibration", "fail", str(error), advice)
        else:
            yield Line("calibration", "ok", f"{path}: of this tip, {serial}")
    yield _age(loaded)
    yield _residual(loaded)


def _age(loaded: Calibration) -> Line:
    text = loaded.content.data.created
    try:
        made = datetime.fromisoformat(text)
    except ValueError:
        return Line("age", "warn", f"calibration of {text!r}: no date")
    days = (datetime.now(UTC) - (made if made.tzinfo else made.replace(tzinfo=UTC))).days
    return Line("age", "ok", f"calibrated {days} days ago")


def _residual(loaded: Calibration) -> Line:
    sigmas: dict[str, float] = {}  # one-sigma error of each output
    for model in loaded.content.models:
        if isinstance(model, Curve):
            sigmas[model.output] = model.sigma
        else:
            sigmas |= dict(zip(model.outputs, model.sigma, strict=True))
    shown = [
        f"{name} {sigma:.3g}" for name, sigma in sorted(sigmas.items()) if not name.startswith("contact_")
    ]
    lengths = ("displacement_mm", "shear_x_mm", "shear_y_mm")
    rough = ", ".join(name for name in lengths if sigmas.get(name, 0.0) > LIMITS.rough_mm)
    advice = f"{rough} above {LIMITS.rough_mm:g} mm: calibrate with more data"
    return judged("residual", bool(rough), f"one sigma: {', '.join(shown) or 'no models'}", advice)


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


def _can(address: Address, machine: Machine) -> Iterator[Line]:
    name = address.channel
    found = machine.interface(name)
    if found is None:
        advice = "load its driver or overlay; see deploy/README.md"
        yield Line("link", "fail", f"no CAN interface {name}", advice)
        return
    info = found.get("linkinfo", {})
    data = info.get("info_data", {})
    if info.get("info_kind") not in ("can", "vcan", "vxcan"):
        yield Line("link", "fail", f"{name} is no CAN interface", "name one in [link] sinks")
        return
    if "UP" not in found.get("flags", []):
        yield Line("link", "fail", f"{name} is down", f"deploy/can-up.sh {name}, or enable systemd-networkd")
        return
    bitrate = data.get("bittiming", {}).get("bitrate", 0)
    fast = data.get("data_bittiming", {}).get("bitrate", 0)
    rates = (f", {bitrate / 1e6:g} Mbit/s" if bitrate else "") + (f" and {fast / 1e6:g}" if fast else "")
    yield Line("link", "ok", f"{name} is up{rates}")
    if address.fd and found.get("mtu", 0) < FD_MTU:
        advice = f"deploy/can-up.sh {name}, or can:{name}?fd=0"
        yield Line("link", "fail", f"{name} takes classic frames only", advice)
    yield _bus_errors(data, info)


def _bus_errors(data: dict[str, Any], info: dict[str, Any]) -> Line:
    """The controller's state and its error counters."""
    state = data.get("state", "")
    errors = data.get("berr_counter", {})
    counted = data.get("can_stats", info.get("info_xstats", {}))
    finding = f"{state or 'virtual bus'}, errors tx {errors.get('tx', 0)} rx {errors.get('rx', 0)}, "
    finding += f"bus-off {counted.get('bus_off', 0)} times"
    if state == "BUS-OFF":
        return Line("errors", "fail", finding, "the bus is not terminated, or another bit rate runs on it")
    most = max(errors.get("tx", 0), errors.get("rx", 0))
    if most >= _WARNING_N or state in ("ERROR-PASSIVE", "ERROR-WARNING"):
        advice = "nobody acknowledges, or the wiring is bad: two 120 ohm terminators, same bit rates"
        return Line("errors", "warn", finding, advice)
    return Line("errors", "ok", finding)


def processor(machine: Machine) -> Iterator[Line]:
    """Frequency governor and temperature."""
    governors = machine.governors()
    slow = governors - {"performance"}
    finding = f"governor {', '.join(sorted(governors))}" if governors else "no frequency governor"
    advice = "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor"
    yield judged("processor", bool(slow), finding, advice)
    degc = machine.temperature_degc()
    if not math.isnan(degc):
        yield judged("temperature", degc >= BOARD.hot_degc, f"{degc:.0f} degC", "cool the board")


def clock(machine: Machine) -> Line:
    """Resolution of the clock that stamps samples; the wall clock, which stamps recordings."""
    step_ns = time.get_clock_info("monotonic").resolution * 1e9
    wall = {
        True: "the wall clock follows a time server",
        False: "the wall clock follows no time server",
        None: "whether the wall clock follows a time server is not known",
    }
    synchronised = machine.clock_synchronised()
    finding = f"samples are stamped to {step_ns:.0f} ns; {wall[synchronised]}"
    advice = "samples do not need it, recordings do: timedatectl set-ntp true"
    if step_ns > _STAMP_NS:
        return Line("clock", "fail", finding)
    return judged("clock", synchronised is False, finding, advice)


def disk(config: Config, size_px: tuple[int, int], rate_hz: float, machine: Machine) -> Iterator[Line]:
    """Whether settings can be stored, and recordings keep up: one second of one is written."""
    folder = Path(config.state.directory or ".")
    need_bytes = round(size_px[0] * size_px[1] * (rate_hz or 60.0))
    try:
        free = machine.free_bytes(folder)
        if free < STORED_BYTES + need_bytes:
            yield Line("disk", "fail", f"{folder}: {free >> 20} MiB left", "free some space")
            return
        seconds = machine.write_s(folder, need_bytes)
    except OSError as error:
        advice = "set [state] directory to a folder we may write"
        yield Line("disk", "fail", f"{folder}: {error.strerror}", advice)
        return
    need = need_bytes / 1e6
    speed = need / max(seconds, 1e-6)
    finding = f"{folder}: {free >> 20} MiB left, writes {speed:.0f} MB/s; raw recording takes {need:.0f}"
    advice = "record at a lower rate, or onto a faster disk; the measurement is not affected"
    yield judged("disk", speed < need, finding, advice)
    if not config.state.directory:
        advice = "set [state] directory, so that they survive a restart"
        yield Line("settings", "warn", "live in memory only", advice)
