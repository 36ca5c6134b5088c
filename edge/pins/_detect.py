"""All pins of a whole image, with no prior but (at most) how they look.

Idea
- Spots of all sizes are gathered (`_blobs`); the size that most of the light in spots has is the pins'. What
  does not fit its neighbours is thrown out, what fills a gap is taken in (`_pattern`).
- With a pattern at hand only its own size is looked for. Its absolute brightness is not used: light changes.
  Where pins are missing, those that the view's border cuts are found too (`_cut`); a rest frame has none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

import cv2
import numpy as np
from scipy.spatial import cKDTree

from edge.errors import NoPins
from edge.pins import _blobs, _pattern
from edge.pins._cut import find_cut
from edge.pins._refine import Refiner
from edge.types import Array, Image, Mask, PinPattern, Pins, Rest

# Radii looked at when nothing is known, px: from the smallest that has an inside to the largest of which a
# hundred fit the image. Steps of 1.3: each disc is seen at two scales at least.
_RADIUS_MIN_PX = 1.7
_RADIUS_STEP = 1.3
_RADIUS_MAX_OF_SIDE = 1 / 22
# What one scale sees well: radii within these factors of it.
_SCALE_RANGE = (0.7, 1.4)
_PINS_MIN = 12
# Scatter of size, depth and spacing among neighbours plus what the disc leaves unexplained. Real tips: 0.2
# (331 pins) to 1.1 (square grid through a fisheye, under glare); smoothed noise: 1.2 and more up to a
# scale of 6 px, some of it 1.1 at 8 to 10 px.
_UNLIKE_PINS_MAX = 1.15
# A spot's depth is a mean over tens of pixels: twice the noise of one pixel is a dozen of its own sigmas.
_DEPTH_OF_NOISE = 2.0
_DEPTH_OF_RANGE = 0.03  # of the image's own range: fainter spots are texture
_DEPTH_OF_PINS = 0.3  # of the pins' median depth
# Images of a tare are of one place where four of five pins moved less than this: a tenth of a radius widens
# the edge of a mean disc by less than 1 %; the sigmas are what noise does to such a difference (2.5 are
# expected).
_STEADY_RADII, _STEADY_SIGMAS = 0.1, 4.0
_STEADY_SHARE = 0.6  # of the pins that two images must share to be compared
# Two centroids nearer than this share of the sum of their radii are one pin, or a pin and its reflection.
# Pins in contact were never seen nearer than 2.2 radii.
_TWIN = 0.8


def learn_pattern(image: Image) -> PinPattern:
    """Size, pitch, circle, brightness and blur of the pins in one image of the untouched tip.

    image   (h, w) uint8 or uint16, or (h, w, 3) BGR
    Raises  NoPins: nothing in it looks like a tip's pins
    """
    return _learn(to_grey(image))[0]


def detect(image: Image, pattern: PinPattern | None = None) -> Pins:
    """All pins of the image, in no order.

    With a pattern an image without pins gives no rows. Without one the pattern is learnt from this very
    image, and NoPins is raised where there is none.
    """
    grey = to_grey(image)
    if pattern is None:
        return _learn(grey)[1]
    whole = _centroids(grey, _find(grey, pattern), pattern)[0]
    if len(whole) >= pattern.count:
        return whole
    cut = find_cut(grey, whole, pattern, pattern.count - len(whole))
    return Pins(
        np.concatenate([whole.xy_img, cut.xy_img]),
        np.concatenate([whole.sigma_px, cut.sigma_px]),
        np.concatenate([whole.radius_px, cut.radius_px]),
        np.concatenate([whole.brightness, cut.brightness]),
    )


def inspect_image(image: Image) -> Pins:
    """The pins of a single image of which nothing is known; raises NoPins where there are none."""
    return detect(image)


def take_rest(images: Sequence[Image]) -> Rest:
    """The rest frame from one or more images of the untouched tip; row i defines pin i.

    Pins are found on the mean of the largest set of images among which nothing moves: the mean of a moving
    tip has smeared pins as no image shows them. A dark first image, as cameras give, counts for nothing.

    Raises  NoPins: no image, images of different size, or no pins in them
    """
    greys = [to_grey(image) for image in images]
    if not greys:
        raise NoPins("no image to take the rest from; give one or more of the untouched tip")
    if len({grey.shape for grey in greys}) > 1:
        raise NoPins("images of different size cannot make one rest; give images of one camera setting")
    if len(greys) > 1:
        greys = [greys[i] for i in _steady(greys)]
    mean = np.zeros(greys[0].shape, np.float64)
    for grey in greys:
        mean += grey
    average = cast(Image, np.rint(mean / len(greys)).astype(greys[0].dtype))
    pattern, pins = _learn(average)
    # The noise is that of one image, as they will come, not that of the mean.
    pattern = replace(pattern, noise=float(np.median([noise_of(grey) for grey in greys])))
    order = np.lexsort((pins.xy_img[:, 0], np.rint(pins.xy_img[:, 1] / pattern.pitch_px)))
    pins = Pins(pins.xy_img[order], pins.sigma_px[order], pins.radius_px[order], pins.brightness[order])
    return Rest(pins, pattern)


def _steady(greys: Sequence[Image]) -> list[int]:
    """Indices of the largest set of images that show the pins in the same places.

    Raises  NoPins: no image shows any
    """
    start, rest = _first_with_pins(greys)
    refiner = Refiner(rest)
    xy = np.empty((len(greys), len(rest), 2))
    for way in (range(start, len(greys)), range(start - 1, -1, -1)):
        expected = rest.xy_img
        for k in way:
            xy[k] = refiner.refine(greys[k], expected).xy_img
            expected = np.where(np.isfinite(xy[k]), xy[k], expected)
    sigma = float(np.median(rest.pins.sigma_px))
    limit = _STEADY_RADII * rest.pattern.pin_radius_px + _STEADY_SIGMAS * sigma
    away = np.full((len(greys), len(greys)), np.inf)
    for k in range(len(greys)):
        moved = np.hypot(*np.moveaxis(xy - xy[k], -1, 0))
        both = np.isfinite(moved)
        enough = both.mean(axis=1) > _STEADY_SHARE
        away[k, enough] = [np.quantile(m[b], 0.8) for m, b in zip(moved[enough], both[enough], strict=True)]
    near = away <= limit
    size = near.sum(axis=1)
    # Of sets of the same size the one that is steadiest; all else equal the first.
    total = np.where(near, away, 0.0).sum(axis=1)
    middle = min(range(len(greys)), key=lambda k: (-size[k], total[k]))
    return np.flatnonzero(near[middle]).tolist()


def _first_with_pins(greys: Sequence[Image]) -> tuple[int, Rest]:
    """The first image that shows pins, and these; raises NoPins with what is wrong with the last one."""
    complaint = NoPins("")
    for k, grey in enumerate(greys):
        try:
            pattern, pins = _learn(grey)
        except NoPins as error:
            complaint = error
        else:
            return k, Rest(pins, pattern)
    raise complaint


def to_grey(image: Image) -> Image:
    """(h, w) uint8 or uint16, rows contiguous; colour (h, w, 3) is taken as BGR."""
    if image.ndim == 3:
        return to_grey(cast(Image, cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)))
    return cast(Image, np.ascontiguousarray(image))


def noise_of(grey: Image) -> float:
    """Standard deviation of the grey level from pixel to pixel, gradients removed; robust to edges."""
    # weights 1 1 -4 1 1 give sqrt(20) times the noise
    residual = cv2.Laplacian(grey.astype(np.float32), cv2.CV_32F)
    return float(np.median(np.abs(residual)) / 0.6745 / np.sqrt(20.0))


def _learn(grey: Image) -> tuple[PinPattern, Pins]:
    noise = noise_of(grey)
    low, high = np.percentile(grey[::4, ::4], (1.0, 99.0))
    depth_min = max(_DEPTH_OF_NOISE * noise, _DEPTH_OF_RANGE * float(high - low), 2.0)
    radius_max = max(3.0, _RADIUS_MAX_OF_SIDE * min(grey.shape))
    scales = _RADIUS_MIN_PX * _RADIUS_STEP ** np.arange(
        np.log(radius_max / _RADIUS_MIN_PX) / np.log(_RADIUS_STEP)
    )
    found = _at_scales(grey, scales, depth_min)
    spots = found[_well_shaped(found)]
    if len(spots) < _PINS_MIN:
        raise NoPins(_complaint(grey, f"{len(spots)} spots"))
    size = _common_radius(spots)
    core = np.median(spots.depth[np.abs(np.log(spots.radius_px / size)) < 0.2])
    spots = _settle(grey, found, size, _DEPTH_OF_PINS * float(core))
    if len(spots) < _PINS_MIN:
        raise NoPins(_complaint(grey, f"{len(spots)} spots alike"))
    (x, y), reach = cv2.minEnclosingCircle(spots.xy_img.astype(np.float32))
    radius_px, brightness = float(np.median(spots.radius_px)), float(np.median(spots.depth))
    at = np.rint(spots.xy_img).astype(np.intp)
    background = float(np.median(grey[at[:, 1], at[:, 0]] - spots.depth))
    pattern = PinPattern(
        pin_radius_px=radius_px,
        pitch_px=_pattern.pitch_of(spots.xy_img),
        centre_img=np.array([x, y]),
        tip_radius_px=float(reach) + radius_px,
        background=max(background, 0.0),
        brightness=brightness,
        noise=noise,
        size_px=(grey.shape[1], grey.shape[0]),
        edge_px=_blobs.measure_discs(grey, spots)[1],
        radius_range_px=(
            float(np.quantile(spots.radius_px, 0.02)),
            float(np.quantile(spots.radius_px, 0.98)),
        ),
    )
    spots = _find(grey, pattern)
    if len(spots) >= _PINS_MIN:
        pins, fit = _centroids(grey, spots, pattern)
        if len(pins) >= _PINS_MIN and _pattern.unevenness(spots) + 1.0 - fit < _UNLIKE_PINS_MAX:
            at_rest = replace(pattern, count=len(pins))
            glints = find_cut(grey, pins, at_rest, len(pins)).xy_img
            return replace(at_rest, glints_img=tuple((float(x), float(y)) for x, y in glints)), pins
    raise NoPins(_complaint(grey, "spots, but neither round nor even"))


def _find(grey: Image, pattern: PinPattern) -> _blobs.Spots:
    small, large = pattern.radius_range_px
    if small <= 0.0:
        small = large = pattern.pin_radius_px
    count = max(1, int(np.ceil(np.log(large / small) / np.log(_SCALE_RANGE[1] / _SCALE_RANGE[0]))))
    scales = small * (large / small) ** ((np.arange(count) + 0.5) / count)
    found = _at_scales(grey, scales, max(_DEPTH_OF_NOISE * pattern.noise, 0.15 * pattern.brightness))
    found = found[np.hypot(*(found.xy_img - pattern.centre_img).T) < 1.1 * pattern.tip_radius_px]
    spots = found[_well_shaped(found)]
    if len(spots) == 0:
        return spots
    return _settle(grey, found, pattern.pin_radius_px, _DEPTH_OF_PINS * float(np.median(spots.depth)))


def _at_scales(grey: Image, scales: Array, depth_min: float) -> _blobs.Spots:
    """Spots of all scales, each once, at the scale that suits it best."""
    parts, misfits = [], []
    for radius in scales:
        spots = _blobs.find_spots(grey, float(radius), depth_min)
        scale = spots.radius_px / radius
        fits = (scale > _SCALE_RANGE[0]) & (scale < _SCALE_RANGE[1])
        fits &= (spots.share >= _pattern.GAP_SHARE_MIN) & (spots.spread < _pattern.GAP_SPREAD_MAX)
        parts.append(spots[fits])
        misfits.append((np.abs(np.log(scale)) + spots.spread + (1.0 - spots.share))[fits])
    return _pattern.one_of_each(_blobs.join(parts), np.concatenate(misfits))


def _well_shaped(spots: _blobs.Spots) -> Mask:
    shape: Mask = (spots.share >= _pattern.SHARE_MIN) & (spots.spread < _pattern.SPREAD_MAX)
    return shape


def _settle(grey: Image, found: _blobs.Spots, radius_px: float, depth_min: float) -> _blobs.Spots:
    """Of all spots found the pins: about the given size, fitting each other; then what fills their gaps."""
    scale = found.radius_px / radius_px
    found = found[(found.depth > depth_min) & (scale > 0.45) & (scale < 2.0)]
    if len(found) == 0:
        return found
    found = replace(found, radius_px=_blobs.measure_discs(grey, found)[0])
    good = _well_shaped(found)
    kept = np.flatnonzero(good)
    kept = kept[_pattern.belongs(found[kept])]
    pins, others = found[kept], found[np.setdiff1d(np.arange(len(found)), kept)]
    return _blobs.join([pins, others[_pattern.fills_gap(others, pins)]])


def _common_radius(spots: _blobs.Spots) -> float:
    """The radius that most light in spots has: mode over log radius, weighted with depth and radius."""
    log_r = np.log(spots.radius_px)
    weight = spots.depth * spots.radius_px
    kernel = np.exp(-0.5 * ((log_r[:, None] - log_r[None, :]) / 0.12) ** 2)
    return float(spots.radius_px[(kernel @ weight).argmax()])


def _centroids(grey: Image, spots: _blobs.Spots, pattern: PinPattern) -> tuple[Pins, float]:
    """The same estimator as in flight, started on the spots, and how well a disc fits them (median).

    What it finds no disc in is no pin.
    """
    n = len(spots)
    start = Pins(spots.xy_img, np.full(n, np.nan), spots.radius_px, spots.depth)
    if n == 0:
        return start, 0.0
    refiner = Refiner(Rest(start, pattern))
    found = refiner.refine(grey, spots.xy_img)
    fit = refiner.fit
    seen = ~np.isnan(found.xy_img[:, 0])
    seen[_twins(found, np.where(seen, fit, -np.inf))] = False
    pins = Pins(found.xy_img[seen], found.sigma_px[seen], found.radius_px[seen], found.brightness[seen])
    return pins, float(np.median(fit))


def _twins(pins: Pins, fit: Array) -> Mask:
    """(n,) of pins that stand in one another all but the one that a disc fits best."""
    twin = np.zeros(len(pins), bool)
    there = np.flatnonzero(np.isfinite(pins.xy_img[:, 0]))
    xy, radius = pins.xy_img[there], pins.radius_px[there]
    if len(there) < 2:
        return twin
    a, b = cKDTree(xy).query_pairs(2 * _TWIN * float(radius.max()), output_type="ndarray").T
    close = np.hypot(*(xy[a] - xy[b]).T) < _TWIN * (radius[a] + radius[b])
    for i, j in zip(there[a[close]], there[b[close]], strict=True):
        if not (twin[i] or twin[j]):
            twin[j if fit[i] >= fit[j] else i] = True
    return twin


def _complaint(grey: Image, found: str) -> str:
    low, high = float(grey.min()), float(grey.max())
    return (
        f"no pattern of pins in the image: {found}, grey levels {low:g} to {high:g}; "
        "an image of the tip in focus with its light on would show a dozen or more"
    )
