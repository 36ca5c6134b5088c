"""Bright round spots of about a given radius, wherever they are and however bright the surroundings.

Idea
- A spot is a local maximum of a difference of Gaussians at the pin's scale. That finds every pin, and also
  much that is none: rims, glare, texture.
- A ray profile decides what a spot is. A pin falls to half its height on nearly every ray, at nearly the same
  distance; a rim or a streak of glare stays bright along two opposite bundles of rays, a step along half of
  them, and texture falls at any distance. All levels are relative to the spot's own surroundings, so
  vignetting, gain and a rim brighter than the pins do not matter.

Rules
- Works on a reduced image in which a pin's radius is 2.5 to 5 px: the cost does not grow with the pins' size.
- Positions here are good to half a pixel; the window centroid makes them subpixel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from edge.geometry.parts import rows_of
from edge.limits import PINS_MAX
from edge.pins.params import PARAMS
from edge.types import Array, Image, Mask

#: There is one for each pixel round the smallest pin in the reduced image.
RAYS = round(math.tau * PARAMS.reduced_radius_px)
# Distances along a ray, in radii.
STEPS = PARAMS.ray_step_radii * np.arange(PARAMS.ray_steps_n)

_ANGLES = 2.0 * np.pi * np.arange(RAYS) / RAYS
_COS = np.cos(_ANGLES)[None, :, None]
_SIN = np.sin(_ANGLES)[None, :, None]

Places = NDArray[np.intp]
Levels = NDArray[Any]  # grey levels, float32 or float64


@dataclass(frozen=True, slots=True)
class Spots:
    """Local maxima at one scale, and their profiles along rays.

    xy_img     (n, 2) float64 px
    depth      (n,) grey levels from the spot's middle down to its surroundings (median over rays)
    share      (n,) share of the rays that fall by half of `depth`
    radius_px  (n,) median distance of the half fall
    spread     (n,) 20..80 percentile range of that distance over its median; 0 for a perfect disc
    """

    xy_img: Array
    depth: Array
    share: Array
    radius_px: Array
    spread: Array

    def __len__(self) -> int:
        return len(self.xy_img)

    def __getitem__(self, which: Mask | Places) -> Spots:
        return rows_of(self, which)


def find_spots(image: Image, radius_px: float, depth_min: float) -> Spots:
    """All local maxima at the scale of `radius_px` that stand out by `depth_min` grey levels or more."""
    k = max(1, int(radius_px // PARAMS.reduced_radius_px))
    grey: Levels = image.astype(np.float32)
    if k > 1:
        h, w = image.shape[0] // k, image.shape[1] // k
        grey = cv2.resize(grey[: h * k, : w * k], (w, h), interpolation=cv2.INTER_AREA)
    r = radius_px / k
    margin = int(np.ceil(1.5 * r))
    grey = _with_margin(grey, margin, int(np.ceil(STEPS[-1] * r)))
    s = r / np.sqrt(2.0)  # at this sigma the Laplacian of Gaussian responds best to a disc of radius r
    fine = cv2.GaussianBlur(grey, (0, 0), 0.7 * s)
    band = fine - cv2.GaussianBlur(grey, (0, 0), 1.25 * s)
    size = 2 * max(1, int(0.7 * r)) + 1
    top = cv2.dilate(band, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size)))
    # A disc of contrast c gives a response of 0.16..0.38 c at this pair of sigmas, for radii 0.5..1.7 of the
    # scale.
    inside = np.s_[margin:-margin, margin:-margin]
    ys, xs = np.nonzero((band[inside] >= top[inside]) & (band[inside] > 0.1 * depth_min))
    ys, xs = ys + margin, xs + margin
    if len(xs) > PINS_MAX:
        best = np.argpartition(band[ys, xs], -PINS_MAX)[-PINS_MAX:]
        ys, xs = ys[best], xs[best]
    spots = _measure(_rays(grey, r, xs, ys), r)
    xy = (np.stack([xs, ys], axis=1) - margin + 0.5) * k - 0.5
    found = Spots(xy.astype(np.float64), spots[0], spots[1], spots[2] * k, spots[3])
    return found[found.depth >= depth_min]


def _with_margin(grey: Levels, margin: int, reach: int) -> Levels:
    """The image with a margin as dark as the skin beside it: a pin that the border cuts falls on all sides.

    reach  px, from a pin's middle to the skin round it
    """
    skin = cv2.erode(grey, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
    out: Levels = cv2.copyMakeBorder(skin, margin, margin, margin, margin, cv2.BORDER_REPLICATE)
    out[margin:-margin, margin:-margin] = grey
    return out


def measure_discs(image: Image, spots: Spots) -> tuple[Array, float]:
    """Radius of each spot (n,) and the blur of the pins' edge (median), px, from the profile round it.

    The profile of a disc of radius r blurred by s falls through half its height at r, as an error function.
    """
    step = 0.5
    reach = np.arange(0.0, 2.0 * float(np.median(spots.radius_px)) + 2.0, step)
    x, y = spots.xy_img.T
    profile = np.median(_along_rays(image.astype(np.float32), x, y, reach), axis=1)
    near = reach < np.maximum(0.6 * spots.radius_px, 1.0)[:, None]
    top = (profile * near).sum(axis=1) / near.sum(axis=1)
    bottom = np.minimum.accumulate(profile, axis=1)
    outside = np.minimum((1.8 * spots.radius_px / step).astype(np.intp) + 1, len(reach) - 1)
    floor = np.take_along_axis(bottom, outside[:, None], axis=1)
    level = (bottom - floor) / np.maximum(top[:, None] - floor, 1e-6)
    radius = _crossing(level, 0.5) * step
    # between 0.8 and 0.2 of its height a Gaussian edge is 1.683 sigma wide
    edge = (_crossing(level, 0.2) - _crossing(level, 0.8)) * step / 1.683
    good = (radius > 0.5 * spots.radius_px) & (radius < 1.5 * spots.radius_px)
    edge_px = np.clip(np.median(edge), 0.35, max(0.35, np.median(radius) / 2))
    return np.where(good, radius, spots.radius_px), float(edge_px)


def _crossing(profile: Levels, height: float | Levels) -> Array:
    """First index, between samples, at which each falling row (the last axis) goes below `height`."""
    after = np.maximum((profile < height).argmax(axis=-1, keepdims=True), 1)
    a, b = (np.take_along_axis(profile, at, axis=-1) for at in (after - 1, after))
    return np.asarray(after - 1 + np.clip((a - height) / np.maximum(a - b, 1e-6), 0.0, 1.0))[..., 0]


def _rays(grey: Levels, r: float, xs: Places, ys: Places) -> Levels:
    """(n, RAYS, STEPS) grey levels along the rays, noise smoothed at a third of the radius."""
    if len(xs) == 0:
        return np.empty((0, RAYS, len(STEPS)), np.float32)
    return _along_rays(cv2.GaussianBlur(grey, (0, 0), max(0.3 * r, 0.6)), xs, ys, STEPS * r)


def _along_rays(grey: Levels, x: Array | Places, y: Array | Places, reach: Levels) -> Levels:
    """(n, RAYS, k) grey levels of an image at the distances `reach` (k,) px from places x, y (n,)."""
    map_x = (x[:, None, None] + reach * _COS).astype(np.float32).reshape(len(x), -1)
    map_y = (y[:, None, None] + reach * _SIN).astype(np.float32).reshape(len(x), -1)
    level: Levels = cv2.remap(grey, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return level.reshape(len(x), RAYS, len(reach))


def _measure(level: Levels, r: float) -> tuple[Array, Array, Array, Array]:
    """Depth, share, radius and spread of each spot from its rays."""
    step = (STEPS[1] - STEPS[0]) * r
    middle = level[:, :, :2].mean(axis=(1, 2))
    fall = middle[:, None] - level[:, :, 2:].min(axis=2)
    depth = _quantile(fall, 0.5)
    half = (middle - 0.5 * depth)[:, None, None]
    share: Array = (fall > 0.5 * depth[:, None]).mean(axis=1)
    reached = (level < half).any(axis=2)
    distance = np.where(reached, _crossing(level, half) * step, (STEPS[-1] + 0.25) * r)
    radius = np.maximum(_quantile(distance, 0.5), 1e-6)
    spread = (_quantile(distance, 0.8) - _quantile(distance, 0.2)) / radius
    return depth.astype(np.float64), share, radius.astype(np.float64), spread.astype(np.float64)


def _quantile(values: Levels, q: float) -> Levels:
    """Quantile along axis 1 without interpolation; far cheaper than numpy's on short rows."""
    k = round(q * (values.shape[1] - 1))
    return np.partition(values, k, axis=1)[:, k]
