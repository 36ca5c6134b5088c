"""Pins held through the published videos: identities, distances, jumps, untrusted frames, contacts.

The videos have no truth. Necessary conditions are counted: played forwards and backwards every pin
ends where it began; two tracks never come nearer than half a pitch (or their limit at rest, if that is
less); a pin never leaps against its neighbours from one frame to the next.

Contacts are counted, too: a tip is touched where its pins' motion is bent, and quiet where it is hardly more
than noise. A light touch is neither. A quiet frame near one that is not quiet may show a touch that begins or
ends; amid quiet ones it is untouched, and a contact in it is false.

`north` and `west` begin loaded or moving, so that they need the untouched tip: the pose of most frames, found
in a first pass.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np

from edge.frame import Pipeline
from edge.geometry.layout import affine_terms
from edge.pins import take_rest
from edge.sources import open_source
from edge.tracking.tip import TrackedTip
from edge.types import Feature, Frame, Image, Rest, Result, Tracks
from tests.bench.output import show, write_json, writes_results
from tests.bench.recordings import REAL

NAMES = ("Movement4", "north", "west", "flatSkin")
STRIDES = (1, 2, 4, 8)
TARE_FRAMES = 8  # the configuration's default
LEAP = 0.5  # steps to the next pin, against the neighbours, from one frame to the next
QUIET, TOUCHED = 0.012, 0.08  # pitches, median distance of the pins from an affine motion: below, above
AMID = 3  # quiet frames on either side of an untouched one: the videos show a picture up to three times


@dataclass(frozen=True)
class Play:
    """One way through one video.

    n_rest       pins of the rest frame
    held         pins seen in the trusted frames: median and worst
    unsure       frames whose identities were not trusted
    searched     frames that were searched as a whole
    nearest      least distance of two tracks, in pitches
    leaps        pins that moved against their neighbours by more than LEAP steps in one frame
    left         after playing there and back: pins that ended more than a third of a pitch from where they
                 began
    """

    video: str
    way: str
    frames: int
    n_rest: int
    held: tuple[int, int]
    unsure: int
    searched: int
    nearest: float
    leaps: int
    left: int | None


@dataclass(frozen=True)
class Felt:
    """What a pipeline says of one video.

    touched, one, more        frames with a bent motion; of these with one contact, with more
    quiet, quiet_contacts     frames with hardly any motion; of these with a contact
    untouched, false          quiet frames amid quiet ones; of these with a contact
    """

    video: str
    touched: int
    one: int
    more: int
    quiet: int
    quiet_contacts: int
    untouched: int
    false: int


def read(path: Path) -> list[Image]:
    """All frames, grey."""
    return [frame.image for frame in open_source(str(path))]


def run(images: Sequence[Image], rest: Rest) -> list[Result]:
    """What a pipeline finds in each image."""
    pipeline = Pipeline(rest, demand=frozenset({Feature.CONTACTS}))
    return [pipeline.process(Frame(image, k, k)) for k, image in enumerate(images)]


def evaluate(video: str, way: str, rest: Rest, results: list[Result], back: bool = False) -> Play:
    tip = TrackedTip(rest)
    pitch = rest.pattern.pitch_px
    sure = [r.tracks for r in results if r.tracks.confidence >= Tracks.LOW_CONFIDENCE]
    nearest, leaps, before = np.inf, 0, None
    for t in sure:
        a, b = tip.lattice.pairs.T
        gap = np.hypot(*(t.xy_img[a] - t.xy_img[b]).T)
        nearest = min(nearest, float(np.nanmin(gap, initial=np.inf)) / pitch)
        motion = np.where(t.seen[:, None], t.xy_img - rest.xy_img, 0.0)
        predicted, _, _ = tip.affine.predict(motion, t.seen)
        residual = np.where(t.seen[:, None], motion - predicted, np.nan)
        if before is not None:
            leaps += int(np.sum(np.hypot(*(residual - before).T) > LEAP * tip.lattice.local_pitch_px))
        before = residual
    left = None
    if back:
        off = np.hypot(*(sure[-1].xy_img - rest.xy_img).T)
        left = int(np.sum(off > pitch / 3))
    count = [t.n_seen for t in sure] or [0]
    return Play(
        video, way, len(results), len(rest), (int(np.median(count)), min(count)),
        len(results) - len(sure), sum(r.searched for r in results), round(nearest, 3), leaps, left,
    )  # fmt: skip


def residual_of(tracks: Tracks, rest: Rest) -> float:
    """Median distance of the seen pins' motion from an affine one, pitches."""
    motion = (tracks.xy_img - rest.xy_img)[tracks.seen] / rest.pattern.pitch_px
    terms = affine_terms(rest.xy_img[tracks.seen], rest.pattern.centre_img, rest.pattern.pitch_px)
    off = motion - terms @ np.linalg.lstsq(terms, motion, rcond=None)[0]
    return float(np.median(np.hypot(*off.T)))


def felt(video: str, results: list[Result], rest: Rest) -> Felt:
    """Contacts in the trusted frames of a video, against how bent the motion is."""
    sure = [r for r in results if r.features is not None]
    off = np.full(len(results), np.inf)  # of frames whose identities are not trusted nothing is known
    off[[r.frame.sequence for r in sure]] = [residual_of(r.tracks, rest) for r in sure]
    count = np.array([0 if r.features is None else len(r.features.contacts or ()) for r in results])
    bent, quiet = np.isfinite(off) & (off > TOUCHED), off < QUIET
    amid = np.convolve(quiet, np.ones(2 * AMID + 1), "same") > 2 * AMID
    touched = count[bent].tolist()
    return Felt(
        video, len(touched), touched.count(1), sum(n > 1 for n in touched),
        int(quiet.sum()), int((count[quiet] > 0).sum()), int(amid.sum()), int((count[amid] > 0).sum()),
    )  # fmt: skip


def untouched(images: Sequence[Image]) -> Rest:
    """The rest frame from where the tip stays most of the time."""
    first = take_rest(images[:TARE_FRAMES])
    tracks = [result.tracks for result in run(images, first)]
    xy = np.array([t.xy_img for t in tracks if t.confidence >= Tracks.LOW_CONFIDENCE])
    usable = np.flatnonzero([t.confidence >= Tracks.LOW_CONFIDENCE for t in tracks])
    alike = np.array([np.nanmean(np.hypot(*(xy - one).T), axis=0) for one in xy]) < 1.0
    stays = [row[k : k + TARE_FRAMES].all() for k, row in enumerate(alike)]
    middle = usable[int((alike.sum(axis=1) * stays).argmax())]
    return take_rest(images[middle : middle + TARE_FRAMES])


@click.command(name="videos", help="Identities held and contacts found in the published videos.")
@writes_results
def command(out: Path) -> None:
    """Exit code 1 if Movement4 does not end where it began."""
    plays: list[Play] = []
    contacts: list[Felt] = []
    for name in NAMES:
        images = read(REAL / "video" / f"{name}.avi")
        rest = take_rest(images[:TARE_FRAMES])
        results = run(images, rest)
        plays.append(evaluate(name, "start to end", rest, results))
        if name == "Movement4":
            for stride in STRIDES:
                there = images[::stride]
                both = run([*there, *there[::-1]], rest)
                plays.append(evaluate(name, f"there and back, every {stride}", rest, both, back=True))
        if name in ("north", "west"):
            rest = untouched(images)
            results = run(images, rest)
            plays.append(evaluate(name, "tare where it is untouched", rest, results))
        contacts.append(felt(name, results, rest))
    report: dict[str, Any] = {"plays": [asdict(p) for p in plays], "contacts": [asdict(f) for f in contacts]}
    for rows in ("plays", "contacts"):
        show(report[rows])
    write_json(out / "videos.json", report)
    if any(p.left for p in plays):
        raise SystemExit(1)
