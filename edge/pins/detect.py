"""All pins of a whole image, with no prior knowledge but (at most) their pattern.

Idea
- Spots of all sizes are gathered (`blobs`); the size that holds most of the light is the pins'. Spots that do
  not fit their neighbours are removed, spots that fill a gap are added (`pattern`).
- Pins are brighter than the skin or darker. Both the image and the inverted one are tried: of a tip only one
  has a pattern of pins. Below `learn` all code reads bright pins.
- With a pattern only its own size is searched for. Its absolute brightness is not used: illumination changes.
  Where pins are missing, those that the view's border cuts are found too (`partial`); not in a rest frame.
"""

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import cast

import cv2
import numpy as np

from edge.errors import NoPins
from edge.geometry.lattice import N_RING, pitch_of
from edge.geometry.layout import circle_of
from edge.geometry.neighbours import nearest_of
from edge.geometry.parts import rows_of, stack
from edge.geometry.select import SIGMA_OF_MAD
from edge.limits import PINS_MIN
from edge.params import PARAMS as RUNTIME
from edge.pins.blobs import Spots, find_spots, measure_discs
from edge.pins.lens import corrected_pins, pattern_as_seen
from edge.pins.params import PARAMS
from edge.pins.partial import find_cut
from edge.pins.pattern import (
    FLAT,
    Trend,
    belongs,
    fills_gap,
    one_of_each,
    one_of_each_marker,
    trend_of,
    unevenness,
)
from edge.pins.refine import CentroidRefiner
from edge.pins.templates import radius_max_px
from edge.types import Array, Image, Mask, PinPattern, Pins, Polarity, Rest

#: Bright or dark pins are looked for, or both: whether each is dark.
_TRIED = {Polarity.FOUND: (False, True), Polarity.BRIGHT: (False,), Polarity.DARK: (True,)}


def detect(image: Image, pattern: PinPattern) -> Pins:
    """All pins of this pattern in the image, in no order; it may have none."""
    grey = to_grey(image)
    if pattern.lens is not None:
        return corrected_pins(detect(grey, pattern_as_seen(pattern)), pattern.lens)
    grey = as_bright(grey, pattern.dark)
    pattern = replace(pattern, dark=False)
    whole = _centroids(grey, _find(grey, pattern), pattern)[0]
    if len(whole) >= pattern.count:
        return whole
    cut = find_cut(grey, whole, pattern, pattern.count - len(whole))
    return stack([whole, cut])


def to_grey(image: Image) -> Image:
    """(h, w) uint8 or uint16, rows contiguous; colour (h, w, 3) is taken as BGR."""
    if image.ndim == 3:
        return to_grey(cast(Image, cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)))
    return cast(Image, np.ascontiguousarray(image))


def as_bright(grey: Image, dark: bool) -> Image:
    """The image in which pins are brighter than the skin: itself, or the inverted one."""
    return np.iinfo(grey.dtype).max - grey if dark else grey


def noise_of(grey: Image) -> float:
    """Standard deviation of the grey level from pixel to pixel, gradients removed; robust to edges."""
    # weights 1 1 -4 1 1 give sqrt(20) times the noise
    if grey.dtype == np.uint8:  # a tenth of the instructions; what is beyond 255 counts as 255
        residual = cv2.convertScaleAbs(cv2.Laplacian(grey, cv2.CV_16S))
        counts = cv2.calcHist([residual], [0], None, [256], [0, 256]).ravel()
    else:
        wide = np.abs(cv2.Laplacian(grey.astype(np.float32), cv2.CV_32F)).astype(np.intp)
        counts = np.bincount(wide.ravel())
    # The median of whole numbers by their counts takes an eighth of the time of a partition.
    up_to = np.cumsum(counts[:-1], dtype=np.intp)
    middle = np.searchsorted(up_to, [(grey.size - 1) // 2, grey.size // 2], side="right")
    return float(SIGMA_OF_MAD * np.float32(middle.mean()) / np.sqrt(20.0))


def learn(
    image: Image, polarity: Polarity = Polarity.FOUND, like: PinPattern | None = None
) -> tuple[PinPattern, Pins]:
    """Pattern and pins, in no order, of one image of the untouched tip, of which nothing else is known.

    Where bright and dark pins are found, those of the more even pattern are taken.

    image   (h, w) uint8 or uint16, or (h, w, 3) BGR
    like    of an earlier image of this tip, bright pins: pins of its size are looked for first, and where
            there are as many as then, no others
    Raises  NoPins: no pins of a tip in it
    """
    grey = to_grey(image)
    if like is not None and like.size_px == grey.shape[::-1]:
        with suppress(_NotThese):
            learnt = _learn(grey, False, like)
            if len(learnt.pins) >= like.count:
                return learnt.pattern, learnt.pins
    found: list[_Learnt] = []
    failures: list[str] = []
    for dark in _TRIED[polarity]:
        try:
            found.append(_learn(as_bright(grey, dark), dark))
        except _NotThese as error:
            failures.append(f"{'dark' if dark else 'bright'} ones: {error}")
    if not found:
        low, high = float(grey.min()), float(grey.max())
        raise NoPins(
            f"no pattern of pins in the image: {'; '.join(failures)}; grey levels {low:g} to {high:g}; "
            "an image of the tip in focus with its light on would show a dozen or more"
        )
    best = min(found, key=lambda learnt: learnt.unlikeness)
    return best.pattern, best.pins


class _NotThese(Exception):
    """Why the bright spots of an image are no pins."""


@dataclass(frozen=True, slots=True)
class _Learnt:
    """A pattern, its pins, and how unlike discs of one kind they are: `PARAMS.unlike_pins_max` at most."""

    pattern: PinPattern
    pins: Pins
    unlikeness: float


def _learn(grey: Image, dark: bool, like: PinPattern | None = None) -> _Learnt:
    """The same of an image whose pins are bright; `dark`: it is the inverted one."""
    noise = noise_of(grey)
    spots = _of_any_size(grey, noise) if like is None else _find(grey, like)
    if len(spots) < PINS_MIN:
        raise _NotThese(f"{len(spots)} spots alike")
    radius_px, brightness = float(np.median(spots.radius_px)), float(np.median(spots.depth))
    at = np.rint(spots.xy_img).astype(np.intp)
    background = float(np.median(grey[at[:, 1], at[:, 0]] - spots.depth))
    centre_img, tip_radius_px = circle_of(spots.xy_img, radius_px)
    pattern = PinPattern(
        pin_radius_px=radius_px,
        pitch_px=pitch_of(spots.xy_img),
        centre_img=centre_img,
        tip_radius_px=tip_radius_px,
        background=max(background, 0.0),
        brightness=brightness,
        noise=noise,
        size_px=(grey.shape[1], grey.shape[0]),
        edge_px=measure_discs(grey, spots)[1],
        radius_range_px=(
            float(np.quantile(spots.radius_px, 0.02)),
            float(np.quantile(spots.radius_px, 0.98)),
        ),
    )
    if radius_px < PARAMS.scale_range[0] * PARAMS.search_radius_min_px:
        raise _NotThese(f"spots of {radius_px:.1f} px radius")
    most_px = radius_max_px(pattern.edge_px)
    if radius_px > most_px:
        raise _NotThese(
            f"of {radius_px:.0f} px radius in an image of {grey.shape[1]} x {grey.shape[0]} px: up to "
            f"{most_px:.0f} px are read; set the camera to a smaller image"
        )
    if like is None:
        spots = _find(grey, pattern)
    if len(spots) >= PINS_MIN:
        pins, fit = _centroids(grey, spots, pattern)
        if fit < RUNTIME.most_rel:
            # A sharp disc ends at one or the other lobe of a marker with a ghost; a blurred one covers both.
            blurred = replace(pattern, edge_px=2.0 * pattern.edge_px)
            as_blurred, fit_blurred = _centroids(grey, spots, blurred)
            if 1.0 - fit_blurred < RUNTIME.most_rel * (1.0 - fit):
                pattern, pins = blurred, as_blurred
        pins = in_view(pins, pattern.size_px)
        trend = trend_of(spots.xy_img, spots.radius_px, spots.depth, radius_px)
        unlikeness = unevenness(spots, trend if trend.explains else FLAT) + 1.0 - fit
        if len(pins) >= PINS_MIN and unlikeness < PARAMS.unlike_pins_max:
            _refuse_glints(grey, pins, pattern)
            centre_img, tip_radius_px = circle_of(pins.xy_img, radius_px)  # some spots were no pins
            at_rest = replace(pattern, count=len(pins), centre_img=centre_img, tip_radius_px=tip_radius_px)
            glints = tuple((float(x), float(y)) for x, y in find_cut(grey, pins, at_rest, len(pins)).xy_img)
            return _Learnt(replace(at_rest, glints_img=glints, dark=dark), pins, unlikeness)
    raise _NotThese("spots that are neither round nor evenly spaced")


def _of_any_size(grey: Image, noise: float) -> Spots:
    """The spots of the size that holds most light, and those that fit them. Raises _NotThese: too few."""
    radius_max = max(3.0, PARAMS.search_radius_max_side * min(grey.shape))
    step = PARAMS.search_radius_step
    scales = PARAMS.search_radius_min_px * step ** np.arange(
        np.log(radius_max / PARAMS.search_radius_min_px) / np.log(step)
    )
    found = _at_scales(grey, scales, max(noise, 1.0))
    spots = found[_well_shaped(found)]
    if len(spots) < PINS_MIN:
        raise _NotThese(f"{len(spots)} spots")
    size = _common_radius(spots)
    core = np.median(spots.depth[np.abs(np.log(spots.radius_px / size)) < 0.2])
    depth_min = PARAMS.depth_min_pins * float(core)
    return _settle(grey, found, spots[_alike(spots, size, depth_min, FLAT)], size, depth_min)


def in_view(pins: Pins, size_px: tuple[int, int]) -> Pins:
    """Without those that the image's border halves: the least motion outwards takes them out of view."""
    free_space = np.minimum(pins.xy_img, np.array(size_px) - 1.0 - pins.xy_img).min(axis=1)
    return rows_of(pins, free_space >= PARAMS.rest_gap_radii * pins.radius_px)


def _refuse_glints(grey: Image, pins: Pins, pattern: PinPattern) -> None:
    """Raise _NotThese where the bright spots are reflections on dark pins.

    The skin between bright pins is as dark as that next to each pin. Next to a reflection lies the dark pin
    that causes it, and halfway to those round it the brighter skin, or a ghost of a few.
    """
    ring = nearest_of(pins.xy_img, pins.xy_img, 1 + N_RING)[1][:, 1:]
    x, y = np.rint((pins.xy_img[:, None] + pins.xy_img[ring]) / 2).astype(np.intp).T
    skin = float(np.median(grey[y, x]))
    if skin > pattern.background + 0.5 * pattern.brightness:
        raise _NotThese(f"{len(pins)} spots on ground that is unlike the skin between them: reflections")


def spots_of(grey: Image, pattern: PinPattern) -> Spots:
    """All spots of about the pins' size on the tip that would be bright enough in twice the light."""
    small, large = pattern.radius_range_px
    if small <= 0.0:
        small = large = pattern.pin_radius_px
    steps = np.log(large / small) / np.log(PARAMS.scale_range[1] / PARAMS.scale_range[0])
    count = max(1, int(np.ceil(steps)))
    scales = small * (large / small) ** ((np.arange(count) + 0.5) / count)
    # The light may have halved since.
    found = _at_scales(grey, scales, 0.5 * PARAMS.depth_min_pins * pattern.brightness)
    return found[np.hypot(*(found.xy_img - pattern.centre_img).T) < 1.1 * pattern.tip_radius_px]


def left_out(image: Image, rest: Rest) -> Array:
    """(k, 2) px, spots of the pins' size, more than half as bright, clear of all, that are taken for none.

    Their neighbours are too unlike or too far away, or they are no pins. `rest` is as the camera sees it.
    """
    spots = spots_of(as_bright(to_grey(image), rest.pattern.dark), rest.pattern)
    spots = spots[_well_shaped(spots) & (spots.depth > 0.5 * rest.pattern.brightness)]
    if len(spots) == 0:
        return spots.xy_img
    away = nearest_of(rest.xy_img, spots.xy_img)[0][:, 0]
    return spots.xy_img[away > rest.pattern.pin_radius_px + spots.radius_px]


def _find(grey: Image, pattern: PinPattern) -> Spots:
    found = spots_of(grey, pattern)
    spots = found[_well_shaped(found)]
    if len(spots) == 0:
        return spots
    depth_min = PARAMS.depth_min_pins * float(np.median(spots.depth))
    return _settle(grey, found, spots[spots.depth > depth_min], pattern.pin_radius_px, depth_min)


def _at_scales(grey: Image, scales: Array, depth_min: float) -> Spots:
    """Spots of all scales, each once, at the scale that suits it best."""
    parts, misfits = [], []
    for radius in scales:
        spots = find_spots(grey, float(radius), depth_min)
        scale = spots.radius_px / radius
        fits = (scale > PARAMS.scale_range[0]) & (scale < PARAMS.scale_range[1])
        fits &= spots.spread < PARAMS.gap_ray_spread_max
        parts.append(spots[fits])
        misfits.append((np.abs(np.log(scale)) + spots.spread + (1.0 - spots.share))[fits])
    spots = stack(parts)
    return spots[one_of_each(spots.xy_img, 0.9 * spots.radius_px, np.concatenate(misfits))]


def _well_shaped(spots: Spots) -> Mask:
    return np.asarray(spots.spread < PARAMS.ray_spread_max)


def _settle(grey: Image, found: Spots, likely: Spots, radius_px: float, depth_min: float) -> Spots:
    """The pins among all spots: of about the given size, fitting each other; then those that fill gaps.

    likely  of which most are pins: a trend is taken from them
    Where a trend over the picture explains most of how their size differs, and shows plainly more of them,
    size, depth and spacing are judged against it.
    """
    pins = _fitting(grey, found, radius_px, depth_min, FLAT)
    if len(likely) < PINS_MIN:
        return pins
    trend = trend_of(likely.xy_img, likely.radius_px, likely.depth, radius_px)
    if not trend.explains:
        return pins
    most = _fitting(grey, found, radius_px, depth_min, trend)
    for _ in range(PARAMS.steps_max):
        if len(most) < PINS_MIN:
            break
        trend = trend_of(most.xy_img, most.radius_px, most.depth, radius_px)
        seen = _fitting(grey, found, radius_px, depth_min, trend)
        if len(seen) <= len(most):
            break
        most = seen
    return most if RUNTIME.most_rel * len(most) > len(pins) else pins


def _alike(spots: Spots, radius_px: float, depth_min: float, trend: Trend) -> Mask:
    radius, depth, _ = trend.at(spots.xy_img)
    scale = spots.radius_px / (radius_px * radius)
    return np.asarray((spots.depth > depth_min * depth) & (scale > 0.45) & (scale < 2.0))


def _fitting(grey: Image, found: Spots, radius_px: float, depth_min: float, trend: Trend) -> Spots:
    """The pins by a given trend."""
    found = found[_alike(found, radius_px, depth_min, trend)]
    if len(found) == 0:
        return found
    if trend is FLAT:
        found = replace(found, radius_px=measure_discs(grey, found)[0])
    kept = np.flatnonzero(_well_shaped(found))
    lone = one_of_each_marker(found.xy_img[kept], found.depth[kept], trend)
    if 2 * np.count_nonzero(~lone) > np.count_nonzero(lone):  # most have a ghost
        kept = kept[lone]
    kept = kept[belongs(found[kept], trend)]
    pins, others = found[kept], found[np.setdiff1d(np.arange(len(found)), kept)]
    return stack([pins, others[fills_gap(others, pins, trend)]])


def _common_radius(spots: Spots) -> float:
    """The radius of the spots that hold most light: mode over log radius, weighted with depth and radius."""
    log_r = np.log(spots.radius_px)
    weight = spots.depth * spots.radius_px
    kernel = np.exp(-0.5 * ((log_r[:, None] - log_r[None, :]) / 0.12) ** 2)
    return float(spots.radius_px[(kernel @ weight).argmax()])


def _centroids(grey: Image, spots: Spots, pattern: PinPattern) -> tuple[Pins, float]:
    """Centroids of the spots by the estimator of `centroids`, and how well a disc fits them (median).

    Spots without a disc are dropped.
    """
    n = len(spots)
    start = Pins(spots.xy_img, np.full(n, np.nan), spots.radius_px, spots.depth)
    if n == 0:
        return start, 0.0
    refiner = CentroidRefiner(Rest(start, pattern))
    found = refiner.refine(grey, spots.xy_img)
    fit = refiner.fit
    seen = ~np.isnan(found.xy_img[:, 0])
    seen[seen] = one_of_each(found.xy_img[seen], found.radius_px[seen], -fit[seen])
    return rows_of(found, seen), float(np.median(fit))
