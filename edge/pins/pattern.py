"""Tells a pattern of pins from other spots: neighbours of the same size and brightness at an even pitch.

Rules
- A spot is compared with its neighbours, not with the whole: a fisheye or a tilted tip shows pins of very
  different size, vignetting of very different brightness, but never a small one among large ones. Where size
  changes steeply, as along a tube, spots are compared after their trend over the picture is removed.
- How much neighbours may differ is learnt from the image: little on an even tip, more on an uneven one.
- Pins are connected: a spot that no chain of neighbours reaches is outside of the skin.
- A gap inside the pattern may be filled with a spot of poor shape: a pin that merges with a reflection, or
  with another pin, is still a pin.
"""

from dataclasses import dataclass

import numpy as np

from edge.geometry.lattice import N_RING, groups_of, inside_hull, pitch_of
from edge.geometry.lattice import PARAMS as LATTICE
from edge.geometry.neighbours import nearest_of, pairs_within
from edge.geometry.select import SIGMA_OF_MAD
from edge.params import PARAMS as RUNTIME
from edge.pins.blobs import Spots
from edge.pins.params import PARAMS
from edge.types import Array, Index, Mask


@dataclass(frozen=True, slots=True)
class Trend:
    """How size, depth and spacing follow the place: each the exponential of a polynomial in x and y.

    The fourth power of the distance lets it follow a tube, along which the camera looks, to its rim.

    origin (2,), unit_px  px, of x and y
    weights               (7, 3) of the terms 1, x, y, x x, x y, y y, (x x + y y)^2
    explains              most of the variance of the size; where it does not, pins are alike everywhere
    """

    origin: Array
    unit_px: float
    weights: Array
    explains: bool

    def at(self, xy_img: Array) -> Array:
        """(3, n) factors of size, depth and spacing."""
        exponent = _terms((xy_img - self.origin) / self.unit_px) @ self.weights
        most = np.log(np.finfo(np.float32).max)  # so far from all pins that nothing fits there
        return np.asarray(np.exp(np.clip(exponent, -most, most)).T)


#: Size, depth and spacing are the same everywhere.
FLAT = Trend(np.zeros(2), 1.0, np.zeros((7, 3)), explains=False)


def _terms(xy: Array) -> Array:
    x, y = xy.T
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y, (x * x + y * y) ** 2], axis=1)


def one_of_each(xy_img: Array, reach_px: Array, misfit: Array) -> Mask:
    """(n,) of places (n, 2) that one within its own reach (n,) stands for, the one with the least misfit."""
    if len(xy_img) < 2:
        return np.ones(len(xy_img), bool)
    pairs = pairs_within(xy_img, float(reach_px.max()))
    first, second = np.vstack([pairs, pairs[:, ::-1]]).T
    near = np.hypot(*(xy_img[first] - xy_img[second]).T) <= reach_px[first]
    order = np.argsort(first[near], kind="stable")
    second = second[near][order]
    begin = np.searchsorted(first[near][order], np.arange(len(xy_img) + 1))
    dead = np.zeros(len(xy_img), bool)
    keep = np.zeros(len(xy_img), bool)
    for i in np.argsort(misfit):
        if not dead[i]:
            keep[i] = True
            dead[second[begin[i] : begin[i + 1]]] = True
    return keep


def one_of_each_marker(xy_img: Array, weight: Array, trend: Trend) -> Mask:
    """(n,) of places (n, 2) without the one of less weight (n,) of two nearer than half the local pitch.

    Two such are lobes of one marker, a ghost or the parts beside a glint. The local pitch is the distance to
    the second nearest, a median over the neighbourhood: the nearest one may be the lobe. Without a lobe it is
    larger, and may show others. Where nearly all stand in pairs, one side of the pairs is kept.
    """
    keep = np.ones(len(xy_img), bool)
    while np.count_nonzero(keep) > N_RING:
        index = np.flatnonzero(keep)
        xy, own = xy_img[index], weight[index]
        distance, near = nearest_of(xy, xy, 1 + N_RING)
        weaker = ~_one_side(xy, own)
        if not weaker.any():
            partner = near[:, 1]
            weaker = (own < own[partner]) | ((own == own[partner]) & (partner < np.arange(len(index))))
            distance /= trend.at(xy)[2][:, None]
            weaker &= distance[:, 1] < LATTICE.distance_min * np.median(distance[near, 2], axis=1)
        if not weaker.any():
            break
        keep[index[weaker]] = False
    return keep


def _one_side(xy_img: Array, weight: Array) -> Mask:
    """(n,) all, or where nearly all stand in pairs, plainly apart from others, the heavier side of each."""
    distance, near = nearest_of(xy_img, xy_img, 1 + N_RING)
    partner = near[:, 1]
    paired = partner[partner] == np.arange(len(partner))
    scatter = SIGMA_OF_MAD * np.median(np.abs(_log_ratio(distance[:, 1], near)))
    gap = np.median(np.log(distance[:, 2] / distance[:, 1]))
    if paired.mean() < RUNTIME.most_rel or gap < RUNTIME.noise_sigma * scatter:
        return np.ones(len(xy_img), bool)
    apart = xy_img[partner] - xy_img
    ahead = apart @ np.linalg.svd(apart[paired], full_matrices=False)[2][0] > 0.0
    if weight[paired & ahead].sum() < weight[paired & ~ahead].sum():
        ahead = ~ahead
    kept: Mask = ahead | ~paired
    return kept


def trend_of(xy_img: Array, radius_px: Array, depth: Array, common_px: float) -> Trend:
    """The trend of size, against a common one, of depth and of spacing: their least absolute deviations."""
    distance = nearest_of(xy_img, xy_img, 3)[0][:, 1:].mean(axis=1)
    value = np.log(np.stack([radius_px / common_px, depth, distance], axis=1))
    value[:, 1:] -= np.median(value[:, 1:], axis=0)
    origin, unit_px = xy_img.mean(axis=0), float(xy_img.std())
    terms = _terms((xy_img - origin) / unit_px)
    off = value - np.median(value, axis=0)
    least = np.median(np.abs(off), axis=0) + np.finfo(float).eps
    weights = np.zeros((terms.shape[1], value.shape[1]))
    for _ in range(PARAMS.steps_max):
        root = 1.0 / np.sqrt(np.maximum(np.abs(off), least))
        for k in range(value.shape[1]):
            by = root[:, k]
            weights[:, k] = np.linalg.lstsq(terms * by[:, None], value[:, k] * by, rcond=None)[0]
        off = value - terms @ weights
    return Trend(origin, unit_px, weights, bool(2.0 * off[:, 0].var() < value[:, 0].var()))


def belongs(spots: Spots, trend: Trend) -> Mask:
    """Which spots fit their neighbours, beside what the trend explains, and are connected."""
    keep = np.ones(len(spots), bool)
    for _ in range(4):  # removing a false spot corrects its neighbours' medians; it settles in two rounds
        index = np.flatnonzero(keep)
        if len(index) <= N_RING:
            return np.zeros(len(spots), bool)
        outlierness = _outlierness(spots[index], trend)
        likely = outlierness < RUNTIME.noise_sigma**2
        xy = spots.xy_img[index]
        core = index[likely][_connected(xy[likely], trend)]
        if len(core) <= N_RING:
            return np.zeros(len(spots), bool)
        pitch = pitch_of(spots.xy_img[core])
        inside = inside_hull(spots.xy_img[core], xy, 0.5 * pitch)
        reach_px = PARAMS.link_pitches_outside * pitch * trend.at(xy)[2]
        near = nearest_of(spots.xy_img[core], xy)[0][:, 0] < reach_px
        fits = likely & (inside | (near & (outlierness < PARAMS.outlier_max_outside)))
        keep[index[~fits]] = False
        if fits.all():
            break
    return keep


def fills_gap(spots: Spots, pins: Spots, trend: Trend) -> Mask:
    """Which spots fill a gap of the pattern, about as large and bright as it would be."""
    if len(spots) == 0 or len(pins) <= N_RING:
        return np.zeros(len(spots), bool)
    distance, near = nearest_of(pins.xy_img, spots.xy_img, N_RING)
    pitch = np.median(nearest_of(pins.xy_img, pins.xy_img, 3)[0][:, 1:].mean(axis=1)[near], axis=1)
    (radius, depth, _), (of_pin, depth_of_pin, _) = trend.at(spots.xy_img), trend.at(pins.xy_img)
    size = spots.radius_px / radius / np.median((pins.radius_px / of_pin)[near], axis=1)
    depth = spots.depth / depth / np.median((pins.depth / depth_of_pin)[near], axis=1)
    fits: Mask = (size > 0.65) & (size < 1.5) & (depth > 0.45) & (depth < 1.7)
    fits &= distance[:, 0] > PARAMS.gap_pitches_min * pitch
    fits[fits] = inside_hull(pins.xy_img, spots.xy_img[fits], 0.5 * pitch_of(pins.xy_img))
    return fits


def unevenness(spots: Spots, trend: Trend) -> float:
    """How much neighbours differ: log scatter of size, of depth and of the nearest distance.

    The weights separate the known tips best from textures.
    """
    distance, near = nearest_of(spots.xy_img, spots.xy_img, N_RING + 1)
    radius, depth, spacing = trend.at(spots.xy_img)
    values = (spots.radius_px / radius, spots.depth / depth, distance[:, 1] / spacing)
    scatter = [np.median(np.abs(_log_ratio(value, near[:, 1:]))) for value in values]
    return float(SIGMA_OF_MAD * (scatter[0] + 1.5 * scatter[1] + 2.0 * scatter[2]))


def _outlierness(spots: Spots, trend: Trend) -> Array:
    """How far each spot is from its neighbours in size, depth and spacing; infinite: a reflection."""
    distance, near = nearest_of(spots.xy_img, spots.xy_img, N_RING + 1)
    distance, near = distance[:, 1:], near[:, 1:]
    radius, depth, spacing = trend.at(spots.xy_img)
    beside = near
    if trend.explains:  # near in the image may be many spacings away, along a tube many rings
        away, around = nearest_of(spots.xy_img, spots.xy_img, 2 * N_RING + 1)
        order = np.argsort(away[:, 1:] / np.sqrt(spacing[around[:, 1:]]), axis=1, kind="stable")[:, :N_RING]
        beside = np.take_along_axis(around[:, 1:], order, 1)
    apart = np.maximum(_log_ratio(distance[:, :2].mean(axis=1) / spacing, beside), 0.0)
    difference = np.stack(
        [_log_ratio(spots.radius_px / radius, beside), _log_ratio(spots.depth / depth, beside), apart]
    )
    scatter = SIGMA_OF_MAD * np.median(np.abs(difference), axis=1)
    scatter = np.clip(scatter, PARAMS.scatter_min, PARAMS.scatter_max)
    outlierness: Array = ((difference / scatter[:, None]) ** 2).sum(axis=0)
    # Two that overlap where their neighbours do not: one is a reflection on or beside the other, if it is
    # further off than pins are on average.
    closest = near[:, 0]
    overlap = distance[:, 0] < spots.radius_px + spots.radius_px[closest]
    overlap &= distance[:, 0] < PARAMS.gap_pitches_min * np.median(distance[near, 0], axis=1)
    worse = (outlierness > outlierness[closest]) & (outlierness > len(difference))
    return np.where(overlap & worse, np.inf, outlierness)


def _log_ratio(value: Array, near: Index) -> Array:
    """Log ratio of each value to the median of its neighbours'."""
    ratio: Array = np.log(value / np.median(value[near], axis=1))
    return ratio


def _connected(xy_img: Array, trend: Trend) -> Mask:
    """Which belong to a large group; two are linked if neither is far by its own nearest distance.

    Where nearest distances differ as those of strewn pins, some of which nearly touch, the two nearest count.
    Where they follow a trend, a distance is at least what that says, and half a ring is a group: along a
    tube, spokes are far apart, and a pin that is left out of one parts it.
    """
    n = len(xy_img)
    if n <= N_RING:
        return np.zeros(n, bool)
    distance, near = nearest_of(xy_img, xy_img, 1 + N_RING)
    own = distance[:, 1]
    if SIGMA_OF_MAD * np.median(np.abs(_log_ratio(own, near[:, 1:]))) > PARAMS.scatter_max[2]:
        own = distance[:, 1:3].mean(axis=1)
    least_n = N_RING
    if trend.explains:
        spacing = trend.at(xy_img)[2]
        own, least_n = np.maximum(own, spacing * np.median(own / spacing)), N_RING // 2
    a, b = pairs_within(xy_img, LATTICE.longest_edge * float(np.quantile(own, 0.95))).T
    linked = np.hypot(*(xy_img[a] - xy_img[b]).T) < LATTICE.longest_edge * np.minimum(own[a], own[b])
    label = groups_of(n, a[linked], b[linked])
    size = np.bincount(label)
    member: Mask = size[label] >= least_n
    return member
