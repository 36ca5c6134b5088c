"""All pins of a whole image, with no prior but (at most) how they look."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from edge.errors import NoPins
from edge.pins import _blobs, _pattern
from edge.pins._refine import Refiner
from edge.types import Image, PinPattern, Pins, Rest

# Radii looked at when nothing is known, px: from the smallest that has an inside to the largest of which a
# hundred fit the image. Steps of 1.3: each disc is seen at two scales at least.
_RADIUS_MIN_PX = 1.7
_RADIUS_STEP = 1.3
_RADIUS_MAX_OF_SIDE = 1 / 22
_PINS_MIN = 12
_NOISE_SIGMAS = 6.0
_DEPTH_FLOOR_OF_RANGE = 0.03  # of the image's own range: fainter spots are texture


def learn_pattern(image: Image) -> PinPattern:
    """Radius, pitch, circle and brightness of the pins in one image of the untouched tip."""
    return _learn(to_grey(image))[0]


def detect(image: Image, pattern: PinPattern | None = None) -> Pins:
    """All pins of the image, in no order. Without a pattern it is learnt from this very image."""
    grey = to_grey(image)
    if pattern is None:
        pattern, spots = _learn(grey)
    spots = _find(grey, pattern)
    return _centroids(grey, spots, pattern)


def take_rest(images: Sequence[Image]) -> Rest:
    """Several images of the untouched tip make its rest: what stands in most of them, averaged."""
    greys = [to_grey(image) for image in images]
    if not greys:
        raise NoPins("no image given to take the rest from; give one or more of the untouched tip")
    mean = np.zeros(greys[0].shape, np.float64)
    for grey in greys:
        mean += grey
    mean /= len(greys)
    average = np.rint(mean).astype(greys[0].dtype)
    pattern, _ = _learn(average)
    return Rest(_centroids(average, _find(average, pattern), pattern), pattern)


def inspect_image(image: Image) -> Pins:
    """The pins of a single image of which nothing is known; raises NoPins where there are none."""
    return detect(image)


def to_grey(image: Image) -> Image:
    """(h, w) uint8 or uint16, rows contiguous; colour (h, w, 3) is taken as BGR."""
    if image.ndim == 3:
        image = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    return np.ascontiguousarray(image)


def noise_of(grey: Image) -> float:
    """Standard deviation of the grey level from pixel to pixel, gradients removed; robust to edges."""
    residual = cv2.Laplacian(
        grey.astype(np.float32), cv2.CV_32F
    )  # weights 1 1 -4 1 1: sqrt(20) times the noise
    return float(np.median(np.abs(residual)) / 0.6745 / np.sqrt(20.0))


def _learn(grey: Image) -> tuple[PinPattern, _blobs.Spots]:
    low, high = np.percentile(grey[::4, ::4], (1.0, 99.0))
    noise = noise_of(grey)
    depth_min = max(_NOISE_SIGMAS * noise / 3.0, _DEPTH_FLOOR_OF_RANGE * float(high - low), 4.0)
    parts, misfits = [], []
    radius = _RADIUS_MIN_PX
    while radius < max(3.0, _RADIUS_MAX_OF_SIDE * min(grey.shape)):
        spots = _blobs.find_spots(grey, radius, depth_min)
        scale = spots.radius_px / radius
        good = (spots.share >= _pattern.SHARE_MIN) & (spots.spread < _pattern.SPREAD_MAX)
        good &= (scale > 0.7) & (scale < 1.4)
        parts.append(spots[good])
        misfits.append((np.abs(np.log(scale)) + spots.spread)[good])
        radius *= _RADIUS_STEP
    spots = _pattern.one_of_each(_blobs.join(parts), np.concatenate(misfits))
    if len(spots) < _PINS_MIN:
        raise NoPins(_complaint(grey, len(spots)))
    size = _common_radius(spots)
    alike = (spots.radius_px > 0.55 * size) & (spots.radius_px < 1.8 * size)
    alike &= spots.depth > _pattern.DEPTH_MIN * np.median(
        spots.depth[np.abs(np.log(spots.radius_px / size)) < 0.2]
    )
    spots = spots[alike]
    if len(spots) >= _PINS_MIN:
        spots = spots[_pattern.belongs(spots, _pattern.pitch_of(spots.xy_img))]
    if len(spots) < _PINS_MIN:
        raise NoPins(_complaint(grey, len(spots)))
    radius, edge_px = _blobs.measure_discs(grey, spots)
    spots = replace(spots, radius_px=radius)
    (x, y), reach = cv2.minEnclosingCircle(spots.xy_img.astype(np.float32))
    radius_px = float(np.median(spots.radius_px))
    brightness = float(np.median(spots.depth))
    at = np.rint(spots.xy_img).astype(np.intp)
    background = float(np.median(grey[at[:, 1], at[:, 0]].astype(np.float64) - spots.depth))
    pattern = PinPattern(
        pin_radius_px=radius_px,
        pitch_px=_pattern.pitch_of(spots.xy_img),
        centre_img=np.array([x, y]),
        tip_radius_px=float(reach) + radius_px,
        background=max(background, 0.0),
        brightness=brightness,
        noise=noise,
        size_px=(grey.shape[1], grey.shape[0]),
        edge_px=edge_px,
    )
    return pattern, spots


def _common_radius(spots: _blobs.Spots) -> float:
    """The radius that most of the light in spots has: mode over log radius, weighted with depth and radius."""
    log_r = np.log(spots.radius_px)
    weight = spots.depth * spots.radius_px
    kernel = np.exp(-0.5 * ((log_r[:, None] - log_r[None, :]) / 0.12) ** 2)
    return float(spots.radius_px[(kernel @ weight).argmax()])


def _find(grey: Image, pattern: PinPattern) -> _blobs.Spots:
    radius = pattern.pin_radius_px
    depth_min = max(_NOISE_SIGMAS * pattern.noise / 3.0, 0.15 * pattern.brightness)
    spots = _blobs.find_spots(grey, radius, depth_min)
    scale = spots.radius_px / radius
    good = (spots.share >= _pattern.SHARE_MIN) & (spots.spread < _pattern.SPREAD_MAX)
    good &= (scale > 0.55) & (scale < 1.8)
    good &= np.hypot(*(spots.xy_img - pattern.centre_img).T) < 1.1 * pattern.tip_radius_px
    spots, scale = spots[good], scale[good]
    spots = _pattern.one_of_each(spots, np.abs(np.log(scale)) + spots.spread)
    spots = spots[_pattern.belongs(spots, pattern.pitch_px)]
    return replace(spots, radius_px=_blobs.measure_discs(grey, spots)[0]) if len(spots) else spots


def _centroids(grey: Image, spots: _blobs.Spots, pattern: PinPattern) -> Pins:
    """The same estimator as in flight, started on the spots; where it finds none the spot itself stands."""
    n = len(spots)
    start = Pins(spots.xy_img, np.full(n, np.nan), spots.radius_px, spots.depth)
    if n == 0:
        return start
    found = Refiner(Rest(start, pattern)).refine(grey, spots.xy_img)
    lost = np.isnan(found.xy_img[:, 0])
    return Pins(
        np.where(lost[:, None], spots.xy_img, found.xy_img),
        np.where(lost, spots.radius_px / 4.0, found.sigma_px),
        spots.radius_px,
        np.where(lost, spots.depth, found.brightness),
    )


def _complaint(grey: Image, n: int) -> str:
    low, high = float(grey.min()), float(grey.max())
    return (
        f"no pattern of pins in the image: {n} spots alike, grey levels {low:g} to {high:g}; "
        "an image of the tip in focus, with its light on, would show a dozen or more"
    )
