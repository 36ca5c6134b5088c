"""Whether the confidence after a jump is honest: of the frames with confidence c, a share c must be right.

Simulated jumps: presses of four layouts, half of them dragged and twisted as a whole besides; a quarter is
seen clean, the others lose pins, gain false blobs and merged pairs; up to 60 % of the tip is hidden from one
side; one in twenty shows no such tip at all. Real jumps: published stills with a side painted over, pins
dropped and false blobs added; the match of the whole still is the truth.

A frame is right if at most a tenth of its pins have another pin's blob. Nearly all matches are right or wrong
as a whole, so that the share hardly matters.

`--fit` computes the weights of the evidence anew, from the simulated jumps alone.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import click
import cv2
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.optimize import minimize
from scipy.spatial.distance import cdist

from calib.sim import Camera, Tip, deform
from edge.pins import detect, take_rest
from edge.runtime.rest_choice import choose_rest
from edge.tracking.search import Identifier
from edge.tracking.tip import TrackedTip
from edge.types import Array, Image, Index, Mask, PinPattern, Pins, Rest, Tracks
from tests.bench.identity import REAL, Hazard, random_contact, spoil
from tests.bench.output import writes_results

TIPS = (("rings", 127), ("rings", 331), ("hex", 127), ("square", 121))
#: Jumps made of one press: how the pins moved besides (`_moved`), and whether they are seen clean.
MOVED = (
    (0, True), (1, True), (0, False), (1, False), (0, False), (1, False), (2, True), (2, False), (3, True),
)  # fmt: skip
WRONG_REL = 0.1
HIDDEN = (0.0, 0.2, 0.4, 0.6)
BINS = 10
BIN_MIN = 30  # jumps: fewer do not tell a share
DEVIATION_MAX = 0.05
REAL_TIMES = 4  # jumps made of one still and share hidden


@dataclass(frozen=True)
class Jump:
    """One jump, identified from nothing but the rest frame.

    evidence    as the confidence is made of it; empty: too few blobs to search
    hidden_rel  share of the tip that was hidden from one side
    held_n      pins with a blob; wrong_n of them with another pin's
    """

    source: str
    hidden_rel: float
    evidence: tuple[float, ...]
    confidence: float
    held_n: int
    wrong_n: int

    @property
    def right(self) -> bool:
        return self.held_n > 0 and self.wrong_n <= WRONG_REL * self.held_n

    @property
    def trusted(self) -> bool:
        return self.confidence >= Tracks.LOW_CONFIDENCE


def identified(identifier: Identifier, source: str, hidden: float, blob_xy: Array, owner: Index) -> Jump:
    """owner (m,) the pin of each blob; -1 none."""
    identity = identifier.identify(blob_xy)
    pins = np.flatnonzero(identity.blob >= 0)
    its = owner[identity.blob[pins]]
    wrong = int(np.sum((its >= 0) & (its != pins))) if np.any(owner >= 0) else len(pins)
    return Jump(source, hidden, identity.evidence, identity.confidence, len(pins), wrong)


def _in_view(xy: Array, hidden: float, rng: np.random.Generator) -> Mask:
    """(n,) the points but for a share of them that is hidden, from one side."""
    angle = rng.uniform(0, 2 * np.pi)
    along = xy @ np.array([np.cos(angle), np.sin(angle)])
    return np.asarray(along <= np.quantile(along, 1 - hidden), np.bool_)


def _rest(kind: str, n_pins: int) -> tuple[Camera, Rest]:
    """A tip of the simulator at rest, with exact positions."""
    camera = Camera(tip=Tip(n_pins=n_pins, kind=kind))
    xy = camera.project(deform(camera.tip, ()).tips_mm)
    gap = cdist(xy, xy) + np.diag(np.full(len(xy), np.inf))
    pitch = float(np.median(gap.min(1)))
    n = len(xy)
    pins = Pins(xy, np.full(n, 0.05), np.full(n, 5.0), np.full(n, 150.0))
    pattern = PinPattern(5.0, pitch, xy.mean(0), camera.radius_px + 5, 10.0, 150.0, 1.0, camera.size_px)
    return camera, Rest(pins, pattern)


def _moved(xy: Array, rest: Rest, kind: int, rng: np.random.Generator) -> Array:
    """The pins, moved as a whole besides: published tips move further than the simulator's.

    kind  0: not; 1: dragged by up to a pitch and twisted by up to 5 degrees, less at the rim; 2: shifted by
          up to 1.2 pitches, as before a camera that was knocked; 3: the middle twisted by up to 20 degrees
    """
    radius, pitch = rest.pattern.tip_radius_px, rest.pattern.pitch_px
    out = (rest.xy_img - rest.pattern.centre_img) / radius
    square = (out**2).sum(1)[:, None]
    angle = rng.uniform(0, 2 * np.pi)
    way = np.array([np.cos(angle), np.sin(angle)])
    if kind == 3:
        turn = np.deg2rad(rng.uniform(-20, 20)) * (1 - 0.95 * square)
        around = np.stack([-out[:, 1], out[:, 0]], axis=1)
        return np.asarray(xy + radius * ((np.cos(turn) - 1) * out + np.sin(turn) * around))
    shift = (0.0, 1.0, 1.2)[kind] * rng.uniform(0, 1) * pitch * way
    twist = np.deg2rad(rng.uniform(-5, 5)) * radius * np.stack([-out[:, 1], out[:, 0]], axis=1)
    return np.asarray(xy + ((1 - 0.4 * square) * (shift + twist) if kind == 1 else shift))


def simulated(presses: int, seed: int) -> Iterator[Jump]:
    rng = np.random.default_rng(seed)
    for layout, n_pins in TIPS:
        camera, rest = _rest(layout, n_pins)
        identifier = Identifier(TrackedTip.of(rest))
        for _ in track(range(presses), f"{layout} {n_pins}", transient=True):
            pressed = camera.project(deform(camera.tip, (random_contact(rng),)).tips_mm)
            for kind, clean in MOVED:
                xy = _moved(pressed if kind < 2 else rest.xy_img, rest, kind, rng)
                hidden = float(rng.choice(HIDDEN))
                hazard = Hazard("clean")
                if not clean:
                    counts = int(rng.integers(0, 60)), int(rng.integers(0, 10))
                    hazard = Hazard("spoiled", float(rng.uniform(0, 0.5)), *counts)
                blob, owner = spoil(xy, hazard, camera.radius_px + 10, rng)
                kept = (owner < 0) | _in_view(xy, hidden, rng)[owner]
                yield identified(identifier, "simulated", hidden, blob[kept], owner[kept].astype(np.int32))
            if rng.random() < 0.5:
                yield _no_tip(identifier, camera, rest, rng)


def _no_tip(identifier: Identifier, camera: Camera, rest: Rest, rng: np.random.Generator) -> Jump:
    """Blobs anywhere, or another tip's pins."""
    if rng.random() < 0.5:
        xy = _anywhere(int(rng.integers(10, 450)), rest, rng)
    else:
        others = [tip for tip in TIPS if tip != (camera.tip.kind, camera.tip.n_pins)]
        other = _rest(*others[rng.integers(len(others))])[1].xy_img
        turn = rng.uniform(0, np.pi)
        rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        xy = (other - other.mean(0)) @ rotation.T * rng.uniform(0.8, 1.2) + rest.pattern.centre_img
        xy = xy[rng.random(len(xy)) < rng.uniform(0.5, 1.0)]
    return identified(identifier, "simulated", 0.0, xy, np.full(len(xy), -1, np.int32))


def _anywhere(count: int, rest: Rest, rng: np.random.Generator) -> Array:
    """(count, 2) px, evenly over the tip."""
    angle, far = rng.uniform(0, 2 * np.pi, count), np.sqrt(rng.random(count))
    way = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.asarray(rest.pattern.centre_img + (rest.pattern.tip_radius_px + 10) * far[:, None] * way)


def real(folder: Path, every: int, seed: int) -> Iterator[Jump]:
    """Stills of one published set."""
    names = sorted((folder / "frames").glob("*.png"))[::every]
    images = [_grey(name) for name in names]
    at_rest = folder / "rest.png"
    rest = take_rest([_grey(at_rest)]) if at_rest.is_file() else choose_rest(images).rest
    identifier = Identifier(TrackedTip.of(rest))
    rng = np.random.default_rng(seed)
    for image in track(images, folder.name, transient=True):
        whole = detect(image, rest.pattern).xy_img
        truth = identifier.identify(whole)
        pins = np.flatnonzero(truth.blob >= 0)
        true_xy = whole[truth.blob[pins]]
        if len(pins) < 0.9 * len(rest):
            continue
        for hidden in (h for h in HIDDEN for _ in range(REAL_TIMES)):
            part = detect(_painted(image, true_xy, rest, hidden, rng), rest.pattern).xy_img
            part = part[rng.random(len(part)) >= rng.choice([0.0, 0.15, 0.3, 0.45])]
            blob_xy = np.concatenate([part, _anywhere(int(rng.choice([0, 0, 20, 50])), rest, rng)])
            apart = cdist(blob_xy, true_xy)
            own = np.where(apart.min(1) < 0.25 * rest.pattern.pitch_px, pins[apart.argmin(1)], -1)
            yield identified(identifier, folder.name, hidden, blob_xy, own.astype(np.int32))


def _painted(image: Image, xy: Array, rest: Rest, hidden: float, rng: np.random.Generator) -> Image:
    """The image with one side painted over, so that this share of its pins is hidden."""
    if not hidden:
        return image
    angle = rng.uniform(0, 2 * np.pi)
    way = np.array([np.cos(angle), np.sin(angle)])
    rows, columns = np.indices(image.shape)
    covered = columns * way[0] + rows * way[1] > np.quantile(xy @ way, 1 - hidden)
    return np.where(covered, np.uint8(rest.pattern.background), image)


def _grey(path: Path) -> Image:
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if image is None:
        raise click.ClickException(f"{path}: no such image; set VORONOI_TOUCH_REAL to the recordings' folder")
    return np.asarray(image, np.uint8)


@dataclass(frozen=True)
class Bin:
    """Jumps of like confidence; sigma is the sampling error of the share."""

    jumps: int
    confidence: float
    right_rel: float
    sigma: float

    @property
    def off(self) -> bool:
        """Further from the diagonal than allowed, by more than chance."""
        return abs(self.confidence - self.right_rel) - 2 * self.sigma > DEVIATION_MAX


def reliability(jumps: Sequence[Jump]) -> list[Bin]:
    """The reliability diagram, bins of equal width; those with too few jumps are left out."""
    confidence = np.array([j.confidence for j in jumps])
    right = np.array([j.right for j in jumps])
    place = np.minimum((confidence * BINS).astype(int), BINS - 1)
    bins = []
    for k in range(BINS):
        n = int(np.sum(place == k))
        if n >= BIN_MIN:
            share = float(right[place == k].mean())
            expected = float(confidence[place == k].mean())
            bins.append(Bin(n, expected, share, math.sqrt(max(expected * (1 - expected), 1e-4) / n)))
    return bins


def fitted(jumps: Sequence[Jump]) -> list[float]:
    """Weights of the evidence, of greatest likelihood, by jumps that an alternative leaves decided."""
    searched = [j for j in jumps if j.evidence and j.evidence[1] > 0.0]
    x = np.array([j.evidence for j in searched])
    sign = np.array([1.0 if j.right else -1.0 for j in searched])
    scale = np.where(x.std(0) > 0, x.std(0), 1.0)

    def cost(weights: Array) -> float:
        return float(np.logaddexp(0, -sign * ((x / scale) @ weights)).sum())

    return list((minimize(cost, np.zeros(x.shape[1]), method="BFGS").x / scale).tolist())


def _tables(console: Console, jumps: Sequence[Jump]) -> dict[str, object]:
    """Print and return both tables of one source."""
    source, bins = jumps[0].source, reliability(jumps)
    table = Table(f"{source}: confidence", "right", "+-", "jumps")
    for b in bins:
        table.add_row(f"{b.confidence:.3f}", f"{b.right_rel:.3f}", f"{b.sigma:.3f}", str(b.jumps))
    console.print(table)
    by_share = Table(
        f"{source}: hidden from one side", "jumps", "right", "trusted", "trusted and wrong", "pins wrong"
    )
    rows = []
    for hidden in HIDDEN:
        some = [j for j in jumps if j.hidden_rel == hidden]
        trusted = [j for j in some if j.trusted]
        row = (
            len(some), sum(j.right for j in some), len(trusted), sum(not j.right for j in trusted),
            sum(j.wrong_n for j in trusted if j.right),
        )  # fmt: skip
        rows.append(row)
        by_share.add_row(f"{hidden:.0%}", *map(str, row))
    console.print(by_share)
    return {
        "reliability": [asdict(b) for b in bins],
        "by_hidden_share": dict(zip(map(str, HIDDEN), rows, strict=True)),
    }


@click.command(name="confidence", help="Whether the confidence after a jump is honest: reliability diagram.")
@click.option("--presses", default=60, show_default=True, help="Simulated presses of each layout.")
@click.option("--every", default=8, show_default=True, help="Take each n-th of 600 real stills.")
@click.option("--seed", default=1, show_default=True)
@click.option("--fit", "fit", is_flag=True, help="Fit the weights of the evidence to these simulated jumps.")
@writes_results
def command(presses: int, every: int, seed: int, fit: bool, out: Path) -> None:
    """Exit code 1 if a bin is off the diagonal, or a real frame is trusted and wrong."""
    console = Console()
    groups = [list(simulated(presses, seed))]
    for name, step in (("tactip331_gray", 1), ("tactip331_binary", every)):
        if (REAL / name).is_dir():
            groups.append(list(real(REAL / name, step, seed)))
        else:
            console.print(f"no recordings at {REAL / name}: left out")
    report = {jumps[0].source: _tables(console, jumps) for jumps in groups}
    if fit:
        console.print(f"log_odds = {tuple(round(w, 2) for w in fitted(groups[0]))}")
    (out / "confidence.json").write_text(json.dumps(report, indent=1) + "\n")
    off = any(b.off for b in reliability(groups[0]))
    if off or any(j.trusted and not j.right for jumps in groups[1:] for j in jumps):
        raise SystemExit(1)
