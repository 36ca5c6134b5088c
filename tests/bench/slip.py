"""`python -m tests.bench slip`: is slip announced before it happens, and how often without reason?

Drags and twists with friction on two simulators (`calib.sim`, and the textbook's half-space) and on a third
tip, which has other pins and a thick layer. A tool is pressed, held, and moved at an even speed until all of
its contact slides; others are moved only until a quarter slides, held there and brought back. Some are held
for a minute while the skin creeps or the depth changes. Tool, place or tilt, depth, friction, speed and
direction are random. The places of the pins are the simulator's own with noise added: nothing is rendered.
Parameters were set on other seeds than the one that is judged.

The recordings have no truth: alarms are counted, in frames that the detector calls untouched, and in others.

An alarm is a probability that rises above one half; it is false while less than a quarter of the contact
slides.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import click
import cv2
import numpy as np
from numpy.typing import NDArray
from rich.progress import track
from scipy.interpolate import make_interp_spline

from calib.sim import Camera, Simulator, Tip, Tool, ToolPose, deform
from edge.frame import Pipeline
from edge.pins import take_rest
from edge.types import Array, Feature, Frame, Image, Rest
from tests.bench.flat_gel import FlatGel
from tests.bench.half_space import Ball, drag_rel, twist_rad
from tests.bench.output import show, write_json, writes_results
from tests.bench.recordings import REAL
from tests.bench.videos import TARE_FRAMES, read, untouched
from tests.support.layouts import tracks_of

RATE_HZ = 60.0
NOISE_PX = 0.05  # as tracks_of has it
SEED = 1  # parameters were set on 11 and 23
PRESS_N, HOLD_N, HELD_N = 12, 30, 3600  # frames
WAY_STEPS = 20  # solutions of the contact to the motion at which a contact of this depth usually slides
FALSE_BELOW, GLIDES = 0.25, 0.98  # share of the area that slides
HELD_SHARE = 0.15  # of the area, in contacts that are held
CREEP_REL, CREEP_S = 0.1, 10.0
DEPTH_REL, DEPTH_HZ = 0.2, 0.5  # of a depth that changes
PROBABLE = 0.5
AHEAD_S = 0.25
DEMAND = frozenset({Feature.SLIP})
TOOLS = (Tool("flat"), Tool("sphere", radius_mm=10.0), Tool("sphere", radius_mm=4.0))
Solved = tuple[Array, float]  # pins in px, share of the area that slides


@dataclass(frozen=True, slots=True)
class Pull:
    """What is dragged, or twisted: how it is pressed, friction, direction, and speed of it or its rim."""

    tool: Tool
    twists: bool
    x_mm: float
    y_mm: float
    depth_mm: float
    friction: float
    speed_mm_s: float
    angle_rad: float

    @property
    def name(self) -> str:
        kind = "flat" if self.tool.kind == "flat" else f"{self.tool.radius_mm:g} mm"
        return f"{'twist' if self.twists else 'drag'}, {kind}"


@dataclass(frozen=True, slots=True)
class Announced:
    """What the edge announced of one pull.

    name       which kind
    slid_s     time before all of the contact slid at which slip was announced; NaN: not before
    could_s    the same if it had been announced as soon as that would not have been false
    share      of the area that slid then
    false_n    false alarms
    quiet_s    time in which an alarm would have been false
    """

    name: str
    slid_s: float
    could_s: float
    share: float
    false_n: int
    quiet_s: float


def pulls(seed: int, number: int, *, twists: bool) -> Iterator[Pull]:
    """Random drags or twists."""
    rng = np.random.default_rng((seed, 1) if twists else seed)
    for k in range(number):
        x, y = rng.uniform(-4.0, 4.0, 2)
        depth = rng.uniform(1.0, 3.5)
        speed = 0.5 * 40.0 ** rng.uniform()
        friction, angle = 0.25 * 4.0 ** rng.uniform(), rng.uniform(0.0, math.tau)
        yield Pull(TOOLS[k % len(TOOLS)], twists, x, y, depth, friction, speed, angle)


class Skin(ABC):
    """A tip whose pins are known to the edge's features.

    untouched  images of it
    true       (n, 2) px, where its pins are then
    """

    def __init__(self, untouched: Sequence[Image], true: Array) -> None:
        self.rest: Rest = take_rest(untouched)
        apart = np.hypot(*(self.rest.xy_img[:, None] - true).transpose(2, 0, 1))
        self._pin = apart.argmin(axis=1)  # row of the tip that each row of the rest frame is
        self._off = self.rest.xy_img - true[self._pin]

    @abstractmethod
    def radius_mm(self, pull: Pull) -> float:
        """Of the contact."""

    @abstractmethod
    def pins(self, pull: Pull, depth_mm: float, way_mm: float) -> Solved:
        """The contact at this depth after this way; a twisted one's rim goes it."""

    def solve(self, pull: Pull, way_mm: float = 0.0, depth_rel: float = 1.0) -> Solved:
        """The same for the pins of the rest frame, at a share of the pull's depth."""
        xy, share = self.pins(pull, pull.depth_mm * depth_rel, way_mm)
        return xy[self._pin] + self._off, share

    def path(self, pull: Pull) -> tuple[list[Array], Array, Array, Array]:
        """Pins while it is pressed; then the way, and pins and share along it until all slides."""
        press = [self.solve(pull, depth_rel=k / PRESS_N)[0] for k in range(1, PRESS_N + 1)]
        step = pull.friction * pull.depth_mm / WAY_STEPS
        ways, places, shares = [0.0], [press[-1]], [0.0]
        while shares[-1] < GLIDES and len(ways) < 6 * WAY_STEPS:
            if pull.twists and len(ways) > 2 * WAY_STEPS:
                step *= 1.05  # the last part slides after a turn that has no bound
            ways.append(ways[-1] + step)
            xy, share = self.solve(pull, ways[-1])
            places.append(xy)
            shares.append(share)
        return press, np.array(ways), np.array(places), np.array(shares)

    def announced(self, pull: Pull, seed: Sequence[int]) -> Announced:
        """Play a pull to the end, and one that is held and brought back."""
        press, ways, places, known = self.path(pull)
        rng = np.random.default_rng(seed)
        step = pull.speed_mm_s / RATE_HZ
        there = np.append(np.arange(step, ways[-1], step), ways[-1])
        quarter = there[np.interp(there, ways, known) < FALSE_BELOW]
        back = [*quarter, *[quarter[-1]] * HOLD_N, *quarter[::-1], *[0.0] * HOLD_N] if len(quarter) else []
        slid_s = could_s = share = math.nan
        false_n = quiet_n = 0
        for way in (there, np.array(back)):
            shares = np.concatenate([np.zeros(PRESS_N + HOLD_N), np.interp(way, ways, known)])
            pins = [*press, *[press[-1]] * HOLD_N, *make_interp_spline(ways, places, k=1)(way)]
            probable = self.probable(pins, rng)
            quiet = shares < FALSE_BELOW
            false_n += rises(probable & quiet, probable)
            quiet_n += int(quiet.sum())
            late = np.flatnonzero(probable & ~quiet & (shares < GLIDES))
            if way is there:
                could_s = float((~quiet).sum() / RATE_HZ)
            if way is there and len(late):
                slid_s = float((len(shares) - 1 - late[0]) / RATE_HZ)
                share = float(shares[late[0]])
        return Announced(pull.name, slid_s, could_s, share, false_n, quiet_n / RATE_HZ)

    def held(self, pull: Pull, seed: Sequence[int]) -> dict[str, int]:
        """False alarms in a minute each of a pull that is held, by what changes."""
        press, ways, places, known = self.path(pull)
        way = float(np.interp(HELD_SHARE, known, ways))
        there = make_interp_spline(ways, places, k=1)(np.linspace(0.0, way, HOLD_N))
        time_s = np.arange(HELD_N) / RATE_HZ
        creep = 1.0 + CREEP_REL * (1.0 - np.exp(-time_s / CREEP_S))
        depths = 1.0 + DEPTH_REL * np.linspace(-1.0, 1.0, 9)
        at = [self.solve(pull, way, depth_rel) for depth_rel in depths]
        depth = 1.0 + DEPTH_REL * np.sin(2.0 * np.pi * DEPTH_HZ * time_s)
        rest = self.rest.xy_img
        scenes = {
            "creep": (rest + creep[:, None, None] * (there[-1] - rest), np.zeros(HELD_N)),
            "depth": (
                make_interp_spline(depths, [xy for xy, _ in at], k=1)(depth),
                np.interp(depth, depths, [share for _, share in at]),
            ),
        }
        found = {}
        for name, (pins, shares) in scenes.items():
            probable = self.probable([*press, *there, *pins], np.random.default_rng(seed))
            quiet = np.append(np.ones(len(press) + len(there), bool), shares < FALSE_BELOW)
            found[name] = rises(probable & quiet, probable)
        return found

    def probable(self, pins: Iterable[Array], rng: np.random.Generator) -> NDArray[np.bool_]:
        """Of each frame, whether slip is."""
        pipeline = Pipeline(self.rest, demand=DEMAND)
        found = [pipeline.features(tracks_of(xy + rng.normal(0.0, NOISE_PX, xy.shape))) for xy in pins]
        return np.array([(features.slip_probability or 0.0) > PROBABLE for features in found])


class Dome(Skin):
    """`calib.sim`."""

    def __init__(self, camera: Camera) -> None:
        self.camera = camera
        images = [Simulator(camera).frame().image for _ in range(TARE_FRAMES)]
        super().__init__(images, camera.project(camera.tip.tips_mm))

    def radius_mm(self, pull: Pull) -> float:
        curved = 1.0 / self.camera.tip.dome_radius_mm
        curved += 0.0 if pull.tool.kind == "flat" else 1.0 / pull.tool.radius_mm
        return math.sqrt(pull.depth_mm / curved)

    def pins(self, pull: Pull, depth_mm: float, way_mm: float) -> Solved:
        x, y = pull.x_mm, pull.y_mm  # a flat tool's place follows from its tilt alone, a ball's from these
        pose = ToolPose(pull.tool, x, y, depth_mm, 2.0 * x, 2.0 * y)
        x, y = way_mm * math.cos(pull.angle_rad), way_mm * math.sin(pull.angle_rad)
        moved = replace(pose, shear_x_mm=x, shear_y_mm=y)
        if pull.twists:
            turn_rad = math.copysign(way_mm / self.radius_mm(pull), math.pi - pull.angle_rad)
            moved = replace(pose, twist_deg=math.degrees(turn_rad))
        done = deform(replace(self.camera.tip, friction=pull.friction), (moved,))
        return self.camera.project(done.tips_mm), float(done.slip[0])


class HalfSpace(Skin):
    """The textbook's; a large ball is its flat tool."""

    FLAT_MM, DEPTH_REL = 20.0, 0.6
    STICKS = np.sin(np.linspace(math.pi / 2.0, 1e-3, 400))

    def __init__(self) -> None:
        self.gel = FlatGel(331, SEED)
        rng = np.random.default_rng(SEED)
        images = [self.gel.picture((), rng) for _ in range(TARE_FRAMES)]
        super().__init__(images, self.gel.project(self.gel.caps_mm()))

    def radius_mm(self, pull: Pull) -> float:
        radius = self.FLAT_MM if pull.tool.kind == "flat" else pull.tool.radius_mm
        return math.sqrt(radius * self.DEPTH_REL * pull.depth_mm)

    def pins(self, pull: Pull, depth_mm: float, way_mm: float) -> Solved:
        depth = self.DEPTH_REL * depth_mm
        radius = self.FLAT_MM if pull.tool.kind == "flat" else pull.tool.radius_mm
        ball = Ball(pull.x_mm, pull.y_mm, depth, radius_mm=radius, friction=pull.friction)
        if pull.twists:
            turns = twist_rad(ball, depth, self.STICKS)
            sticks = float(np.interp(way_mm / self.radius_mm(pull), turns, self.STICKS))
            ball, share = replace(ball, sticks=sticks), 1.0 - sticks * sticks
        else:
            way = way_mm * math.cos(pull.angle_rad), way_mm * math.sin(pull.angle_rad)
            ball, share = replace(ball, shear_mm=way), min(1.0, way_mm / (drag_rel(pull.friction) * depth))
        return self.gel.project(self.gel.caps_mm((ball,))), share


def rises(counted: NDArray[np.bool_], probable: NDArray[np.bool_]) -> int:
    """How often it becomes probable in a frame that counts."""
    return int((counted & ~np.append(False, probable[:-1])).sum())


def watch(path: Path) -> dict[str, object]:
    """Alarms of a recording; its rest frame is where it stays most of the time."""
    rate_hz = cv2.VideoCapture(str(path)).get(cv2.CAP_PROP_FPS)
    images = read(path)
    pipeline = Pipeline(untouched(images), demand=DEMAND)
    frames, alarms = [0, 0], [0, 0]  # untouched, touched
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
    """Figures of some pulls; `early` is of those that take AHEAD_S from a quarter on."""
    before = np.array([t.slid_s for t in announced])
    slow = np.array([t.could_s for t in announced]) >= AHEAD_S
    known = ~np.isnan(before)
    quiet_s = sum(t.quiet_s for t in announced)
    figures = {
        "pulls": len(announced),
        "detected": float(known.mean()),
        "false": sum(t.false_n for t in announced),
        "quiet_minutes": quiet_s / 60.0,
        "before_median_ms": 1e3 * float(np.nanmedian(before)),
        "before_tenth_ms": 1e3 * float(np.nanquantile(before, 0.1)),
        "early": float((before[slow] >= AHEAD_S).mean()),
        "share_median": float(np.nanmedian([t.share for t in announced])),
    }
    return {name: round(value, 3) for name, value in figures.items()}


def simulated() -> Iterator[dict[str, object]]:
    """A row for each kind of pull on each skin, and for all of it."""
    thick = Tip(n_pins=217, layer_mm=1.2, skin_mm=0.8, reach_mm=9.0, closed=0.6, pin_length_mm=1.5)
    skins: dict[str, tuple[Skin, int, int]] = {
        "dome": (Dome(Camera()), 60, 36),
        "half-space": (HalfSpace(), 60, 36),
        "third tip": (Dome(Camera(tip=thick, roll_deg=20.0)), 24, 24),
    }
    for of, (skin, drags, twists) in skins.items():
        kinds = *pulls(SEED, drags, twists=False), *pulls(SEED, twists, twists=True)
        announced = [
            skin.announced(pull, (SEED, k)) for k, pull in enumerate(track(kinds, of, transient=True))
        ]
        held: dict[str, list[dict[str, int]]] = {}
        for k in (0, 1, 2, -3, -2, -1):  # one of each kind
            held.setdefault(kinds[k].name, []).append(skin.held(kinds[k], (SEED, 1000 + k)))
        for name in (*held, "all"):
            some = [a for a in announced if name in (a.name, "all")]
            minutes = held[name] if name in held else [found for one in held.values() for found in one]
            false = {f"false_{what}": sum(found[what] for found in minutes) for what in minutes[0]}
            yield {"skin": of, "pull": name, **summary(some), **false}


@click.command(name="slip", help="Slip announced before it happens, and false alarms.")
@writes_results
def command(out: Path) -> None:
    """A table each for simulated pulls and recordings."""
    rows = list(simulated())
    show(rows)
    found = sorted(REAL.glob("video/*.avi")) + sorted(REAL.glob("gelsight_mini/*.avi"))
    watched = [watch(path) for path in found]
    if watched:
        show(watched)
    report = {"seed": SEED, "simulated": rows, "recordings": watched}
    write_json(out / "slip.json", report)
