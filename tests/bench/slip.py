"""`python -m tests.bench slip`: is slip announced before it happens, and how often without reason?

Simulated drags with the simulator's friction: a tool is pressed, held, and dragged at an even speed until all
of its contact slides; others are dragged only until a quarter slides, held there and brought back. Tool,
place or tilt, depth, friction, speed and direction are random. The places of the pins are the simulator's
own with noise added: nothing is rendered. Parameters are set on one seed and judged on another.

The recordings have no truth: alarms are counted, in frames that the detector calls untouched, and in others.

An alarm is a probability that rises above one half; it is false while less than a quarter of the contact
slides.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import click
import cv2
import numpy as np
from scipy.interpolate import make_interp_spline

from calib.sim import Camera, Simulator, Tip, Tool, ToolPose, deform
from edge.frame import Pipeline
from edge.pins import take_rest
from edge.types import Array, Feature, Frame, Rest
from tests.bench.output import show, write_json, writes_results
from tests.bench.recordings import REAL
from tests.bench.videos import TARE_FRAMES, read, untouched
from tests.support.layouts import tracks_of

RATE_HZ = 60.0
NOISE_PX = 0.05  # as tracks_of has it
DRAGS = 60
SEED = 1  # parameters were set on 0
PRESS_N, HOLD_N = 12, 30  # frames
WAY_STEPS = 20  # solutions of the contact to the motion at which a contact of this depth usually slides
FALSE_BELOW, GLIDES = 0.25, 0.98  # share of the area that slides
PROBABLE = 0.5
DEMAND = frozenset({Feature.SLIP})
TOOLS = (Tool("flat"), Tool("sphere", radius_mm=10.0), Tool("sphere", radius_mm=4.0))


@dataclass(frozen=True, slots=True)
class Drag:
    """What is dragged: how it is pressed, friction, speed and direction."""

    pose: ToolPose
    friction: float
    speed_mm_s: float
    angle_rad: float

    @property
    def tool(self) -> str:
        tool = self.pose.tool
        return tool.kind if tool.kind == "flat" else f"{tool.kind}, {tool.radius_mm:g} mm"


@dataclass(frozen=True, slots=True)
class Announced:
    """What the edge announced of one drag.

    tool       kind of tool
    slid_s     time before all of the contact slid at which slip was announced; NaN: not before
    load       tangential load then, as a share of what friction holds
    false_n    false alarms
    quiet_s    time in which an alarm would have been false
    """

    tool: str
    slid_s: float
    load: float
    false_n: int
    quiet_s: float


def drags(seed: int, number: int) -> Iterator[Drag]:
    """Random drags."""
    rng = np.random.default_rng(seed)
    for k in range(number):
        tool = TOOLS[k % len(TOOLS)]
        x, y = rng.uniform(-4.0, 4.0, 2)
        depth = rng.uniform(1.0, 3.5)
        pose = ToolPose(tool, depth_mm=depth, tilt_x_deg=2.0 * x, tilt_y_deg=2.0 * y)
        if tool.kind != "flat":
            pose = ToolPose(tool, depth_mm=depth, x_mm=x, y_mm=y)
        speed = 0.5 * 40.0 ** rng.uniform()
        yield Drag(pose, 0.25 * 4.0 ** rng.uniform(), speed, rng.uniform(0.0, math.tau))


class Bench:
    """A simulated tip whose pins are known to the edge's features."""

    def __init__(self) -> None:
        self.camera = Camera()
        self.rest: Rest = take_rest([Simulator(self.camera).frame().image for _ in range(TARE_FRAMES)])
        true = self.camera.project(self.camera.tip.tips_mm)
        apart = np.hypot(*(self.rest.xy_img[:, None] - true).transpose(2, 0, 1))
        self._pin = apart.argmin(axis=1)  # row of the tip that each row of the rest frame is
        self._off = self.rest.xy_img - true[self._pin]

    def solve(self, tip: Tip, pose: ToolPose) -> tuple[Array, float, float]:
        """Pins, share of the area that slides, and load as a share of what friction holds."""
        done = deform(tip, (pose,))
        load = float(np.hypot(*done.drags_n[0]) / (tip.friction * done.forces_n[0]))
        return self.camera.project(done.tips_mm)[self._pin] + self._off, float(done.slip[0]), load

    def path(self, drag: Drag) -> tuple[list[Array], Array, Array, Array]:
        """Pins while it is pressed; then the way, and pins, share and load along it until all slides."""
        tip, pose = replace(self.camera.tip, friction=drag.friction), drag.pose
        press = [
            self.solve(tip, replace(pose, depth_mm=pose.depth_mm * k / PRESS_N))[0]
            for k in range(1, PRESS_N + 1)
        ]
        step = drag.friction * pose.depth_mm / WAY_STEPS
        ways, places, known = [0.0], [press[-1]], [(0.0, 0.0)]
        while known[-1][0] < GLIDES and len(ways) < 6 * WAY_STEPS:
            ways.append(ways[-1] + step)
            x, y = ways[-1] * math.cos(drag.angle_rad), ways[-1] * math.sin(drag.angle_rad)
            xy, share, load = self.solve(tip, replace(pose, shear_x_mm=x, shear_y_mm=y))
            places.append(xy)
            known.append((share, load))
        return press, np.array(ways), np.array(places), np.array(known)

    def announced(self, drag: Drag, seed: Sequence[int]) -> Announced:
        """Play a drag to the end, and one that is held and brought back."""
        press, ways, places, known = self.path(drag)
        rng = np.random.default_rng(seed)
        step = drag.speed_mm_s / RATE_HZ
        there = np.append(np.arange(step, ways[-1], step), ways[-1])
        quarter = there[np.interp(there, ways, known[:, 0]) < FALSE_BELOW]
        back = [*quarter, *[quarter[-1]] * HOLD_N, *quarter[::-1], *[0.0] * HOLD_N] if len(quarter) else []
        slid_s = load = math.nan
        false_n = quiet_n = 0
        for way in (there, np.array(back)):
            pipeline = Pipeline(self.rest, demand=DEMAND)
            shares = np.concatenate([np.zeros(PRESS_N + HOLD_N), np.interp(way, ways, known[:, 0])])
            pins = [*press, *[press[-1]] * HOLD_N, *make_interp_spline(ways, places, k=1)(way)]
            probable = np.array([self._probability(pipeline, xy, rng) for xy in pins]) > PROBABLE
            rises = probable & ~np.append(False, probable[:-1])
            quiet = shares < FALSE_BELOW
            false_n += int((rises & quiet).sum())
            quiet_n += int(quiet.sum())
            late = np.flatnonzero(probable & ~quiet & (shares < GLIDES))
            if way is there and len(late):
                slid_s = float((len(shares) - 1 - late[0]) / RATE_HZ)
                load = float(np.interp(way[late[0] - PRESS_N - HOLD_N], ways, known[:, 1]))
        return Announced(drag.tool, slid_s, load, false_n, quiet_n / RATE_HZ)

    def _probability(self, pipeline: Pipeline, xy: Array, rng: np.random.Generator) -> float:
        noisy = xy + rng.normal(0.0, NOISE_PX, xy.shape)
        return pipeline.features(tracks_of(noisy)).slip_probability or 0.0


def watch(path: Path) -> dict[str, object]:
    """Alarms of a recording; its rest frame is where it stays most of the time."""
    rate_hz = cv2.VideoCapture(str(path)).get(cv2.CAP_PROP_FPS)
    images = read(path)
    pipeline = Pipeline(untouched(images), demand=DEMAND)
    frames = {False: 0, True: 0}
    alarms = {False: 0, True: 0}
    before = False
    for k, image in enumerate(images):
        features = pipeline.process(Frame(image, round(k * 1e9 / rate_hz), k)).features
        if features is None:
            continue
        probable = (features.slip_probability or 0.0) > PROBABLE
        frames[features.in_contact] += 1
        alarms[features.in_contact] += probable and not before
        before = probable
    return {
        "name": path.stem, "untouched_s": frames[False] / rate_hz, "untouched_n": alarms[False],
        "touched_s": frames[True] / rate_hz, "touched_n": alarms[True],
    }  # fmt: skip


def summary(announced: Sequence[Announced]) -> dict[str, float]:
    """Figures of some drags."""
    before = np.array([t.slid_s for t in announced if not math.isnan(t.slid_s)])
    loads = np.array([t.load for t in announced if not math.isnan(t.load)])
    quiet_s = sum(t.quiet_s for t in announced)
    figures = {
        "drags": float(len(announced)),
        "detected": len(before) / len(announced),
        "false_per_minute": 60.0 * sum(t.false_n for t in announced) / quiet_s,
        "quiet_minutes": quiet_s / 60.0,
    }
    if len(before):
        figures |= {
            "before_median_ms": 1e3 * float(np.median(before)),
            "before_tenth_ms": 1e3 * float(np.quantile(before, 0.1)),
            "load_median": float(np.median(loads)),
        }
    return {name: round(value, 3) for name, value in figures.items()}


@click.command(name="slip", help="Slip announced before it happens, and false alarms.")
@writes_results
def command(out: Path) -> None:
    """A table each for simulated drags and recordings."""
    bench = Bench()
    announced = [bench.announced(drag, (SEED, k)) for k, drag in enumerate(drags(SEED, DRAGS))]
    rows = {"all": summary(announced)}
    for kind in dict.fromkeys(a.tool for a in announced):
        rows[kind] = summary([a for a in announced if a.tool == kind])
    show([{"tool": kind, **figures} for kind, figures in rows.items()])
    found = sorted(REAL.glob("video/*.avi")) + sorted(REAL.glob("gelsight_mini/*.avi"))
    watched = [watch(path) for path in found]
    if watched:
        show(watched)
    report = {"seed": SEED, "simulated": rows, "recordings": watched}
    write_json(out / "slip.json", report)
