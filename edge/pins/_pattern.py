"""What makes a set of spots a pattern of pins: neighbours of the same size and brightness at an even pitch.

Rules
- A spot is judged against its neighbours, not against the whole: a fisheye or a tilted tip shows pins of very
  different size, vignetting of very different brightness, but never a small one among large ones.
- How much neighbours may differ is learnt from the image: tight on a tip that is even, wide on one that is not.
- Pins hang together: what the chain of neighbours does not reach is outside of the skin.
- A gap inside the pattern may be filled with a spot of poor shape: a pin that leans on a reflection, or on
  another pin, is still a pin.
"""

from __future__ import annotations

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
_LINK_PITCHES = 1.9
_TOUCH_RADII, _TOUCH_PITCHES = 1.15, 0.7
_GAP_MIN = 0.7  # of the local pitch, to the nearest pin


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
    """Which spots fit their neighbours and hang together with the largest group."""
    keep = np.ones(len(spots), bool)
    for _ in range(4):  # each false spot that goes clears its neighbours' medians; it settles in two rounds
        index = np.flatnonzero(keep)
        if len(index) <= NEIGHBOURS:
            return np.zeros(len(spots), bool)
        fits = _fits_neighbours(spots[index])
        fits &= _largest_group(spots.xy_img[index], fits, _LINK_PITCHES * pitch_of(spots.xy_img[index]))
        keep[index[~fits]] = False
        if fits.all():
            break
    return keep


def fills_gap(spots: Spots, pins: Spots) -> Mask:
    """Which of the spots stand where a pin of the pattern is missing, and are as large and bright as it would be."""
    if len(spots) == 0 or len(pins) <= NEIGHBOURS:
        return np.zeros(len(spots), bool)
    tree = cKDTree(pins.xy_img)
    distance, near = tree.query(spots.xy_img, k=NEIGHBOURS)
    pitch = np.median(tree.query(pins.xy_img, k=3)[0][:, 1:].mean(axis=1)[near], axis=1)
    size = spots.radius_px / np.median(pins.radius_px[near], axis=1)
    depth = spots.depth / np.median(pins.depth[near], axis=1)
    # In the pattern the neighbours stand all round, on its rim over half of it: their mean is near the spot.
    lean = np.hypot(*(pins.xy_img[near].mean(axis=1) - spots.xy_img).T) / pitch
    fits = (distance[:, 0] > _GAP_MIN * pitch) & (distance[:, 1] < 1.4 * pitch) & (distance[:, 2] < 1.6 * pitch)
    fits &= lean < 1.0
    return fits & (size > 0.7) & (size < 1.5) & (depth > 0.6) & (depth < 1.7)


def _fits_neighbours(spots: Spots) -> Mask:
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
    odd = ((difference / scatter[:, None]) ** 2).sum(axis=0)
    size, depth = np.exp(difference[0]), np.exp(difference[1])
    fits = (odd < _ODD_MAX) & (size > _SIZE_MIN) & (size < _SIZE_MAX) & (depth > _DEPTH_MIN)
    # Two that touch where the others keep their distance: one is a reflection on or beside the other.
    closest = near[:, 0]
    touching = distance[:, 0] < _TOUCH_RADII * (spots.radius_px + spots.radius_px[closest])
    touching &= distance[:, 0] < _TOUCH_PITCHES * np.median(distance[near, 0], axis=1)
    return fits & ~(touching & (odd > odd[closest]))


def _against(value: Array, near: Index) -> Array:
    """Log ratio of each value to the median of its neighbours'."""
    ratio: Array = np.log(value / np.median(value[near], axis=1))
    return ratio


def _largest_group(xy_img: Array, among: Mask, reach_px: float) -> Mask:
    index = np.flatnonzero(among)
    member = np.zeros(len(xy_img), bool)
    if len(index) == 0:
        return member
    pairs = cKDTree(xy_img[index]).query_pairs(reach_px, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(index), len(index)))
    _, label = connected_components(graph, directed=False)
    member[index[label == np.bincount(label).argmax()]] = True
    return member
