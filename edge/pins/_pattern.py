"""What makes a set of spots a pattern of pins: neighbours of the same size and brightness at an even pitch.

Rules
- A pin is judged by its neighbours, not by the whole: a fisheye or a tilted tip shows pins of very different
  size, vignetting of very different brightness, but never a small one among large ones.
- Pins hang together: everything that the chain of neighbours does not reach is outside of the skin.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from edge.pins._blobs import Spots
from edge.types import Array, Mask

NEIGHBOURS = 6
# Shape of a single spot. A straight ridge as wide as a pin falls on two thirds of the rays and a step on half,
# so 0.7 refuses both and still lets a pin lean on one neighbour or on a reflection.
SHARE_MIN = 0.7
SPREAD_MAX = 0.6
# Against the median of the neighbours. Measured on the five real tips: true pins lie within 0.62..1.6 of their
# neighbours' radius and over 0.35 of their brightness; specks on the skin's border are under half as large.
SIZE_RANGE = (0.6, 1.7)
DEPTH_MIN = 0.35
LINK_PITCHES = 1.9


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


def belongs(spots: Spots, pitch_px: float) -> Mask:
    """Which spots fit their neighbours and hang together with the largest group."""
    keep = np.ones(len(spots), bool)
    for _ in range(3):  # removing one false spot can clear or spoil its neighbours; it settles in two rounds
        index = np.flatnonzero(keep)
        if len(index) <= NEIGHBOURS:
            return np.zeros(len(spots), bool)
        fits = _fits_neighbours(spots[index])
        fits &= _largest_group(spots.xy_img[index], fits, LINK_PITCHES * pitch_px)
        keep[index[~fits]] = False
        if fits.all():
            break
    return keep


def _fits_neighbours(spots: Spots) -> Mask:
    _, near = cKDTree(spots.xy_img).query(spots.xy_img, k=NEIGHBOURS + 1)
    size = spots.radius_px / np.median(spots.radius_px[near[:, 1:]], axis=1)
    depth = spots.depth / np.median(spots.depth[near[:, 1:]], axis=1)
    return (size > SIZE_RANGE[0]) & (size < SIZE_RANGE[1]) & (depth > DEPTH_MIN)


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
