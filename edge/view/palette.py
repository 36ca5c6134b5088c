"""Colours (BGR, as in OpenCV), and how an area change becomes one.

The paper shades compressed cells (area up) red and expanded ones blue; `SAFE` takes orange and blue of the
Okabe-Ito set, and black vectors. Between white and the full colour they are mixed in CIELAB, where equal
steps look equal: mixed in sRGB, blue fades earlier than red.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from edge.types import Array


@dataclass(frozen=True, slots=True)
class ViewParams:
    """Every chosen number of the pictures; the evidence for each is in docs/tuning.md, "Pictures"."""

    full_change: float = 0.5  # area change that gets the full colour
    local_gain: float = 2.0  # of each pin's motion, as a vector
    global_gain: float = 6.0  # of the mean motion, which is small beside the largest
    jpeg_quality: int = 80  # of the live page's camera image
    side_max_px: int = 720


PARAMS = ViewParams()
COLOUR_STEPS = 255  # on each side of no change: as many as a colour of 8 bits has

Bgr = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Palette:
    """A colour for everything that is drawn."""

    compressed: Bgr  # full colour for a larger area
    expanded: Bgr  # for a smaller one
    paper: Bgr  # an unchanged cell, and the background
    edge: Bgr  # outlines of cells
    pin: Bgr  # where a pin is
    contact: Bgr  # the star
    local: Bgr  # vectors of single pins
    shear: Bgr  # their mean
    ink: Bgr  # text and axes
    halo: Bgr  # drawn round marks, so that they stand out from any cell


PAPER = Palette(
    compressed=(38, 30, 214),
    expanded=(217, 106, 42),  # as far from white as the red: changes of both signs look equally strong
    paper=(255, 255, 255),
    edge=(190, 190, 190),
    pin=(90, 90, 90),
    contact=(200, 30, 10),
    local=(20, 10, 140),
    shear=(0, 0, 0),
    ink=(40, 40, 40),
    halo=(255, 255, 255),
)
SAFE = replace(  # Okabe and Ito: orange, blue, bluish green, black
    PAPER, compressed=(0, 140, 230), expanded=(178, 114, 0), contact=(90, 110, 0), local=(60, 60, 60)
)
PALETTES = {"paper": PAPER, "safe": SAFE}


def _share(area_change: Array) -> Array:
    """Share of the change that gets the full colour; beyond it the colour stays."""
    return np.clip(np.nan_to_num(area_change) / PARAMS.full_change, -1.0, 1.0)


def cell_colours(area_change: Array, palette: Palette = PAPER) -> NDArray[np.uint8]:
    """BGR of each cell, (n, 3); a lost pin's cell is grey like an edge."""
    share = _share(area_change)
    colours = _ramp(palette)[np.rint((share + 1.0) * COLOUR_STEPS).astype(np.intp)]
    colours[~np.isfinite(area_change)] = palette.edge
    return colours


@lru_cache(maxsize=4)
def _ramp(palette: Palette) -> NDArray[np.uint8]:
    """Colours from fully expanded through unchanged to fully compressed, BGR."""
    ends = np.array([[palette.expanded, palette.paper, palette.compressed]], np.float32) / 255
    expanded, paper, compressed = cv2.cvtColor(ends, cv2.COLOR_BGR2Lab)[0]
    share = np.linspace(-1.0, 1.0, 2 * COLOUR_STEPS + 1)
    end = np.where(share[:, None] < 0, expanded, compressed)
    lab = np.asarray(paper + (end - paper) * np.abs(share)[:, None], np.float32)
    return np.asarray(np.rint(255 * cv2.cvtColor(lab[None], cv2.COLOR_Lab2BGR)[0]), np.uint8)


def cell_rgba(area_change: Array) -> Array:
    """(n, 4) the same over the camera's image: r, g, b, opacity in 0..1; opacity shows the change."""
    share = _share(area_change)[:, None]
    bgr = np.where(share >= 0, PAPER.compressed, PAPER.expanded)
    return np.hstack([bgr[:, ::-1] / 255, 0.7 * np.abs(share)])
