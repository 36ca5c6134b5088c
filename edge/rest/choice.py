"""A rest frame for a recording that need not begin untouched: its least deformed image.

A touch enlarges the cells under it, and its place differs from image to image. So the low quantile of a
cell's area over many images is about its area untouched, even if no image is; each image is as deformed as
its cells differ from that. An untouched tip looks the same each time, a touch rarely does: if images show the
same cells to within the noise, the image is chosen among those that most others agree with, and is trusted.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from edge.calibration import Calibration
from edge.cells import Tessellator
from edge.errors import CalibrationError, DegenerateLayout, NoPins, SourceError
from edge.features.params import CELL_NOISE
from edge.features.params import PARAMS as CONTACT
from edge.geometry.parts import joined, own_pins, parts_of
from edge.params import PARAMS as RUNTIME
from edge.pins import detect
from edge.pins.rest_frame import first_with_pins
from edge.rest.tare import PARAMS as TARE
from edge.rest.tare import TareParams, TareRefused, take_rest_frame
from edge.rest.tip_match import SHARED_MIN, match_tip, moved_onto, near_rest
from edge.tracking import Tracker
from edge.types import Array, Frame, FrameSource, Image, Mask, Pins, Rest, Tracks
from hostlink.wire import RestFrameReason

#: Share of the images that may show a touch: the quantile of a cell's area over the others is untouched, and
#: so is an image that shows the same cells as as many as they are; two at least, as any may have a double.
TOUCHED_REL = RUNTIME.most_rel


@dataclass(frozen=True, slots=True)
class RestChoice:
    """The image that shows the tip least deformed."""

    index: int  # of the image, from 0
    rest: Rest  # rest frame made of it
    deformation_rel: float  # rms relative area change of its cells against those untouched
    typical_rel: float  # the same, median over the images
    agree_n: int  # other images, of `compared_n`, that show the same cells
    compared_n: int

    @property
    def trusted(self) -> bool:
        """Whether it shows the untouched tip, as far as a recording can show it."""
        return self.agree_n >= _agree_min_n(self.compared_n)

    @property
    def message(self) -> str:
        """A message for people: how certain it is."""
        found = (
            f"the least deformed: its cells are {self.deformation_rel:.1%} off untouched ones, "
            f"{self.typical_rel:.1%} in a typical image"
        )
        verdict = "untouched" if self.trusted else "it may show a touch"
        return f"{found}; {self.agree_n} of {self.compared_n} others show the same: {verdict}"


def choose_rest(images: Sequence[Image], params: TareParams = TARE) -> RestChoice:
    """The least deformed of some images, in any order. Raises NoPins: no image shows pins."""
    start, rest = first_with_pins(images, lambda image: params.take([image]))
    found = _compare(images, rest)
    if not found.agrees[found.index, start]:  # the touch in it may have hidden pins
        again = _compare(images, params.take([images[found.index]]))
        found = again if again.known_n >= found.known_n else found
    return RestChoice(
        found.index,
        params.take([images[found.index]]),
        float(found.deformation[found.index]),
        float(np.nanmedian(found.deformation)),
        int(found.agrees[found.index].sum()) - 1,
        found.known_n - 1,
    )


@dataclass(frozen=True, slots=True)
class _Comparison:
    """k images, relative to one of them."""

    index: int  # the least deformed one
    deformation: Array  # (k,) NaN: pins not identified
    agrees: Mask  # (k, k) whether two show the same cells

    @property
    def known_n(self) -> int:
        return int(np.isfinite(self.deformation).sum())


def _compare(images: Sequence[Image], rest: Rest) -> _Comparison:
    area, sigma, seen = _cells(images, rest)
    known = np.isfinite(sigma)
    area = area[:, np.isfinite(area[known]).any(axis=0)]  # a pin may be seen in no other image
    untouched = np.nanquantile(area[known], 1.0 - TOUCHED_REL, axis=0)
    deformation = np.full(len(area), np.nan)
    deformation[known] = _rms(area[known] - untouched)
    agrees = np.zeros((len(area), len(area)), bool)
    for k in np.flatnonzero(known):
        noise = CELL_NOISE * np.hypot(sigma[known], sigma[k]) / rest.pattern.pitch_px
        agrees[k, known] = _rms(area[known] - area[k]) < CONTACT.noise_ratio_max * noise
    agree_n = agrees.sum(axis=1) - 1
    # A press that is held for long is shown by more images than the untouched tip.
    shared = known & (agree_n >= _agree_min_n(int(known.sum()) - 1))
    candidates = shared if shared.any() else known
    candidates = candidates & (seen >= SHARED_MIN * np.median(seen[candidates]))
    return _Comparison(int(np.argmin(np.where(candidates, deformation, np.inf))), deformation, agrees)


def _agree_min_n(compared_n: int) -> float:
    """Other images that must show the same cells."""
    return max(2.0, (1.0 - TOUCHED_REL) * compared_n)


def _rms(change: Array) -> Array:
    """(k,) of the rows, without NaN."""
    return np.asarray(np.sqrt(np.nanmean(change**2, axis=1)))


def _cells(images: Sequence[Image], rest: Rest) -> tuple[Array, Array, Array]:
    """(k, n) log cell areas, zoom removed, NaN: not known; (k,) sigma, px; (k,) number of pins seen."""
    parts = parts_of(rest)
    areas, sigmas, seen = zip(*(_cells_of_part(images, own) for _, own in parts), strict=True)
    area = joined([rows for rows, _ in parts], [one.T for one in areas]).T
    return area, np.mean(sigmas, axis=0), np.sum(seen, axis=0)


def _cells_of_part(images: Sequence[Image], rest: Rest) -> tuple[Array, Array, Array]:
    tracker, tessellator = Tracker(rest), Tessellator(rest)
    area = np.full((len(images), len(rest)), np.nan)
    sigma = np.full(len(images), np.nan)
    seen = np.zeros(len(images))
    for k, image in enumerate(images):
        tracks = tracker.identify(own_pins(detect(image, rest.pattern), rest))
        if tracks.confidence < Tracks.LOW_CONFIDENCE:
            continue
        try:
            log_area = np.log(tessellator.cells(tracks).area_px2)
        except DegenerateLayout:
            continue
        area[k] = log_area - np.nanmedian(log_area)
        sigma[k] = float(np.mean(tracks.sigma_px[tracks.seen]))
        seen[k] = tracks.n_seen
    return area, sigma, seen


def aligned(calibration: Calibration, rest: Rest) -> Rest:
    """A calibration's rest pins, in its order, where this camera would see them. Raises CalibrationError."""
    matched, tracks = match_tip(calibration, rest)
    if matched.since:
        return replace(matched, pins=matched.since.pins, since=None)
    xy = moved_onto(calibration.rest, tracks)
    pins = replace(matched.pins, xy_img=xy, sigma_px=calibration.rest.pins.sigma_px)
    return replace(matched, pins=pins)


@dataclass(frozen=True, slots=True)
class GivenRest:
    """The rest frame of a recording, the frame it is taken from, and a message for people."""

    rest: Rest
    frame: Frame
    message: str
    untouched: bool | None  # whether the frame shows the untouched tip; None: that was not looked at


def rest_of_source(source: FrameSource, how: str, calibration: Calibration | None = None) -> GivenRest:
    """The rest frame of a recording that is read twice.

    how     "auto", "none" (the calibration's rest pins, moved), or the number of an image, from 0
    Raises  SourceError: no such image, no pins in it; CalibrationError: another tip
    """
    if source.live:
        raise SourceError(f"{source.name}: --rest is for recordings; leave a live tip untouched instead")
    if how == "none" and calibration is None:
        raise SourceError("--rest none: needs --calibration, which has the rest pins; or give --rest auto")
    try:
        if how in ("auto", "none"):
            # With fewer images, those untouched would not be two.
            images, step = _thinned(source, round(2.0 / (1.0 - TOUCHED_REL)))
            choice = choose_rest(images, TARE.of(source))
            index = choice.index * step
            message, untouched = f"image {index}: {choice.message}", choice.trusted
        else:
            index, message, untouched = int(how), f"image {how}", None
        rest, frame = _averaged(source, index)
    except NoPins as error:
        raise SourceError(f"{source.name}: --rest {how}: {error}") from None
    if calibration is None:
        return GivenRest(rest, frame, message, untouched)
    moved = f"{message}; the calibration's rest pins are moved onto it"
    return GivenRest(aligned(calibration, rest), frame, moved, untouched)


def rest_if_touched(source: FrameSource, calibration: Calibration | None = None) -> GivenRest | None:
    """An untouched rest frame for a recording that begins under a touch.

    Returns  None: it is live, it begins untouched, as far as can be seen, or it has no image that surely is
    Raises   SourceError, CalibrationError
    """
    if source.live:
        return None
    images = [frame.image for frame in islice(source, TARE.frames_n)]
    try:
        take_rest_frame(images, TARE.of(source), calibration)
    except TareRefused as error:
        if error.reason in (RestFrameReason.OTHER_TIP, RestFrameReason.NO_PIN_PATTERN):
            foreign = error.reason is RestFrameReason.OTHER_TIP
            raise (CalibrationError if foreign else SourceError)(f"{source.name}: {error}") from None
        if error.reason is not RestFrameReason.TOUCHED:
            return None
        given = rest_of_source(source, "auto", calibration)
        if not given.untouched:
            return None
        return replace(given, message=f"the first images are no rest frame: {error.problem}; {given.message}")
    return None


def _thinned(source: FrameSource, least_n: int) -> tuple[list[Image], int]:
    """Images evenly over a recording, `least_n` to twice as many, and the step between them."""
    kept: list[Image] = []
    step = 1
    for n, frame in enumerate(source):
        if n % step:
            continue
        kept.append(frame.image)
        if len(kept) == 2 * least_n:
            kept, step = kept[::2], 2 * step
    return kept, step


def _averaged(source: FrameSource, index: int) -> tuple[Rest, Frame]:
    """The rest frame of an image and of its neighbours that show the same. Raises SourceError, NoPins."""
    first = max(0, index - TARE.frames_n // 2)
    frames = list(islice(source, first, first + TARE.frames_n))
    if index - first >= len(frames):
        raise SourceError(f"{source.name}: has no image {index}; give --rest a smaller number, or auto")
    chosen = frames[index - first]
    rest = TARE.of(source).take([chosen.image])

    def rests(pins: Pins) -> bool:
        motion = np.hypot(*(pins.xy_img - rest.xy_img).T)
        return bool(np.nanquantile(motion, RUNTIME.most_rel) < TARE.steady_px)

    steady = [f.image for f in frames if f is chosen or rests(near_rest(rest, f.image))]
    return TARE.of(source).take(steady), chosen
