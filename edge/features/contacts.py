"""Contact places: regional maxima of the skin's stretch, merged into contacts by prominence.

    relief on a grid -> maxima() -> above the noise -> joined where no valley parts them
                      -> one region a group: place, area, axis, ridge -> a long small one: two?

Idea: a probe makes one maximum, a long edge a chain of them, a flat surface a ring or a rough plateau.
Maxima with no real valley between them are one contact: to part them the surface must go down by `VALLEY`
of the lower one, and by `PART` times the pins' own noise, on every way from one to the other. That is
topographic prominence, relative. The noise is what the pins show against their neighbours in this frame
(`local.Neighbourhood`), not what their sigmas promise: behind glare it is three to ten times that.

The surface is a blend: 0.7 of the divergence of the pins' motion (`Surface.stretch`), 0.3 of the surface
through the cells' areas. The divergence is sharp, a cell's area averages over two pitches; but areas are
the steadier of the two where pins are badly seen.

Two probes less than two and a half pitches apart are one long region in it. So a region that is long and
small is looked at once more, in a sharper and more nervous field (`divergence`), within the region alone:
two maxima on its axis, one on each side of its middle, make it two. Random pairs of probes on 331 simulated
pins of 2.1 mm pitch that are found as two: 85 % at 4 mm without that second look, 98 % with it; and of
balls, edges and flats none more is broken up.

Rules
- Plateau semantics of MATLAB's `imregionalmax` and `skimage.morphology.local_maxima`: connected grid
  points (8 neighbours) of one height, all of whose other neighbours are lower; a grid of one height has none.
- The region of a contact is what rises above `EDGE` of its highest point: a share of the peak and not a
  fixed height, so that it does not grow with the depth alone.
- Cells bear witness: round a maximum they have grown too. At the rim, where the surface has pins on one
  side only, a single pin's noise is a slope and a slope a maximum, but no cell has grown there. Cells of lost
  pins say what others say: where most are lost there is no second contact, only a guess.
- A contact's place is where its pins are now, weighted by how much their cells have grown: the pull of
  a shear on the pattern of growth and its pull on the pins nearly cancel in it.
- Strongest first, `CONTACTS_MAX` at the most.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from edge import _features
from edge.features.divergence import divergence_operator
from edge.features.surface import Heights, Surface, in_steps
from edge.types import Array, ContactRegion, Index, Mask

__all__ = ["ContactFinder", "blend", "maxima"]

#: Share of the divergence in the relief.
SHARP = 0.7
#: Share of the lower maximum by which the valley must go down to part two contacts.
VALLEY = 0.2
#: Depth of that valley in sigmas of the noise there. Pins behind glare are not Gaussian: of the valleys that
#: break up single touches in three published webcam videos half are deeper than 5 sigma, 5 % than 10; at 10,
#: 94..98 % of the touched frames show one contact, of 45..64 % without this rule. Two probes 5 mm apart
#: (simulated) have 34 sigma and more.
PART = 10.0
#: Share of the peak above which a grid point belongs to the contact. 0.3 rather than 0.5: more points carry
#: the axis; an edge's direction on the simulated 331-pin tip is off by 2.3 deg instead of 3.2 (mean of 80).
EDGE = 0.3
#: A maximum below this share of the highest one is the strongest contact's own ripple or noise; so is one
#: round which the cells have grown by less than this share of the most. Of 200 published frames, each one
#: flat contact, 23 have noise at the rim that passes the first test and none that passes the second.
MINOR = 0.2
#: Of the pins within so many pitches of a contact's middle this share must be seen, or it is a guess and no
#: second contact. Of 1200 flat presses (simulated, each found from nothing, clumps of pins lost in 85) 14
#: fell in two without this rule, 8 with it.
ROUND_PITCHES, WITNESSES = 2.5, 0.4
CONTACTS_MAX = 8  # as in _features.c, and so the next
MAXIMA_MAX = 24
#: Below this ratio of the axes the direction is noise and not reported; round probes show up to 1.4 on the
#: simulated tip, edges 3.4 in the mean.
ROUND = 1.5
#: Which regions are looked at twice: axes' ratio above (pairs that were one contact show 1.9..3.1, balls up
#: to 1.4), and long half axis in pitches below (1.4..2.1; in longer ones the coarse field sees two itself).
LONG, SMALL = 1.5, 3.0
#: The second look: at most this many pitches apart, and this much of it along the axis; valley's depth as
#: above (simulated edges have up to 0.15 of the lower maximum, flats 0.3, pairs 4 mm apart 0.33 and more).
NEAR, ALIGNED = 3.0, 0.7
FINE_VALLEY, FINE_PART = 0.3, 8.0
#: Steps of its grid per pitch; at 1.5, 7 % of simulated edges fall apart in the sharp field, at 2 none.
FINE_STEPS_PER_PITCH = 2.0
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


class _Fine:
    """The sharper field's operator and grid, and which of the surface's points each of its points lies at."""

    def __init__(self, surface: Surface) -> None:
        radius = 0.5 * float(surface.x_img[-1] - surface.x_img[0])
        size = round(2.0 * radius / surface.pitch_px * FINE_STEPS_PER_PITCH) + 1
        x = np.linspace(surface.x_img[0], surface.x_img[-1], size)
        y = np.linspace(surface.y_img[0], surface.y_img[-1], size)
        column, row = (np.rint((a - a[0]) / surface.step_px).astype(np.intp) for a in (x, y))
        coarse = surface.index[np.ix_(row, column)]
        inside: Mask = coarse >= 0
        points = np.column_stack([a[inside] for a in np.meshgrid(x, y)])
        operator = divergence_operator(surface.rest_img, points, surface.pitch_px)
        rows, steps = in_steps(operator)
        grid, place = _padded(inside)
        self.corner = (float(x[0]), float(y[0]), float(x[1] - x[0]))
        self.before = (rows,)
        self.after = (
            steps,
            np.sqrt((operator**2).sum(axis=1)).astype(np.float32),
            place,
            coarse[inside].astype(np.int32),
            grid,
            np.zeros(2 * grid.size, dtype=np.int32),
            np.empty(len(rows), dtype=np.int32),
            grid.shape[1],
        )


class ContactFinder:
    """Looks for contacts on the grid of one surface; its arrays are made once."""

    def __init__(self, surface: Surface) -> None:
        self._surface = surface
        grid, place = _padded(surface.inside)
        mark, stack = np.zeros((2, grid.size), dtype=np.int32)
        self._grid = (place, grid, mark, stack, grid.shape[1])
        near = surface.near
        self._local = (near.near, near.residual, near.scratch)
        self._fine: _Fine | None = None  # 100 ms to make: when a small long contact is first seen
        self._rules = self._all_rules((0.0, 0.0, 1.0))
        self._out = np.empty((CONTACTS_MAX, _FIELDS))
        self._ridge = np.empty((MAXIMA_MAX, 2))

    def _all_rules(self, corner: tuple[float, float, float]) -> Array:
        """As `Rules` in _features.c has them."""
        s = self._surface
        coarse = (s.x_img[0], s.y_img[0], s.step_px, s.pitch_px, VALLEY, EDGE, MINOR, REACH, PART)
        seen = (ROUND_PITCHES * s.pitch_px, WITNESSES)
        return np.array([*coarse, *seen, *corner, LONG, SMALL, NEAR, FINE_VALLEY, FINE_PART, ALIGNED])

    def prepare(self) -> None:
        """Make what else would be made when a small long contact is first seen."""
        if self._fine is None:
            self._fine = _Fine(self._surface)
            self._rules = self._all_rules(self._fine.corner)

    def find(
        self, relief: Heights, threshold: Heights, growth: Heights, pins_img: Array, seen: Mask
    ) -> tuple[ContactRegion, ...]:
        """Contacts of one frame, strongest first.

        relief     (k,) float32, of `blend`, at the surface's points: relative area change
        threshold  (k,) float32, what a maximum must rise above to count
        growth     (n,) float32, relative area change of each pin's cell
        pins_img   (n, 2) px, where each pin is now; finite; of the same frame as the last `stretch`
        seen       (n,) bool
        Source     paper, "Contact Location and Multi-Contact Detection"
        """
        found, ridges, wanted = self._run(relief, threshold, growth, pins_img, seen)
        if wanted and self._fine is None:
            self.prepare()
            found, ridges, _ = self._run(relief, threshold, growth, pins_img, seen)
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

    def _run(
        self, relief: Heights, threshold: Heights, growth: Heights, pins_img: Array, seen: Mask
    ) -> tuple[int, int, int]:
        surface, fine = self._surface, self._fine
        sharp: tuple[Any, ...] = ()
        if fine is not None:
            sharp = (*fine.before, surface.motion, *fine.after, surface.motion_step, surface.even_stretch)
        return _features.contacts(
            relief, threshold, surface.stretch_noise, self._grid, self._rules,
            (growth, surface.rest_img, pins_img, seen), self._local, sharp, self._out, self._ridge,
        )  # fmt: skip
