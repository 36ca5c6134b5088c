"""The rest frame: the untouched tip, from several images; row i defines pin i from then on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

import numpy as np

from edge.errors import NoPins
from edge.pins.detect import as_bright, learn, noise_of, to_grey
from edge.pins.params import PARAMS
from edge.pins.refine import CentroidRefiner
from edge.types import Image, Pins, Polarity, Rest


def take_rest(images: Sequence[Image], polarity: Polarity = Polarity.FOUND) -> Rest:
    """The rest frame from one or more images of the untouched tip; row i defines pin i.

    Pins are found on the mean of the largest set of images among which nothing moves: in the mean of a moving
    tip pins are smeared. Dark first images, as cameras give, are not used.

    polarity  FOUND: as the first image that shows pins has them
    Raises    NoPins: no image, images of different size, or no pins in them
    """
    greys = [to_grey(image) for image in images]
    if not greys:
        raise NoPins("no image to take the rest frame from; give one or more of the untouched tip")
    if len({grey.shape for grey in greys}) > 1:
        raise NoPins("images of different size cannot make one rest frame; give images of one camera setting")
    start, first = _first_with_pins(greys, polarity)
    dark = first.pattern.dark
    greys = [as_bright(grey, dark) for grey in greys]
    if len(greys) > 1:
        as_seen = Rest(first.pins, replace(first.pattern, dark=False))
        greys = [greys[i] for i in _steady(greys, start, as_seen)]
    mean = np.zeros(greys[0].shape, np.float64)
    for grey in greys:
        mean += grey
    average = cast(Image, np.rint(mean / len(greys)).astype(greys[0].dtype))
    pattern, pins = learn(average, Polarity.BRIGHT)
    # The noise is that of a single image, like later frames, not that of the mean.
    pattern = replace(pattern, noise=float(np.median([noise_of(grey) for grey in greys])), dark=dark)
    order = np.lexsort((pins.xy_img[:, 0], np.rint(pins.xy_img[:, 1] / pattern.pitch_px)))
    pins = Pins(pins.xy_img[order], pins.sigma_px[order], pins.radius_px[order], pins.brightness[order])
    return Rest(pins, pattern)


def _steady(greys: Sequence[Image], start: int, rest: Rest) -> list[int]:
    """Indices of the largest set of images that show the pins in the same places; `rest` is of `start`."""
    refiner = CentroidRefiner(rest)
    xy = np.empty((len(greys), len(rest), 2))
    for way in (range(start, len(greys)), range(start - 1, -1, -1)):
        expected = rest.xy_img
        for k in way:
            xy[k] = refiner.refine(greys[k], expected).xy_img
            expected = np.where(np.isfinite(xy[k]), xy[k], expected)
    sigma = float(np.median(rest.pins.sigma_px))
    limit = PARAMS.steady_radii * rest.pattern.pin_radius_px + PARAMS.steady_sigmas * sigma
    away = np.full((len(greys), len(greys)), np.inf)
    for k in range(len(greys)):
        moved = np.hypot(*np.moveaxis(xy - xy[k], -1, 0))
        both = np.isfinite(moved)
        enough = both.mean(axis=1) > PARAMS.steady_share_min
        away[k, enough] = [np.quantile(m[b], 0.8) for m, b in zip(moved[enough], both[enough], strict=True)]
    near = away <= limit
    size = near.sum(axis=1)
    # Of sets of the same size the steadiest is taken; of equally steady ones the first.
    total = np.where(near, away, 0.0).sum(axis=1)
    middle = min(range(len(greys)), key=lambda k: (-size[k], total[k]))
    return np.flatnonzero(near[middle]).tolist()


def _first_with_pins(greys: Sequence[Image], polarity: Polarity) -> tuple[int, Rest]:
    """The first image that shows pins, and these; raises NoPins with the reason for the last one."""
    complaint = NoPins("")
    for k, grey in enumerate(greys):
        try:
            pattern, pins = learn(grey, polarity)
        except NoPins as error:
            complaint = error
        else:
            return k, Rest(pins, pattern)
    raise complaint
