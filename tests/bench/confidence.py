"""How honest the confidence of identities is: of the jumps with confidence c, a share c should be right.

Jumps from rest of six tips, spoilt at random: pins dropped, false blobs, pairs merged, a side hidden. Right
is a jump without a pin that has another pin's blob. And published stills with a side hidden: what a search of
the whole still found is their truth. `--fit` prints the weights of `search.found_evidence` that make the
confidence of the simulated jumps most likely.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray
from rich.progress import track
from scipy.optimize import minimize
from scipy.special import expit

from calib.sim import deform
from edge.pins import detect, take_rest
from edge.sources import read_image
from edge.tracking.hypothesis import Hypothesis
from edge.tracking.search import Identifier, Identity, best_of_two, found_evidence
from edge.tracking.tip import TrackedTip
from edge.types import Array, Rest, Tracks
from tests.bench.identity import Hazard, random_contact, simulated_rest, spoil
from tests.bench.output import show, write_json, writes_results
from tests.bench.recordings import REAL, TIP_331, poses_of_stills
from tests.support import layouts

Owners = NDArray[np.int_]
EDGES = (0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.97, 1.0)


@dataclass(frozen=True)
class Outcome:
    """One jump; ahead and evidence are what its confidence was made of."""

    confidence: float
    right: bool
    held_n: int
    in_view_n: int
    ahead: float
    evidence: tuple[float, ...]


class Recorder(Identifier):
    """Keeps what the last confidence was made of."""

    ahead = 0.0
    evidence: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)

    def _confidence(self, best: Hypothesis, ahead: float) -> float:
        if best.known_n:
            self.ahead, self.evidence = ahead, found_evidence(best)
        return super()._confidence(best, ahead)


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


def spoilt(xy: Array, reach_px: float, rng: np.random.Generator) -> tuple[Array, Owners]:
    """Blobs (m, 2) and the pin of each, -1 none, with random faults."""
    hazard = Hazard(
        "random",
        dropped=float(rng.choice([0.0, rng.uniform(0, 0.3), rng.uniform(0.2, 0.6)])),
        spurious=int(rng.uniform(0, rng.choice([0, 20, 80]))),
        merged=int(rng.uniform(0, rng.choice([0, 0, 12]))),
    )
    blob, owner = spoil(xy, hazard, reach_px, rng)
    keep = visible(blob, float(rng.uniform(0, rng.choice([0, 0, 0.65]))), rng)
    return blob[keep], owner[keep]


def visible(blob: Array, hidden: float, rng: np.random.Generator) -> NDArray[np.bool_]:
    """(m,) all but this share of the blobs, on one side."""
    angle = rng.uniform(0, 2 * np.pi)
    across = blob @ [np.cos(angle), np.sin(angle)]
    return np.asarray(across >= np.quantile(across, hidden))


def simulated(jumps: int, seed: int) -> Iterator[Outcome]:
    rng = np.random.default_rng(seed)
    tips = [simulated_rest(n) for n in (127, 331)]
    smooth = [layouts.rest_of(make()) for make in layouts.TIPS.values()]
    recorders = {id(rest): Recorder(TrackedTip.of(rest)) for rest in [rest for _, rest in tips] + smooth}
    for _ in track(range(jumps), "simulated jumps", transient=True):
        if rng.random() < 0.6:
            camera, rest = tips[rng.integers(len(tips))]
            xy = camera.project(deform(camera.tip, (random_contact(rng),)).tips_mm)
        else:
            rest = smooth[rng.integers(len(smooth))]
            xy = smooth_press(rest.xy_img, rng)
        reach = float(np.hypot(*(xy - xy.mean(0)).T).max()) + 10
        yield _outcome(recorders[id(rest)], *spoilt(xy, reach, rng))


def masked(every: int, seed: int) -> Iterator[Outcome]:
    """Published stills with a side hidden."""
    rng, folder = np.random.default_rng(seed), REAL / TIP_331
    rest: Rest = take_rest([read_image(folder / "rest.png")])
    recorder = Recorder(TrackedTip.of(rest))
    for name in track(list(poses_of_stills(folder))[::every], "masked stills", transient=True):
        blobs = detect(read_image(folder / "frames" / name), rest.pattern).xy_img
        whole = recorder.identify(blobs)
        owner = np.full(len(blobs), -1)
        owner[whole.blob[whole.blob >= 0]] = np.flatnonzero(whole.blob >= 0)
        keep = visible(blobs, rng.uniform(0, 0.65), rng)
        yield _outcome(recorder, blobs[keep], owner[keep])


def _outcome(recorder: Recorder, blob: Array, owner: Owners) -> Outcome:
    found: Identity = recorder.identify(blob)
    held = np.flatnonzero(found.blob >= 0)
    own = owner[found.blob[held]]
    right = len(held) > 0 and not np.any((own >= 0) & (own != held))
    in_view = int(np.count_nonzero(owner >= 0))
    return Outcome(found.confidence, right, len(held), in_view, recorder.ahead, recorder.evidence)


def fitted(outcomes: list[Outcome]) -> Array:
    """The weights of the evidence under which the outcomes are most likely."""
    right = np.array([o.right for o in outcomes])
    ahead = np.array([best_of_two(o.ahead) for o in outcomes])
    terms = np.nan_to_num(np.array([o.evidence for o in outcomes]), neginf=-20.0)

    def log_loss(weights: Array) -> float:
        p = np.clip(ahead * expit(terms @ weights), 1e-9, 1 - 1e-9)
        return -float(np.mean(np.log(np.where(right, p, 1 - p))))

    return np.asarray(minimize(log_loss, np.zeros(terms.shape[1]), method="BFGS").x)


def diagram(outcomes: list[Outcome]) -> list[dict[str, float]]:
    """By confidence: how many jumps, their mean confidence, and the share of them that is right."""
    confidence, right = np.array([(o.confidence, o.right) for o in outcomes], float).T
    place = np.clip(np.searchsorted(EDGES, confidence, side="right") - 1, 0, len(EDGES) - 2)
    bins = [(place == k) for k in range(len(EDGES) - 1) if (place == k).any()]
    return [
        {
            "jumps": int(here.sum()),
            "confidence": round(float(confidence[here].mean()), 3),
            "right": round(float(right[here].mean()), 3),
        }
        for here in bins
    ]


@click.command(name="confidence", help="How honest the confidence of identities is.")
@click.option("--jumps", type=click.IntRange(min=1), default=2000, show_default=True, help="Simulated jumps.")
@click.option(
    "--every",
    type=click.IntRange(min=1),
    default=3,
    show_default=True,
    help="Take each n-th published still.",
)
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True)
@click.option("--fit", is_flag=True, help="Print the weights that fit these jumps best.")
@writes_results
def command(jumps: int, every: int, seed: int, fit: bool, out: Path) -> None:
    kinds = {"simulated": list(simulated(jumps, seed))}
    if (REAL / TIP_331).is_dir():
        kinds["stills with a side hidden"] = list(masked(every, seed))
    else:
        click.echo(f"no recordings at {REAL / TIP_331}: published stills left out")
    report = {}
    for kind, outcomes in kinds.items():
        bins = diagram(outcomes)
        show(bins, kind)
        used = [o for o in outcomes if o.confidence >= Tracks.LOW_CONFIDENCE]
        wrong_n = sum(not o.right for o in used)
        share = sum(o.held_n for o in used) / max(sum(o.in_view_n for o in used), 1)
        click.echo(
            f"{len(used)} of {len(outcomes)} are used (confidence {Tracks.LOW_CONFIDENCE} and more): "
            f"{wrong_n} of them wrong, {100 * share:.1f} % of the pins in view held"
        )
        report[kind] = {
            "jumps": len(outcomes),
            "used": len(used),
            "used_wrong": wrong_n,
            "right": sum(o.right for o in outcomes),
            "bins": bins,
        }
    if fit:
        click.echo(f"weights: {np.round(fitted(kinds['simulated']), 2).tolist()}")
    write_json(out / "confidence.json", report)
