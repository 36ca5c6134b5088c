"""Contacts on three simulators: two, three, a shallow one beside a deep one, bars, shear, light touches.

What holds on one simulator alone may be a property of that simulator. Parameters of `edge.features` were set
on the dome of `calib.sim` (`dome_pins`). An elastic half-space with pins (`half_space`, `flat_gel`) and a
bonded layer with pins, or with dots on its surface (`bonded_layer`), were written from textbooks and
independently of it.

    tools --mechanics--> pins --camera--> pictures --all stages, calibrated--> contacts, against the truth

Rules
- Tools come in steps of half a millimetre at most, as in a video; the last picture of each scene counts.
- The calibration is of single presses of the same tool with shear, fitted to the pins' true places with a
  centroid's noise: no picture is needed for it.
- Place is where a tool touched the untouched skin, depth is below the untouched surface: what two close tools
  push down together belongs to both.
- `probe` is as blunt as 1.2 pitches, so that two of them 2 pitches apart are two; `ball` has 5 mm.
- Errors of place and depth are of the scenes in which the number of contacts is right.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from math import ceil, nan
from pathlib import Path

import click
import numpy as np
from rich.progress import track
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from calib.extract import DEMAND, Measured, contact_inputs, frame_inputs, gather
from calib.fit import ModelKind, Search, fit
from calib.targets import Targets
from edge.calibration import Calibration
from edge.calibration.inputs import CONTACT_INPUTS, FRAME_INPUTS
from edge.frame import Pipeline
from edge.pins import take_rest
from edge.types import Array, Feature, Frame, Rest, Result, Tracks
from tests.bench.bonded_layer import LayerPins, SurfaceDots
from tests.bench.dome_pins import DomePins
from tests.bench.flat_gel import RADIUS_MM, FlatGel
from tests.bench.half_space import Ball, Bar, own_depths_mm
from tests.bench.output import show, write_json, writes_results

TARE_N = 8
STEP_MM = 0.5
REACH_MM = 0.6 * RADIUS_MM  # of places from the axis: further out half of a contact has no pins
PROBE_PITCHES, BALL_MM = 1.2, 5.0
CALIBRATION_N = 300
CALIBRATION_DEPTH_MM, CALIBRATION_SHEAR_MM = (0.1, 3.5), 2.0
CENTROID_PX = 0.04  # rms error of a cap's place in the pictures
SHEAR_MM = 2.0
EDGE_MM = 0.3  # radius of a sharp edge
Gel = FlatGel | DomePins
Tools = tuple[Ball | Bar, ...]
Maker = Callable[[float, np.random.Generator], Tools]


@dataclass(frozen=True)
class Measures:
    """Of one kind of scene: measured, or the bound (`right` at least, the others at most); NaN: none.

    right        share of the scenes with the true number of contacts
    place_mm, depth_mm, direction_deg  mean absolute error
    bias_mm      mean error of the place along the shear, without its sign
    worst_deg    largest error of the direction
    """

    right: float = nan
    place_mm: float = nan
    bias_mm: float = nan
    depth_mm: float = nan
    direction_deg: float = nan
    worst_deg: float = nan

    def known(self) -> dict[str, float | None]:
        """By name; None for NaN."""
        return {name: None if value != value else round(value, 4) for name, value in asdict(self).items()}

    def keeps(self, bounds: "Measures") -> bool:
        """Whether each that is bounded keeps its bound; one that is missing does not."""
        held = [
            value >= bound if name == "right" else value <= bound
            for (name, value), bound in zip(asdict(self).items(), asdict(bounds).values(), strict=True)
            if bound == bound
        ]
        return all(held)


@dataclass(frozen=True)
class Scene:
    """A kind of scene.

    tools     of one scene, from the tip's pitch in mm and a generator
    ball      the calibration is of the ball; else of the probe
    of_dots   bounds with dots on the surface
    """

    name: str
    tools: Maker
    bounds: Measures
    ball: bool = False
    of_dots: Measures = Measures()

    def bounds_of(self, kind: "Kind") -> Measures:
        """On a kind of tip."""
        if kind.dots:
            return self.of_dots
        return Measures(**{name: kind.slack(name, bound) for name, bound in asdict(self.bounds).items()})


def _probe(pitch_mm: float, place: complex, depth_mm: float) -> Ball:
    return Ball(place.real, place.imag, depth_mm, radius_mm=PROBE_PITCHES * pitch_mm)


def _somewhere(rng: np.random.Generator, reach_mm: float = REACH_MM) -> complex:
    return complex(reach_mm * np.sqrt(rng.random()) * np.exp(2j * np.pi * rng.random()))


def _pair(pitches: float, depths_mm: tuple[tuple[float, float], tuple[float, float]]) -> Maker:
    """Two probes that far apart, each of a depth in a range."""

    def tools(pitch_mm: float, rng: np.random.Generator) -> Tools:
        half = 0.5 * pitches * pitch_mm * complex(np.exp(2j * np.pi * rng.random()))
        middle = _somewhere(rng, max(REACH_MM - abs(half), 0.0))
        return tuple(
            _probe(pitch_mm, middle + way, rng.uniform(*depth_mm))
            for way, depth_mm in zip((-half, half), depths_mm, strict=True)
        )

    return tools


def _three(pitch_mm: float, rng: np.random.Generator) -> Tools:
    """Corners of a triangle of three pitches a side."""
    middle, turn = _somewhere(rng, 2.0), 2.0 * np.pi * rng.random()
    out = np.sqrt(3.0) * pitch_mm
    corners = [middle + out * complex(np.exp(1j * (turn + k * 2.0 * np.pi / 3.0))) for k in range(3)]
    return tuple(_probe(pitch_mm, corner, rng.uniform(0.5, 1.0)) for corner in corners)


def _bar(pitch_mm: float, rng: np.random.Generator) -> Tools:
    place = _somewhere(rng, 4.0)
    angle, depth, length = rng.uniform(-np.pi / 2, np.pi / 2), rng.uniform(0.5, 2.0), rng.uniform(10.0, 16.0)
    return (Bar(place.real, place.imag, angle, depth, length),)


def _sheared(pitch_mm: float, rng: np.random.Generator) -> Tools:
    place, way = _somewhere(rng), SHEAR_MM * complex(np.exp(2j * np.pi * rng.random()))
    return (Ball(place.real, place.imag, rng.uniform(1.5, 2.5), (way.real, way.imag), BALL_MM),)


def _one(pitch_mm: float, rng: np.random.Generator) -> Tools:
    return (_probe(pitch_mm, _somewhere(rng), rng.uniform(0.5, 2.5)),)


def _edge(pitch_mm: float, rng: np.random.Generator) -> Tools:
    (bar,) = _bar(pitch_mm, rng)
    return (replace(bar, radius_mm=EDGE_MM, depth_mm=0.5 * bar.depth_mm),)


def _light(pitch_mm: float, rng: np.random.Generator) -> Tools:
    place = _somewhere(rng)
    return (Ball(place.real, place.imag, rng.uniform(0.15, 0.5), radius_mm=BALL_MM),)


_ALIKE = ((0.5, 1.0), (0.5, 1.0))
_UNEQUAL = ((1.0, 1.0), (3.0, 3.0))
_TWO = Measures(right=1.0, place_mm=0.2, depth_mm=0.15)
_TWO_DOTS = Measures(right=0.95)
SCENES = (
    *(Scene(f"two, {d:g} pitches apart", _pair(d, _ALIKE), _TWO) for d in (2.0, 2.5)),
    *(Scene(f"two, {d:g} pitches apart", _pair(d, _ALIKE), _TWO, of_dots=_TWO_DOTS) for d in (3.0, 4.0, 6.0)),
    *(
        Scene(
            f"1 mm beside 3 mm, {d:g} pitches",
            _pair(d, _UNEQUAL),
            Measures(right=0.95),
            of_dots=Measures(right=0.8),
        )
        for d in (3.0, 4.0, 5.0)
    ),
    Scene("three, 3 pitches apart", _three, Measures(right=1.0), of_dots=Measures(right=0.9)),
    Scene("bar", _bar, Measures(right=1.0, direction_deg=1.5, worst_deg=4.0)),
    Scene(f"sheared by {SHEAR_MM:g} mm", _sheared, Measures(right=1.0, bias_mm=0.15), ball=True),
    Scene("0.15 to 0.5 mm deep", _light, Measures(depth_mm=0.1), ball=True),
    Scene("untouched", lambda pitch_mm, rng: (), Measures(right=1.0), of_dots=Measures(right=1.0)),
    Scene("one", _one, Measures(right=1.0, place_mm=0.2), of_dots=Measures(right=1.0, place_mm=0.15)),
    Scene("sharp edge", _edge, Measures(right=1.0)),
)


@dataclass(frozen=True)
class Kind:
    """A kind of tip.

    made   from its number of pins and a seed
    limit  factor on all bounds but a share
    """

    name: str
    n_pins: int
    made: Callable[[int, int], Gel]
    limit: float = 1.0
    dots: bool = False

    def slack(self, name: str, bound: float) -> float:
        """The bound of a measure by its name."""
        return bound if name == "right" else self.limit * bound


KINDS = (
    Kind("127 pins", 127, FlatGel),
    Kind("331 pins", 331, FlatGel),
    Kind("dome, 127 pins", 127, DomePins, 1.5),
    Kind("layer, 127 pins", 127, LayerPins, 1.5),
    Kind("layer, 144 dots on it", 144, SurfaceDots, dots=True),
)


@dataclass
class SecondTip:
    """A tip of a simulator, tared and calibrated.

    gel          the pins
    rest         as tared from pictures
    pipelines    calibrated for the ball (True) and for the probe (False)
    """

    gel: Gel
    rest: Rest
    pipelines: dict[bool, Pipeline] = field(default_factory=dict)

    @classmethod
    def made(cls, kind: Kind, seed: int, presses: int = CALIBRATION_N) -> "SecondTip":
        """Tared, and calibrated by that many presses of each tool."""
        gel, rng = kind.made(kind.n_pins, seed), np.random.default_rng(seed)
        rest = take_rest([gel.picture((), rng) for _ in range(TARE_N)])
        tip = cls(gel, Rest(rest.pins, replace(rest.pattern, on_surface=kind.dots)))
        for ball in (False, True):
            radius = BALL_MM if ball else PROBE_PITCHES * gel.pitch_mm
            calibration = tip._calibrated(radius, presses, rng)
            demand = frozenset({*DEMAND, Feature.ORIENTATION})
            tip.pipelines[ball] = Pipeline(tip.rest, calibration, demand=demand)
        return tip

    def show(self, ball: bool, tools: Tools, rng: np.random.Generator) -> Result:
        """The result of the last picture of an approach."""
        pipeline = self.pipelines[ball]
        pipeline.forget()
        for k, step in enumerate(_approach(tools)):
            result = pipeline.process(Frame(self.gel.picture(step, rng), k, k))
        return result

    def _calibrated(self, radius_mm: float, presses: int, rng: np.random.Generator) -> Calibration:
        """By presses of one ball in random places, with shear as far as it sticks."""
        pipeline = Pipeline(self.rest, demand=DEMAND)
        at_rest = self.gel.project(self.gel.caps_mm())
        own = np.hypot(*(self.rest.xy_img[:, None] - at_rest).transpose(2, 0, 1)).argmin(axis=1)
        balls = [_press(radius_mm, rng) for _ in range(presses)]
        rows = []
        for ball in balls:
            xy = self.gel.project(self.gel.caps_mm((ball,)))[own]
            noisy = xy + CENTROID_PX * rng.standard_normal(xy.shape)
            rows.append(self._row(pipeline, noisy))
        x, y, depth = np.array([(b.x_mm, b.y_mm, b.depth_mm) for b in balls]).T
        names = ("displacement_mm", "contact_x_mm", "contact_y_mm", "contact_depth_mm")
        values = dict(zip(names, (depth, x, y, depth), strict=True))
        frames = tuple(Path(f"press-{i}") for i in range(presses))
        kinds = frozenset({ModelKind.PLAIN, ModelKind.POLYNOMIAL})  # a process takes minutes to fit
        targets = Targets(f"a ball of {radius_mm:.1f} mm", frames, values, "")
        return fit(self.rest, targets, gather(rows), mm_per_px=None, search=Search(kinds=kinds))[0]

    def _row(self, pipeline: Pipeline, xy_img: Array) -> Measured:
        """What a calibration is fitted to, of pins at given places."""
        seen = np.ones(len(xy_img), np.bool_)
        features = pipeline.features(Tracks.of(xy_img, self.rest.pins.sigma_px, seen))
        contact = np.full(len(CONTACT_INPUTS), nan, np.complex128)
        if features.contacts:
            contact = contact_inputs(features.contacts[0], features, self.rest.pattern)
        inputs, found = frame_inputs(features, self.rest.pattern), len(features.contacts or ())
        lossy = np.full((1, len(FRAME_INPUTS)), nan, np.complex128)  # no pins are removed
        return inputs, contact, 1.0, len(xy_img), True, features.in_contact, found, nan, 0.0, lossy


def _press(radius_mm: float, rng: np.random.Generator) -> Ball:
    """One of a calibration."""
    place, depth = _somewhere(rng, REACH_MM + 1.0), rng.uniform(*CALIBRATION_DEPTH_MM)
    way = min(CALIBRATION_SHEAR_MM, depth) * _somewhere(rng, 1.0)
    return Ball(place.real, place.imag, depth, (way.real, way.imag), radius_mm)


def _approach(tools: Tools) -> Iterator[Tools]:
    """The tools, pressed in steps and then sheared in steps."""
    down = max(1, ceil(max((tool.depth_mm for tool in tools), default=0.0) / STEP_MM))
    sheared = [float(np.hypot(*tool.shear_mm)) for tool in tools if isinstance(tool, Ball)]
    sideways = ceil(max(sheared, default=0.0) / STEP_MM)
    for k in range(1, down + 1):
        yield tuple(_part(tool, k / down, 0.0) for tool in tools)
    for k in range(1, sideways + 1):
        yield tuple(_part(tool, 1.0, k / sideways) for tool in tools)


def _part(tool: Ball | Bar, pressed: float, sheared: float) -> Ball | Bar:
    """A tool on its way."""
    if isinstance(tool, Bar):
        return replace(tool, depth_mm=pressed * tool.depth_mm)
    x, y = tool.shear_mm
    return replace(tool, depth_mm=pressed * tool.depth_mm, shear_mm=(sheared * x, sheared * y))


@dataclass(frozen=True)
class Errors:
    """One scene read; empty where the number of contacts is wrong, or there is nothing to compare.

    right     the number of contacts is that of the tools
    place_mm  distance of each contact from its tool's place
    bias_mm   of each contact from its tool's place, along the shear
    """

    right: bool
    place_mm: tuple[float, ...] = ()
    bias_mm: tuple[float, ...] = ()
    depth_mm: tuple[float, ...] = ()
    direction_deg: tuple[float, ...] = ()


def read(result: Result, tools: Tools) -> Errors:
    """The contacts found against the tools."""
    features = result.features
    found = None if features is None else features.contacts
    if found is None or len(found) != len(tools):
        return Errors(False)
    if not tools:
        return Errors(True)
    bar = tools[0]
    if isinstance(bar, Bar):
        off = (found[0].orientation_rad - bar.angle_rad) / math.pi
        return Errors(True, direction_deg=(180.0 * abs(off - round(off)) if math.isfinite(off) else 90.0,))
    balls = [tool for tool in tools if isinstance(tool, Ball)]
    contacts = _in_order(result.reading.contacts, balls)
    off_mm = contacts[:, :2] - [(ball.x_mm, ball.y_mm) for ball in balls]
    shear = np.array([ball.shear_mm for ball in balls]).reshape(-1, 2)
    size = np.hypot(*shear.T)
    along = ((off_mm * shear).sum(axis=1)[size > 0.0] / size[size > 0.0]).tolist()
    depth = np.abs(contacts[:, 2] - [ball.depth_mm for ball in balls])
    return Errors(True, tuple(np.hypot(*off_mm.T).tolist()), tuple(along), tuple(depth.tolist()))


def _in_order(contacts: Array, balls: Sequence[Ball]) -> Array:
    """The contacts as they fit the balls best: least sum of distances."""
    place = np.array([(ball.x_mm, ball.y_mm) for ball in balls]).reshape(-1, 2)
    _, order = linear_sum_assignment(cdist(place, contacts[:, :2]))
    ordered: Array = contacts[order]
    return ordered


def measure(tip: SecondTip, scene: Scene, n: int, seed: int) -> Measures:
    """Read n scenes of a kind."""
    rng = np.random.default_rng(seed)
    errors = []
    for _ in range(n):
        tools = scene.tools(tip.gel.pitch_mm, rng)
        while min(own_depths_mm([t for t in tools if isinstance(t, Ball)]), default=1.0) <= 0.0:
            tools = scene.tools(tip.gel.pitch_mm, rng)  # one of them hangs over the other's dent
        errors.append(read(tip.show(scene.ball, tools, rng), tools))
    return Measures(
        right=float(np.mean([e.right for e in errors])),
        place_mm=_mean(errors, "place_mm"),
        bias_mm=abs(_mean(errors, "bias_mm")),
        depth_mm=_mean(errors, "depth_mm"),
        direction_deg=_mean(errors, "direction_deg"),
        worst_deg=max((v for e in errors for v in e.direction_deg), default=nan),
    )


def _mean(errors: Sequence[Errors], name: str) -> float:
    values = [v for e in errors for v in getattr(e, name)]
    return float(np.mean(values)) if values else nan


@click.command(name="contacts", help="Contacts on three simulators, against their bounds.")
@click.option("--scenes", "n_scenes", default=8, show_default=True, type=click.IntRange(1), help="A kind.")
@click.option("--bars", "n_bars", default=16, show_default=True, type=click.IntRange(1))
@click.option("--untouched", "n_untouched", default=100, show_default=True, type=click.IntRange(1))
@click.option("--tip", "only", help="A part of the tips' names: others are left out.", default="")
@click.option("--seed", default=1, show_default=True)
@writes_results
def command(n_scenes: int, n_bars: int, n_untouched: int, only: str, seed: int, out: Path) -> None:
    """Exit code 1 if a bound is not kept."""
    counts = {"bar": n_bars, "untouched": n_untouched}
    rows: list[dict[str, object]] = []
    for kind in (kind for kind in KINDS if only in kind.name):
        tip = SecondTip.made(kind, seed)
        for i, scene in enumerate(track(SCENES, kind.name)):
            n = counts.get(scene.name, n_scenes)
            found = measure(tip, scene, n, seed + i)
            row: dict[str, object] = {"tip": kind.name, "scene": scene.name, "scenes": n}
            rows.append(row | found.known() | {"holds": found.keeps(scene.bounds_of(kind))})
    write_json(out / "contacts.json", rows)
    show([{"scene": scene.name, **scene.bounds.known()} for scene in SCENES], "bounds")
    show(rows, "right: share of the scenes; mm, deg")
    if not all(row["holds"] for row in rows):
        raise SystemExit(1)
