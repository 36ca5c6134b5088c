"""What makes a set of spots a pattern of pins: neighbours of the same size and brightness at an even pitch.

Rules
- A spot is judged against its neighbours, not against the whole: a fisheye or a tilted tip shows pins of very
  different size, vignetting of very different brightness, but never a small one among large ones.
- How much neighbours may differ is learnt from the image: little on an even tip, more on an uneven one.
- Pins hang together: what the chain of neighbours does not reach is outside of the skin.
- A gap inside the pattern may be filled with a spot of poor shape: a pin that leans on a reflection, or on
  another pin, is still a pin.
"""

from __future__ import annotations

import cv2
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from edge.pins._blobs import Spots
from edge.types import Array, Index, Mask

NEIGHBOURS = 6
# Shape of a single spot. A straight ridge as wide as a pin falls on two thirds of the rays, a step on half:
# 0.7 refuses both and still lets a pin lean on one neighbour or on a reflection.
SHARE_MIN, SPREAD_MAX = 0.7, 0.6
# Shape that will do for a spot that fills a gap of the pattern.
GAP_SHARE_MIN, GAP_SPREAD_MAX = 0.5, 1.5
# Differences between neighbours are log ratios of size, depth and spacing, in units of the tip's own scatter
# within these bounds; sum of squares at most _ODD_MAX. On the 331-pin tips true pins reach 15 (a dim one) and
# false spots begin at 35; where a tip is uneven and glare abounds the upper bounds keep texture out.
_SCATTER_MIN = np.array([0.08, 0.13, 0.13])
_SCATTER_MAX = np.array([0.11, 0.20, 0.20])
_ODD_MAX = 25.0
# Whatever the scatter: half the size of its neighbours, or a quarter of their depth, is no pin.
_SIZE_MIN, _SIZE_MAX, _DEPTH_MIN = 0.5, 2.0, 0.25
# Links reach this many times the distance to the nearest neighbour. Within the patterns seen rows lie up to
# 1.4 apart, reflections on the skin's border 1.7 and more, and no six of them hang together.
_LINK, _GROUP_MIN, _GROUP_SHARE = 1.6, 6, 0.03
_HULL_MARGIN = 0.5  # pitches
# Outside of the hull of what hangs together well: how odd a spot may be, and how near a pin it has to be.
_ODD_MAX_OUTSIDE, _LINK_PITCHES = 9.0, 1.9
_TOUCH_RADII, _TOUCH_PITCHES, _ODD_TOUCHING = 1.15, 0.7, 6.0
_GAP_MIN = 0.8  # of the local pitch, to the nearest pin


def one_of_each(spots: Spots, misfit: Array) -> Spots:
    """Of spots on the same place the one with the least misfit."""
    if len(spots) < 2:
        return spots
    near = cKDTree(spots.xy_img).query_ball_point(spots.xy_img, 0.9 * spots.radius_px)
    dead = np.zeros(len(spots), bool)
    keep = np.zeros(len(spots), bool)
    for i in np.argsort(misfit):
        if not dead[i]:
            keep[i] = True
            dead[near[i]] = True
    return spots[keep]


def pitch_of(xy_img: Array) -> float:
    """Median over the pins of the mean distance of the three nearest neighbours, px."""
    distance, _ = cKDTree(xy_img).query(xy_img, k=min(4, len(xy_img)))
    return float(np.median(distance[:, 1:].mean(axis=1)))


def belongs(spots: Spots) -> Mask:
    """Which spots fit their neighbours and hang together."""
    keep = np.ones(len(spots), bool)
    for _ in range(4):  # each false spot that goes clears its neighbours' medians; it settles in two rounds
        index = np.flatnonzero(keep)
        if len(index) <= NEIGHBOURS:
            return np.zeros(len(spots), bool)
        odd = _oddness(spots[index])
        xy = spots.xy_img[index]
        core = index[odd < _ODD_MAX][_hang_together(xy[odd < _ODD_MAX])]
        if len(core) <= NEIGHBOURS:
            return np.zeros(len(spots), bool)
        pitch = pitch_of(spots.xy_img[core])
        inside = _inside_hull(spots.xy_img[core], xy, _HULL_MARGIN * pitch)
        near = cKDTree(spots.xy_img[core]).query(xy)[0] < _LINK_PITCHES * pitch
        fits = (odd < _ODD_MAX) & (inside | (near & (odd < _ODD_MAX_OUTSIDE)))
        keep[index[~fits]] = False
        if fits.all():
            break
    return keep


def fills_gap(spots: Spots, pins: Spots) -> Mask:
    """Which spots stand where a pin of the pattern is missing, about as large and bright as it would be."""
    if len(spots) == 0 or len(pins) <= NEIGHBOURS:
        return np.zeros(len(spots), bool)
    tree = cKDTree(pins.xy_img)
    distance, near = tree.query(spots.xy_img, k=NEIGHBOURS)
    pitch = np.median(tree.query(pins.xy_img, k=3)[0][:, 1:].mean(axis=1)[near], axis=1)
    size = spots.radius_px / np.median(pins.radius_px[near], axis=1)
    depth = spots.depth / np.median(pins.depth[near], axis=1)
    fits: Mask = (
        (distance[:, 0] > _GAP_MIN * pitch) & (size > 0.65) & (size < 1.5) & (depth > 0.45) & (depth < 1.7)
    )
    fits[fits] = _inside_hull(pins.xy_img, spots.xy_img[fits], _HULL_MARGIN * pitch_of(pins.xy_img))
    return fits


def unevenness(spots: Spots) -> float:
    """How unlike neighbours are: log scatter of size, of depth and of the nearest distance.

    Weighted so that it parts the tips at hand from textures best.
    """
    distance, near = cKDTree(spots.xy_img).query(spots.xy_img, k=NEIGHBOURS + 1)
    values = (spots.radius_px, spots.depth, distance[:, 1])
    scatter = [np.median(np.abs(_against(value, near[:, 1:]))) for value in values]
    return float(1.4826 * (scatter[0] + 1.5 * scatter[1] + 2.0 * scatter[2]))


def _oddness(spots: Spots) -> Array:
    """How far each spot differs from its neighbours in size, depth and spacing; infinite where past doubt."""
    distance, near = cKDTree(spots.xy_img).query(spots.xy_img, k=NEIGHBOURS + 1)
    distance, near = distance[:, 1:], near[:, 1:]
    difference = np.stack(
        [
            _against(spots.radius_px, near),
            _against(spots.depth, near),
            np.maximum(_against(distance[:, :2].mean(axis=1), near), 0.0),
        ]
    )
    scatter = np.clip(1.4826 * np.median(np.abs(difference), axis=1), _SCATTER_MIN, _SCATTER_MAX)
    odd: Array = ((difference / scatter[:, None]) ** 2).sum(axis=0)
    size, depth = np.exp(difference[0]), np.exp(difference[1])
    odd[(size < _SIZE_MIN) | (size > _SIZE_MAX) | (depth < _DEPTH_MIN)] = np.inf
    # Two that touch where the others keep their distance: one is a reflection on or beside the other.
    closest = near[:, 0]
    touching = distance[:, 0] < _TOUCH_RADII * (spots.radius_px + spots.radius_px[closest])
    touching &= distance[:, 0] < _TOUCH_PITCHES * np.median(distance[near, 0], axis=1)
    return np.where(touching & (odd > odd[closest]) & (odd > _ODD_TOUCHING), np.inf, odd)


def _against(value: Array, near: Index) -> Array:
    """Log ratio of each value to the median of its neighbours'."""
    ratio: Array = np.log(value / np.median(value[near], axis=1))
    return ratio


def _hang_together(xy_img: Array) -> Mask:
    """Which belong to a large group; two are linked when no further apart than each is used to."""
    n = len(xy_img)
    if n < 2:
        return np.zeros(n, bool)
    tree = cKDTree(xy_img)
    own = tree.query(xy_img, k=2)[0][:, 1]
    a, b = tree.query_pairs(_LINK * float(np.quantile(own, 0.95)), output_type="ndarray").T
    linked = np.hypot(*(xy_img[a] - xy_img[b]).T) < _LINK * np.minimum(own[a], own[b])
    graph = coo_array((np.ones(linked.sum()), (a[linked], b[linked])), shape=(n, n))
    _, label = connected_components(graph, directed=False)
    size = np.bincount(label)
    member: Mask = size[label] >= max(_GROUP_MIN, _GROUP_SHARE * size.max())
    return member


def _inside_hull(pins: Array, xy_img: Array, margin_px: float) -> Mask:
    hull = cv2.convexHull(pins.astype(np.float32))
    return np.array(
        [cv2.pointPolygonTest(hull, (float(x), float(y)), True) > -margin_px for x, y in xy_img], bool
    )
