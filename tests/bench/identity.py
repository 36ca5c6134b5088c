"""Pin identity after a jump: the published 331-pin set frame by frame, and simulated jumps of known truth.

The identities of real frames are not known. Two necessary conditions are counted. A pin's motion is within
4 px of the mean of its matched Delaunay neighbours'. A lattice that slipped as a whole passes that, so the
mean motion is compared with a smooth function of the robot's pose too.

The confidence of identities is meant as a probability: of the jumps with confidence c, a share c should be
right. That is counted on jumps of six tips, spoilt at random, and on published stills with a side hidden,
whose truth is what a search of the whole still found. Right is a jump without a pin that has another pin's
blob.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray
from rich.progress import track
from scipy.spatial import Delaunay
from sklearn.linear_model import RidgeCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

from calib.sim import Camera, Tip, Tool, ToolPose, deform
from edge.pins import detect, take_rest
from edge.sources.files import read_image
from edge.tracking import Tracker
from edge.tracking.search import Identifier
from edge.tracking.tip import TrackedTip
from edge.types import Array, Mask, PinPattern, Rest
from tests.bench.output import show, write_json, writes_results
from tests.bench.recordings import REAL, TIP_331, poses_of_stills
from tests.support import layouts

AGREE_PX = 4.0
CONFIDENCES = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.97, 1.0)  # between which jumps are counted
HIDDEN = 0.65  # share of a tip that is out of sight, at most
Owners = NDArray[np.int_]


@dataclass(frozen=True)
class Jump:
    """One real frame, identified from rest alone."""

    frame: str
    n_consistent: int
    confidence: float
    ms: float
    mean_motion_px: tuple[float, float]


@dataclass(frozen=True)
class Hazard:
    """The faults of a simulated frame: share of pins dropped, false blobs, pairs merged into one."""

    dropped: float = 0.0
    spurious: int = 0
    merged: int = 0


def neighbours(rest_xy: Array) -> list[Array]:
    """All Delaunay neighbours of each pin, independent of the tracker's."""
    start, index = Delaunay(rest_xy).vertex_neighbor_vertices
    return [index[start[i] : start[i + 1]] for i in range(len(rest_xy))]


def consistent(motion: Array, around: list[Array]) -> Mask:
    """(n,) pins within AGREE_PX of the mean of their matched neighbours' motion; motion NaN: unmatched."""
    matched = np.isfinite(motion[:, 0])
    good = np.zeros(len(motion), bool)
    for i in np.flatnonzero(matched):
        beside = around[i][matched[around[i]]]
        good[i] = len(beside) > 0 and np.hypot(*(motion[i] - motion[beside].mean(0))) <= AGREE_PX
    return good


def real_jumps(folder: Path, every: int) -> Iterator[Jump]:
    rest = take_rest([read_image(folder / "rest.png")])
    around = neighbours(rest.xy_img)
    for name in track(list(poses_of_stills(folder))[::every], "real frames", transient=True):
        blobs = detect(read_image(folder / "frames" / name), rest.pattern)
        tracker = Tracker(rest)
        began = time.process_time()
        tracks = tracker.identify(blobs)
        ms = (time.process_time() - began) * 1e3
        motion = tracks.xy_img - rest.xy_img
        x, y = np.nanmean(motion, axis=0).tolist() if tracks.n_seen else (0.0, 0.0)
        n_consistent = int(consistent(motion, around).sum())
        yield Jump(name, n_consistent, tracks.confidence, ms, (x, y))


def off_the_pose(jumps: list[Jump], folder: Path) -> Array:
    """(k,) px: mean motion against a cubic of the robot's pose (leave-one-out residual).

    A slip of the whole lattice by one step would stand out with a pitch, 18 px.
    """
    poses = poses_of_stills(folder)
    pose = np.array([poses[j.frame] for j in jumps])
    moved = np.array([j.mean_motion_px for j in jumps])
    basis = make_pipeline(StandardScaler(), PolynomialFeatures(3)).fit_transform(pose)
    fitted = RidgeCV([1e-3], fit_intercept=False, store_cv_results=True).fit(basis, moved)
    off: Array = np.sqrt(fitted.cv_results_[..., 0].sum(axis=1))
    return off


def simulated_rest(n_pins: int) -> tuple[Camera, Rest]:
    """A tip of the simulator at rest, with exact positions: identity alone is measured, not detection."""
    camera = Camera(tip=Tip(n_pins=n_pins))
    xy = camera.project(deform(camera.tip, ()).tips_mm)
    gap = np.hypot(*(xy[:, None] - xy).transpose(2, 0, 1))
    np.fill_diagonal(gap, np.inf)
    pitch = float(np.median(gap.min(1)))
    pattern = PinPattern(5.0, pitch, xy.mean(0), camera.radius_px + 5, 10.0, 150.0, 1.0, camera.size_px)
    return camera, Rest(layouts.pins_at(xy, 5.0, 150.0), pattern)


def random_contact(rng: np.random.Generator) -> ToolPose:
    """A press as hard and as oblique as in the published set, with any tool."""
    kind = str(rng.choice(["flat", "flat", "sphere", "edge", "two"]))
    angle, far = rng.uniform(0, 2 * np.pi), rng.uniform(0, 6)
    return ToolPose(
        tool=Tool(kind, radius_mm=float(rng.uniform(2, 6)), angle_deg=float(rng.uniform(0, 180))),
        x_mm=float(far * np.cos(angle)),
        y_mm=float(far * np.sin(angle)),
        depth_mm=float(rng.uniform(1, 5)),
        tilt_x_deg=float(rng.uniform(-20, 20)) if kind == "flat" else 0.0,
        tilt_y_deg=float(rng.uniform(-20, 20)) if kind == "flat" else 0.0,
        shear_x_mm=float(rng.uniform(-4, 4)),
        shear_y_mm=float(rng.uniform(-4, 4)),
        twist_deg=float(rng.uniform(-5, 5)),
    )


def spoil(xy: Array, hazard: Hazard, reach_px: float, rng: np.random.Generator) -> tuple[Array, Owners]:
    """Blobs (m, 2) as a detector would give them, and the pin of each: -1 none or two."""
    owner = np.arange(len(xy))
    blob = xy + rng.normal(0, 0.05, xy.shape)
    keep = rng.random(len(xy)) >= hazard.dropped
    for i in rng.permutation(len(xy))[: hazard.merged]:
        gap = np.hypot(*(xy - xy[i]).T)
        gap[i] = np.inf
        j = int(gap.argmin())
        if keep[i] and keep[j] and owner[i] >= 0 and owner[j] >= 0:
            blob[i], keep[j], owner[i] = (xy[i] + xy[j]) / 2, False, -1
    angle, far = rng.uniform(0, 2 * np.pi, hazard.spurious), reach_px * np.sqrt(rng.random(hazard.spurious))
    false = xy.mean(0) + far[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    blob = np.concatenate([blob[keep], false])
    owner = np.concatenate([owner[keep], np.full(hazard.spurious, -1)])
    order = rng.permutation(len(blob))
    return blob[order], owner[order]


@dataclass(frozen=True)
class Judged:
    """A jump's confidence, and whether it is right."""

    confidence: float
    right: bool


def judged(identifier: Identifier, blob: Array, owner: Owners) -> Judged:
    found = identifier.identify(blob)
    held = np.flatnonzero(found.blob >= 0)
    own = owner[found.blob[held]]
    return Judged(found.confidence, len(held) > 0 and not np.any((own >= 0) & (own != held)))


def smooth_press(xy: Array, rng: np.random.Generator) -> Array:
    """A press anywhere, then shear and twist, or a twist of the middle by up to 40 degrees."""
    out = xy - xy.mean(0)
    radius = np.hypot(*out.T).max()
    unit, angle = out / radius, rng.uniform(0, 2 * np.pi)
    shear = rng.uniform(0, layouts.PITCH_PX) * np.array([np.cos(angle), np.sin(angle)])
    away = unit - rng.uniform(-0.5, 0.5, 2)
    spread = away * np.exp(-((away**2).sum(1) / 0.25))[:, None] * rng.uniform(0.3, 1.1) * layouts.PITCH_PX
    held = 1 - 0.4 * (unit**2).sum(1)
    turn = np.deg2rad(rng.uniform(-5, 5)) * np.ones(len(xy))
    if rng.random() < 0.15:
        held = 1 - 0.95 * (unit**2).sum(1)
        turn, spread = np.deg2rad(rng.uniform(-40, 40)) * held, np.zeros_like(spread)
    c, s = np.cos(turn), np.sin(turn)
    turned = np.stack([c * out[:, 0] - s * out[:, 1], s * out[:, 0] + c * out[:, 1]], axis=1)
    return np.asarray(xy.mean(0) + turned + spread + held[:, None] * shear)


def random_hazard(rng: np.random.Generator) -> Hazard:
    return Hazard(
        dropped=float(rng.choice([0.0, rng.uniform(0, 0.3), rng.uniform(0.2, 0.6)])),
        spurious=int(rng.uniform(0, rng.choice([0, 20, 80]))),
        merged=int(rng.uniform(0, rng.choice([0, 0, 12]))),
    )


def visible(blob: Array, hidden: float, rng: np.random.Generator) -> Mask:
    """(m,) all but this share of the blobs, on one side."""
    angle = rng.uniform(0, 2 * np.pi)
    across = blob @ [np.cos(angle), np.sin(angle)]
    return np.asarray(across >= np.quantile(across, hidden))


def judged_simulated(jumps: int, seed: int) -> Iterator[Judged]:
    rng = np.random.default_rng(seed)
    tips = [simulated_rest(n) for n in (127, 331)]
    smooth = [layouts.rest_of(make()) for make in layouts.TIPS.values()]
    identifiers = {id(rest): Identifier(TrackedTip(rest)) for rest in [rest for _, rest in tips] + smooth}
    for _ in track(range(jumps), "confidence", transient=True):
        if rng.random() < 0.6:
            camera, rest = tips[rng.integers(len(tips))]
            xy = camera.project(deform(camera.tip, (random_contact(rng),)).tips_mm)
        else:
            rest = smooth[rng.integers(len(smooth))]
            xy = smooth_press(rest.xy_img, rng)
        reach_px = float(np.hypot(*(xy - xy.mean(0)).T).max()) + 10
        blob, owner = spoil(xy, random_hazard(rng), reach_px, rng)
        keep = visible(blob, float(rng.uniform(0, rng.choice([0, 0, HIDDEN]))), rng)
        yield judged(identifiers[id(rest)], blob[keep], owner[keep])


def judged_stills(folder: Path, every: int, seed: int) -> Iterator[Judged]:
    """Published stills with a side hidden."""
    rng = np.random.default_rng(seed)
    rest = take_rest([read_image(folder / "rest.png")])
    identifier = Identifier(TrackedTip(rest))
    for name in track(list(poses_of_stills(folder))[::every], "stills with a side hidden", transient=True):
        blobs = detect(read_image(folder / "frames" / name), rest.pattern).xy_img
        whole = identifier.identify(blobs).blob
        owner = np.full(len(blobs), -1)
        owner[whole[whole >= 0]] = np.flatnonzero(whole >= 0)
        keep = visible(blobs, rng.uniform(0, HIDDEN), rng)
        yield judged(identifier, blobs[keep], owner[keep])


def honesty(jumps: list[Judged]) -> list[dict[str, float]]:
    """By confidence: how many jumps, their mean confidence, and the share of them that is right."""
    confidence, right = np.array([(jump.confidence, jump.right) for jump in jumps], float).T
    place = np.clip(np.searchsorted(CONFIDENCES, confidence, side="right") - 1, 0, len(CONFIDENCES) - 2)
    return [
        {
            "jumps": int((place == k).sum()),
            "confidence": round(float(confidence[place == k].mean()), 3),
            "right": round(float(right[place == k].mean()), 3),
        }
        for k in np.unique(place)
    ]


@click.command(name="identity", help="Pin identity after a jump: real frames and simulated ones.")
@click.option("--every", default=1, show_default=True, help="Take each n-th real frame.")
@click.option("--jumps", default=2000, show_default=True, help="That confidence is judged on.")
@click.option("--seed", default=1, show_default=True)
@writes_results
def command(every: int, jumps: int, seed: int, out: Path) -> None:
    """Exit code 1 if more of the surest identities are wrong than they say."""
    report: dict[str, object] = {}
    folder = REAL / TIP_331
    honest = {"simulated": honesty(list(judged_simulated(jumps, seed)))}
    if folder.is_dir():
        report["real"] = _real(folder, every)
        honest["stills with a side hidden"] = honesty(list(judged_stills(folder, every, seed)))
    else:
        click.echo(f"no recordings at {folder}: real frames left out")
    for kind, rows in honest.items():
        show(rows, f"confidence, {kind}")
    report["confidence"] = honest
    write_json(out / "identity.json", report)
    if honest["simulated"][-1]["right"] < CONFIDENCES[-2]:
        raise SystemExit(1)


def _real(folder: Path, every: int) -> dict[str, object]:
    jumps = list(real_jumps(folder, every))
    count = np.array([j.n_consistent for j in jumps])
    ms = np.array([j.ms for j in jumps])
    away = off_the_pose(jumps, folder) if len(jumps) > 200 else np.zeros(len(jumps))
    quantiles = np.percentile(count, [0, 1, 5, 50]).tolist()
    found = {
        "frames": len(jumps),
        "consistent": dict(zip(("worst", "1 %", "5 %", "median"), quantiles, strict=True)),
        "least_confidence": min(j.confidence for j in jumps),
        "cpu_ms": {"median": round(float(np.median(ms)), 1), "worst": round(float(ms.max()), 1)},
        "off_the_pose_px": {"median": round(float(np.median(away)), 1), "worst": round(float(away.max()), 1)},
    }
    show([found], "real frames")
    return found
