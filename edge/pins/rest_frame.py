"""The rest frame: the untouched tip, from several images; row i defines pin i from then on."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TypeVar, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from edge.errors import NoPins
from edge.geometry.lattice import pitch_of
from edge.geometry.layout import circle_of
from edge.geometry.neighbours import nearest_of
from edge.geometry.parts import of_parts, rows_of, stack
from edge.pins.detect import as_bright, detect, in_view, learn, noise_of, spots_of, to_grey
from edge.pins.lens import corrected_rest, pattern_as_seen
from edge.pins.params import PARAMS
from edge.pins.pattern import FLAT, one_of_each_marker, trend_of
from edge.pins.refine import CentroidRefiner
from edge.types import Image, Lens, PinPattern, Pins, Polarity, Region, Rest

T = TypeVar("T")


def take_rest(
    images: Sequence[Image],
    polarity: Polarity = Polarity.FOUND,
    lens: Lens | None = None,
    region: Region | None = None,
    like: PinPattern | None = None,
) -> Rest:
    """The rest frame from one or more images of the untouched tip; row i defines pin i.

    Pins are found on the mean of the largest set of images among which nothing moves: in the mean of a moving
    tip pins are smeared. What at least half of those images show as a pin each for itself is one too. Dark
    first images, as cameras give, are not used.

    polarity  FOUND: as the first image that shows pins has them
    lens      whose distortion is removed from the pins' places
    region    that the images show; of several parts each is taken by itself
    like      of an earlier rest frame of this tip, of the same polarity: `learn`
    Raises    NoPins: no image, images of different size or another than the lens's, no pins in them, or
              all pins on one line
    """
    greys = [to_grey(image) for image in images]
    if not greys:
        raise NoPins("no image to take the rest frame from; give one or more of the untouched tip")
    if len({grey.shape for grey in greys}) > 1:
        raise NoPins("images of different size cannot make one rest frame; give images of one camera setting")
    if region is not None and region.views:
        return _of_views(greys, polarity, lens, region.views)
    dark, greys, rest = _at_rest(greys, polarity, like) or _at_rest_in_some(greys, polarity)
    pattern, pins = with_voted(greys, rest.pattern, rest.pins)
    trend = trend_of(pins.xy_img, pins.radius_px, pins.brightness, pattern.pin_radius_px)
    weight = pins.brightness * pins.radius_px**2
    lone = one_of_each_marker(pins.xy_img, weight, trend if trend.explains else FLAT)
    if not lone.all():
        pins = rows_of(pins, lone)
        pattern = replace(pattern, count=len(pins), pitch_px=pitch_of(pins.xy_img))
    # The noise is that of a single image, like later frames, not that of the mean.
    pattern = replace(pattern, noise=float(np.median([noise_of(grey) for grey in greys])), dark=dark)
    order = np.lexsort((pins.xy_img[:, 0], np.rint(pins.xy_img[:, 1] / pattern.pitch_px)))
    rest = Rest(rows_of(pins, order), pattern)
    away = rest.xy_img - rest.xy_img.mean(axis=0)
    across = np.ptp(away @ np.linalg.svd(away, full_matrices=False)[2][1])
    if across < pattern.pin_radius_px:
        raise NoPins(f"{len(rest)} pins are found, all on one line; pins that span a plane are needed")
    return rest if lens is None else corrected_rest(rest, lens)


def _of_views(
    greys: Sequence[Image], polarity: Polarity, lens: Lens | None, views: Sequence[NDArray[np.int16]]
) -> Rest:
    """The rest frame of a skin in several parts, each by itself: mirrors show pins of other sizes in other
    light. A part in which none are found has none. Raises NoPins: no part has any.
    """
    found: list[tuple[Sequence[Image], Rest]] = []
    complaint = ""
    for nearest_px in views:
        own = [grey[nearest_px[..., 1], nearest_px[..., 0]] for grey in greys]
        try:
            found.append((own, take_rest(own, polarity, lens)))
        except NoPins as error:
            complaint = str(error)
    if not found:
        raise NoPins(f"none of {len(views)} parts of the region shows pins; the last one: {complaint}")
    pattern = max((rest for _, rest in found), key=len).pattern
    rests: list[Rest] = []
    for seen, rest in found:
        rests.append(rest)
        if rest.pattern.dark != pattern.dark:  # gaps between pins may look like pins: the others decide
            with suppress(NoPins):
                rests[-1] = take_rest(seen, Polarity.DARK if pattern.dark else Polarity.BRIGHT, lens)
    if len(rests) == 1:
        return rests[0]
    small, large = np.array([rest.pattern.radius_range_px for rest in rests]).T
    return of_parts(rests, replace(pattern, radius_range_px=(float(small.min()), float(large.max()))))


def _at_rest(
    greys: list[Image], polarity: Polarity, like: PinPattern | None
) -> tuple[bool, list[Image], Rest] | None:
    """A still tip: whether its pins are dark, images with bright ones, pins of their mean; None: it moves."""
    bright = None if like is None else replace(pattern_as_seen(like), dark=False)
    dark = polarity is Polarity.DARK
    try:
        if not dark:
            pattern, pins = learn(_mean(greys), polarity, bright)
            dark = pattern.dark
        if dark:  # the mean of inverted images is rounded otherwise than the inverse of their mean
            greys = [as_bright(grey, dark) for grey in greys]
            pattern, pins = learn(_mean(greys), Polarity.BRIGHT, bright)
    except NoPins:
        return None
    rest = Rest(pins, replace(pattern, dark=False))
    return (dark, greys, rest) if len(_steady(greys, 0, rest)) == len(greys) else None


def _at_rest_in_some(greys: Sequence[Image], polarity: Polarity) -> tuple[bool, list[Image], Rest]:
    """The same of the largest set of images in which nothing moves. Raises NoPins."""
    start, (pattern, pins) = first_with_pins(greys, lambda grey: learn(grey, polarity))
    dark = pattern.dark
    greys = [as_bright(grey, dark) for grey in greys]
    greys = [greys[i] for i in _steady(greys, start, Rest(pins, replace(pattern, dark=False)))]
    pattern, pins = learn(_mean(greys), Polarity.BRIGHT)
    return dark, greys, Rest(pins, pattern)


def _mean(greys: Sequence[Image]) -> Image:
    total = np.zeros(greys[0].shape, np.float64)
    for grey in greys:
        cv2.accumulate(grey, total)
    return cast(Image, np.rint(total / len(greys)).astype(greys[0].dtype))


def with_voted(greys: Sequence[Image], pattern: PinPattern, pins: Pins) -> tuple[PinPattern, Pins]:
    """Pattern and pins with those that at least half of the images show, though their mean does not.

    Whether a pin at the edge of a gap still belongs to the pattern may hang on a little noise.
    """
    if len(greys) < 2:
        return pattern, pins
    reach_px = pattern.tip_radius_px + PARAMS.link_pitches_outside * pattern.pitch_px
    wider = replace(pattern, tip_radius_px=reach_px, count=0)
    near_px = 0.5 * pattern.pitch_px
    # A pin that half of the images show is at least a spot in their mean.
    spots = spots_of(_mean(greys), wider)
    if np.all(nearest_of(pins.xy_img, spots.xy_img)[0] <= near_px):
        return pattern, pins
    shown: list[Pins] = []
    with_more_n = 0
    for grey in greys:
        shown.append(in_view(detect(grey, wider), pattern.size_px))
        with_more_n += bool(np.any(nearest_of(pins.xy_img, shown[-1].xy_img)[0][:, 0] > near_px))
        if 2 * (with_more_n + len(greys) - len(shown)) < len(greys):  # no other pin can be in half of them
            return pattern, pins
    together = stack(shown)
    xy = together.xy_img
    which = np.repeat(np.arange(len(shown)), [len(one) for one in shown])
    free = nearest_of(pins.xy_img, xy)[0][:, 0] > near_px
    added = [pins]
    for i in np.flatnonzero(free):
        same = free & (np.hypot(*(xy - xy[i]).T) < near_px)
        if 2 * len(np.unique(which[same])) >= len(greys):
            free &= ~same
            one = rows_of(together, same)
            columns = (one.xy_img, one.sigma_px, one.radius_px, one.brightness)
            added.append(Pins(*(np.median(column, axis=0, keepdims=True) for column in columns)))
    if len(added) == 1:
        return pattern, pins
    pins = stack(added)
    centre_img, tip_radius_px = circle_of(pins.xy_img, pattern.pin_radius_px)
    return replace(pattern, count=len(pins), centre_img=centre_img, tip_radius_px=tip_radius_px), pins


def _steady(greys: Sequence[Image], start: int, rest: Rest) -> list[int]:
    """Indices of the largest set of images that show the pins in the same places; `rest` is of `start`."""
    refiner = CentroidRefiner(rest)
    xy, sigma = np.empty((len(greys), len(rest), 2)), np.empty((len(greys), len(rest)))
    for way in (range(start, len(greys)), range(start - 1, -1, -1)):
        expected = rest.xy_img
        for k in way:
            pins = refiner.refine(greys[k], expected)
            xy[k], sigma[k] = pins.xy_img, pins.sigma_px
            expected = np.where(np.isfinite(xy[k]), xy[k], expected)
    most = 0.8  # of the pins
    # This share of the pins that did not move are apart by less in two images: noise alone.
    apart = 2.0 * float(np.sqrt(-np.log(1.0 - most)) * np.median(sigma[np.isfinite(sigma)]))
    limit = PARAMS.steady_radii * rest.pattern.pin_radius_px + apart
    away = np.full((len(greys), len(greys)), np.inf)
    for k in range(len(greys)):
        moved = np.hypot(*np.moveaxis(xy - xy[k], -1, 0))
        both = np.isfinite(moved)
        enough = both.any(axis=1)
        away[k, enough] = [np.quantile(m[b], most) for m, b in zip(moved[enough], both[enough], strict=True)]
    near = away <= limit
    size = near.sum(axis=1)
    # The steadiest of the sets of one size is taken; of equally steady ones the first.
    total = np.where(near, away, 0.0).sum(axis=1)
    middle = min(range(len(greys)), key=lambda k: (-size[k], total[k]))
    return np.flatnonzero(near[middle]).tolist()


def first_with_pins(images: Sequence[Image], read: Callable[[Image], T]) -> tuple[int, T]:
    """The first image that shows pins, and what is read of it; raises NoPins with the reason for the last."""
    complaint = NoPins("no images; give a recording with images of the tip")
    for k, image in enumerate(images):
        try:
            return k, read(image)
        except NoPins as error:
            complaint = error
    raise complaint
