"""Colours, and how an area change becomes one.

The paper shades compressed cells (area up) red and expanded ones (area down) blue. Red and blue of equal
weight are told apart by most colour-blind readers, but not in grey print and not beside red vectors;
`SAFE` takes orange and blue of the Okabe-Ito set, and black vectors.
Colours are BGR, as OpenCV has them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from edge.types import Array

__all__ = ["FULL_CHANGE", "PAPER", "SAFE", "Palette", "cell_colours", "cell_rgba"]

Bgr = tuple[int, int, int]
FULL_CHANGE = 0.5  # area change that gets the full colour; a firm press reaches it under the contact
_FAINT = 0.7  # lifts small changes, which is where a touch begins, and still tells large ones apart


@dataclass(frozen=True, slots=True)
class Palette:
    """compressed, expanded  full colour of a cell that grew, that shrank
    paper                 an unchanged cell, and the background
    edge                  outlines of cells
    pin                   where a pin is
    contact               the star
    local, shear          vectors of single pins, and their mean
    ink                   text and axes
    halo                  drawn round marks, so that they stand out from any cell
    """

    compressed: Bgr
    expanded: Bgr
    paper: Bgr
    edge: Bgr
    pin: Bgr
    contact: Bgr
    local: Bgr
    shear: Bgr
    ink: Bgr
    halo: Bgr


PAPER = Palette(
    compressed=(38, 30, 214),
    expanded=(214, 96, 26),
    paper=(255, 255, 255),
    edge=(190, 190, 190),
    pin=(90, 90, 90),
    contact=(200, 30, 10),
    local=(20, 10, 140),
    shear=(0, 0, 0),
    ink=(40, 40, 40),
    halo=(255, 255, 255),
)
SAFE = Palette(  # Okabe and Ito: orange, blue, bluish green, black
    compressed=(0, 140, 230),
    expanded=(178, 114, 0),
    paper=(255, 255, 255),
    edge=(190, 190, 190),
    pin=(90, 90, 90),
    contact=(90, 110, 0),
    local=(60, 60, 60),
    shear=(0, 0, 0),
    ink=(40, 40, 40),
    halo=(255, 255, 255),
)


def cell_colours(
    area_change: Array, palette: Palette = PAPER, full: float = FULL_CHANGE
) -> NDArray[np.uint8]:
    """BGR of each cell, (n, 3); a lost pin's cell is grey like an edge.

    full  area change that gets the full colour; beyond it the colour stays
    """
    share = np.clip(np.nan_to_num(area_change) / full, -1.0, 1.0)
    paper = np.array(palette.paper, dtype=float)
    strong = np.where(share[:, None] >= 0, np.array(palette.compressed), np.array(palette.expanded))
    weight = (np.abs(share) ** _FAINT)[:, None]
    colours: NDArray[np.uint8] = np.rint(paper + (strong - paper) * weight).astype(np.uint8)
    colours[~np.isfinite(area_change)] = palette.edge
    return colours


def cell_rgba(
    area_change: Array, palette: Palette = PAPER, full: float = FULL_CHANGE
) -> list[tuple[float, float, float, float]]:
    """The same as an overlay on the camera's image: r, g, b, opacity in 0..1; opacity shows the change."""
    share = np.clip(np.nan_to_num(area_change) / full, -1.0, 1.0)
    rgba = []
    for s in share.tolist():
        b, g, r = palette.compressed if s >= 0 else palette.expanded
        rgba.append((r / 255, g / 255, b / 255, 0.7 * float(abs(s) ** _FAINT)))
    return rgba
