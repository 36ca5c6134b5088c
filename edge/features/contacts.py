"""Contact places: regional maxima of the skin's stretch, merged into contacts by prominence.

    relief on a grid -> maxima() -> above the noise -> joined where no valley parts them
                      -> one region a group: place, area, axis, ridge

Idea: a probe makes one maximum, a long edge a chain of them, a flat surface a ring or a rough plateau.
Maxima with no real valley between them are one contact: to part them the surface must go down by `VALLEY`
of the lower one on every way from one to the other. That is topographic prominence, relative.

The surface is a blend: 0.7 of the divergence of the pins' motion (`Surface.stretch`), 0.3 of the surface
through the cells' areas. The divergence is sharp: of random pairs of probes 4 mm apart, 331 pins of 2.1 mm
pitch, simulated, it parts 88 %, the areas 12 %, since a cell's area averages over two pitches. But areas
are the steadier of the two where pins are badly seen: on the published webcam videos the divergence alone
breaks single touches up more often. The mixture parts 85 %, never breaks a simulated edge (1 % before).

Rules
- Plateau semantics of MATLAB's `imregionalmax` and `skimage.morphology.local_maxima`: connected grid
  points (8 neighbours) of one height, all of whose other neighbours are lower; a grid of one height has none.
- The region of a contact is what rises above `EDGE` of its highest point: a share of the peak and not a
  fixed height, so that it does not grow with the depth alone.
- Cells bear witness: round a maximum they have grown too. At the rim, where the surface has pins on one
  side only, a single pin's noise is a slope and a slope a maximum, but no cell has grown there.
- A contact's place is where its pins are now, weighted by how much their cells have grown: the pull of
  a shear on the pattern of growth and its pull on the pins nearly cancel in it.
- Strongest first, `CONTACTS_MAX` at the most.
"""

from __future__ import annotations

import math

import numpy as np

from edge import _features
from edge.features.surface import Heights, Surface
from edge.types import Array, ContactRegion, Index, Mask

__all__ = ["ContactFinder", "blend", "maxima"]

#: Share of the divergence in the relief.
SHARP = 0.7
#: Share of the lower maximum by which the valley must go down to part two contacts.
VALLEY = 0.2
#: Share of the peak above which a grid point belongs to the contact. 0.3 rather than 0.5: more points carry
#: the axis; an edge's direction on the simulated 331-pin tip is off by 2.3 deg instead of 3.2 (mean of 80).
EDGE = 0.3
#: A maximum below this share of the highest one is the strongest contact's own ripple or noise; so is one
#: round which the cells have grown by less than this share of the most. Of 200 published frames, each one
#: flat contact, 23 have noise at the rim that passes the first test and none that passes the second.
MINOR = 0.2
CONTACTS_MAX = 8  # as in _features.c, and so the next
MAXIMA_MAX = 24
#: Below this ratio of the axes the direction is noise and not reported; round probes show up to 1.4 on the
#: simulated tip, edges 3.4 in the mean.
ROUND = 1.5
#: Pins within this many pitches of a small contact's middle make its place.
REACH = 2.0


def blend(stretch: Heights, heights: Heights) -> Heights:
    """The surface that contacts are looked for in; both (k,) float32, so is the result."""
    out: Heights = np.float32(SHARP) * stretch
    out += np.float32(1.0 - SHARP) * heights
    return out


def maxima(grid: Heights) -> Mask:
    """Regional maxima, plateaus included.

    grid     (h, w) float32; -inf where there is no value
    Returns  (h, w) bool, equal to skimage.morphology.local_maxima(grid)
    """
    padded, place = _padded(np.ones(grid.shape, dtype=np.bool_))
    padded.ravel()[place] = grid.ravel()
    mark, stack = np.zeros((2, padded.size), dtype=np.int32)
    _features.maxima(padded, padded.shape[1], place, mark, stack)
    top: Mask = (mark[place] == _TOP).reshape(grid.shape)
    return np.zeros_like(top) if top.all() else top


_TOP = 2  # the mark of a maximum
_FIELDS = 7  # numbers a contact


def _padded(inside: Mask) -> tuple[Heights, Index]:
    """A grid of -inf with a border, so that every point has eight neighbours; and where the points lie."""
    padded = np.full((inside.shape[0] + 2, inside.shape[1] + 2), -np.inf, dtype=np.float32)
    within = np.zeros(padded.shape, dtype=np.bool_)
    within[1:-1, 1:-1] = inside
    return padded, np.flatnonzero(within).astype(np.int32)


class ContactFinder:
    """Looks for contacts on the grid of one surface; its arrays are made once."""

    def __init__(self, surface: Surface) -> None:
        self._surface = surface
        self._grid, self._place = _padded(surface.inside)
        self._mark, self._stack = np.zeros((2, self._grid.size), dtype=np.int32)
        self._rules = np.array(
            [
                surface.x_img[0],
                surface.y_img[0],
                surface.step_px,
                surface.pitch_px,
                VALLEY,
                EDGE,
                MINOR,
                REACH,
            ]
        )
        self._out = np.empty((CONTACTS_MAX, _FIELDS))
        self._ridge = np.empty((MAXIMA_MAX, 2))

    def find(
        self, relief: Heights, threshold: Heights, growth: Heights, pins_img: Array
    ) -> tuple[ContactRegion, ...]:
        """Contacts of one frame, strongest first.

        relief     (k,) float32, of `blend`, at the surface's points: relative area change
        threshold  (k,) float32, what a maximum must rise above to count
        growth     (n,) float32, relative area change of each pin's cell
        pins_img   (n, 2) px, where each pin is now; finite
        Source     paper, "Contact Location and Multi-Contact Detection"
        """
        found, ridges = _features.contacts(
            relief, threshold, self._place, self._grid, self._mark, self._stack, self._grid.shape[1],
            self._rules, growth, self._surface.rest_img, pins_img, self._out, self._ridge,
        )  # fmt: skip
        if not found:
            return ()
        ridge, rows = self._ridge[:ridges].copy(), self._out[:found].copy()
        contacts, first = [], 0
        for row, (_, _, peak, area, angle, elongation, many) in zip(rows, rows.tolist(), strict=True):
            last = first + int(many)
            contacts.append(
                ContactRegion(
                    xy_img=row[:2],
                    peak=peak,
                    area_px2=area,
                    orientation_rad=angle if elongation >= ROUND else math.nan,
                    elongation=elongation,
                    ridge_img=ridge[first:last],
                )
            )
            first = last
        return tuple(contacts)
