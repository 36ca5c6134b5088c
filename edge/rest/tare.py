"""The rest frame: taken from a few images of the untouched tip, matched to known pins, and checked.

A rest frame that shows a touch makes every later value wrong without any sign of it. So each candidate is
checked within itself (the pins do not move), against known pins (the calibration's, or else the last accepted
rest frame's, after a homography: a camera may have turned), and without known pins by the symmetry of its
cells.

"Untouched" is decided by the contact detector, with the noise that it expects of the pins' positions. The
noise is also measured in the candidate, because creep and temperature bend a tip a little: if the typical
area change is larger than expected, the expectation is raised, within the limits of the detector's own
learning. A larger change cannot be explained by noise.
"""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Self

import cv2
import numpy as np

from edge.calibration import Calibration
from edge.cells import Tessellator
from edge.errors import CalibrationError, DegenerateLayout, EdgeError, NoPins
from edge.features import FeatureExtractor, FeaturePlan
from edge.features.params import CELL_NOISE
from edge.features.params import PARAMS as CONTACT
from edge.geometry.parts import parts_of, tracks_of
from edge.geometry.select import SIGMA_OF_MAD
from edge.params import PARAMS as RUNTIME
from edge.pins import take_rest
from edge.rest.symmetry import symmetry_of
from edge.rest.tip_match import SHARED_MIN, as_followed, identified, match_tip, near_rest
from edge.types import FrameSource, Image, Lens, Pins, Polarity, Region, Rest, Tracks
from hostlink.wire import RestFrameReason

Reason = RestFrameReason
LET_GO = "let go, or force the tare"


@dataclass(frozen=True, slots=True)
class TareParams:
    """Thresholds of the tare; evidence in docs/tuning.md."""

    frames_n: int = 8  # images that the rest frame is made from
    steady_px: float = 0.5  # largest motion of 90 % of the pins from the first image to the last
    polarity: Polarity = Polarity.FOUND  # of the pins, as far as it is known
    lens: Lens | None = None  # whose distortion is removed from the pins' places
    region: Region | None = None  # that the images show

    def of(self, source: FrameSource) -> Self:
        """The same for the images of a source; only a live tip can be asked to keep still."""
        found = replace(self, polarity=source.polarity, lens=source.lens, region=source.region)
        return found if source.live else replace(found, steady_px=math.inf)

    def take(self, images: Sequence[Image]) -> Rest:
        """A rest frame, unchecked. Raises NoPins."""
        return take_rest(images, self.polarity, self.lens, self.region)


PARAMS = TareParams()


class TareRefused(EdgeError):
    """The rest frame was refused, for a reason as sent over the wire; problem: the same as text."""

    def __init__(self, reason: RestFrameReason, problem: str, advice: str = "") -> None:
        super().__init__(f"tare: {problem}; {advice}" if advice else f"tare: {problem}")
        self.reason, self.problem = reason, problem


@dataclass(frozen=True, slots=True)
class RestFrame:
    """A rest frame that may be used."""

    rest: Rest  # row i is pin i of the calibration, where there is one
    reason: RestFrameReason = Reason.NONE  # NONE, or why it is implausible: then it was forced
    message: str = ""  # the same as text


def take_rest_frame(
    images: Sequence[Image],
    params: TareParams = PARAMS,
    calibration: Calibration | None = None,
    reference: Rest | None = None,
    *,
    force: bool = False,
) -> RestFrame:
    """The rest frame from a few images of the tip, checked.

    calibration  gives the order of the pins, and the pins of the untouched tip, unless it estimated them
    reference    last accepted rest frame; gives the untouched pins if the calibration does not
    force        accept a frame with a touch, motion or lost pins, and report it; never another tip
    Raises       TareRefused
    """
    try:
        rest = _take(images, params, calibration)
    except NoPins as error:
        raise TareRefused(Reason.NO_PIN_PATTERN, str(error)) from None
    problems: list[TareRefused] = []

    def check(problem: TareRefused | None) -> None:
        if problem is not None:
            if not force:
                raise problem
            problems.append(problem)

    first, last = (near_rest(rest, images[k]) for k in (0, -1))
    check(_unsteady(first, last, params.steady_px))
    matched = rest
    if calibration is not None:
        try:
            matched, tracks = match_tip(calibration, rest)
        except CalibrationError as error:
            raise TareRefused(Reason.OTHER_TIP, str(error)) from None
    if calibration is not None and matched.since is None:
        check(_touch_shown(calibration.rest, tracks, "the calibration's"))
    elif reference is not None:
        check(_changed(reference, rest))
    else:
        check(_begins(rest, first, last))
        if (symmetry := symmetry_of(rest)).in_contact:
            check(TareRefused(Reason.TOUCHED, f"something touches the tip ({symmetry.message})", LET_GO))
    matched = as_followed(matched, images)
    if not problems:
        return RestFrame(matched)
    return RestFrame(matched, problems[0].reason, "; ".join(problem.problem for problem in problems))


def _take(images: Sequence[Image], params: TareParams, calibration: Calibration | None) -> Rest:
    """The rest frame, unchecked; pins like the calibration's are looked for first. Raises NoPins."""
    if calibration is not None:
        like = calibration.rest.pattern
        polarity = Polarity.DARK if like.dark else Polarity.BRIGHT
        if params.polarity in (Polarity.FOUND, polarity):
            with suppress(NoPins):
                return take_rest(images, polarity, params.lens, params.region, like)
    return params.take(images)


def _unsteady(first: Pins, last: Pins, steady_px: float) -> TareRefused | None:
    """Whether pins move from the first image to the last."""
    motion_px = float(np.nanquantile(np.hypot(*(last.xy_img - first.xy_img).T), RUNTIME.most_rel))
    if motion_px <= steady_px:
        return None
    problem = f"the pins moved by {motion_px:.2f} px while the rest frame was taken"
    advice = f"leave the tip untouched (limit {steady_px:g} px, key [tare] steady_px)"
    return TareRefused(Reason.UNSTEADY, problem, advice)


def _begins(rest: Rest, first: Pins, last: Pins) -> TareRefused | None:
    """Whether a touch begins or ends between the first image and the last."""
    seen = np.isfinite(first.xy_img[:, 0]) & np.isfinite(last.xy_img[:, 0])
    xy = np.where(seen[:, None], first.xy_img, rest.xy_img)
    before = replace(rest, pins=replace(rest.pins, xy_img=xy))
    xy = np.where(seen[:, None], last.xy_img, np.nan)
    sigma = np.where(seen, last.sigma_px, np.nan)
    if _touch_sigmas(before, Tracks.of(xy, sigma, seen)):
        return TareRefused(Reason.UNSTEADY, "a touch began or ended while the rest frame was taken", LET_GO)
    return None


def _changed(reference: Rest, rest: Rest) -> TareRefused | None:
    """Whether the rest frame shows a touch, or fewer pins, against the last accepted one."""
    if len(rest) < SHARED_MIN * len(reference):
        return TareRefused(
            Reason.TOO_FEW_PINS,
            f"{len(rest)} pins, {len(reference)} at the last one",
            "clear the camera's view",
        )
    tracks = identified(reference, rest.pins)
    if tracks.confidence < Tracks.LOW_CONFIDENCE:
        problem = "the pins cannot be matched with those of the last rest frame"
        return TareRefused(
            Reason.OTHER, f"{problem}: something touches the tip, or it is another one", LET_GO
        )
    return _touch_shown(reference, tracks, "the last rest frame's")


def _touch_shown(reference: Rest, tracks: Tracks, whose: str) -> TareRefused | None:
    sigmas = _touch_sigmas(reference, _seen_from_before(reference, tracks))
    if not sigmas:
        return None
    problem = f"something touches the tip (cells changed by {sigmas:.0f} sigma against {whose})"
    return TareRefused(Reason.TOUCHED, problem, LET_GO)


def _seen_from_before(reference: Rest, tracks: Tracks) -> Tracks:
    """The tracks as the reference's camera would see them, by a homography of the half that fits it best."""
    seen = tracks.seen
    wanted, found = reference.xy_img[seen], tracks.xy_img[seen]
    best = np.ones(len(found), dtype=np.bool_)
    moved = found
    for _ in range(5):
        homography, _ = cv2.findHomography(found[best], wanted[best], 0)
        if homography is None:
            return tracks
        moved = cv2.perspectiveTransform(found[None], homography)[0]
        off = np.hypot(*(moved - wanted).T)
        best = off <= np.median(off)
    xy = np.full_like(tracks.xy_img, np.nan)
    xy[seen] = moved
    return replace(tracks, xy_img=xy)


def _touch_sigmas(reference: Rest, tracks: Tracks) -> float:
    """Largest area change of a cell, in sigmas of its noise, if the detector sees a touch; 0.0: untouched."""
    return max(_of_part(own, tracks_of(tracks, rows)) for rows, own in parts_of(reference))


def _of_part(reference: Rest, tracks: Tracks) -> float:
    tessellator = Tessellator(reference)
    rest_area = tessellator.rest_area_px2
    try:
        cells = tessellator.cells(tracks)
    except DegenerateLayout:
        return math.inf
    rest_sigma_px = float(np.median(reference.pins.sigma_px))
    sigma_px = math.hypot(float(np.mean(tracks.sigma_px[tracks.seen])), rest_sigma_px)
    change = cells.area_px2 / rest_area - 1.0
    expected = CELL_NOISE * sigma_px / reference.pattern.pitch_px
    # The median of all cells is that of an untouched one.
    ratio = SIGMA_OF_MAD * float(np.nanmedian(np.abs(change))) / expected
    sigmas = float(np.nanmax(np.abs(change))) / (expected * max(1.0, min(ratio, CONTACT.noise_ratio_max)))
    if ratio > CONTACT.noise_ratio_max:
        return sigmas
    # The detector adds the reference's own noise to what it is given.
    frame_px = math.sqrt(max((sigma_px * max(1.0, ratio)) ** 2 - rest_sigma_px**2, 0.0))
    noisy = replace(tracks, sigma_px=np.where(tracks.seen, frame_px, np.nan))
    in_contact: bool = (
        FeatureExtractor(reference, rest_area).extract(noisy, cells, FeaturePlan(frozenset())).in_contact
    )
    return sigmas if in_contact else 0.0
