"""Where each known pin is now, from its neighbourhood alone.

Idea
- A pin is a blurred disc. The templates that a least-squares fit of that disc needs (the disc and its slope
  in x and y) are made once, for the radii at hand and for 4 x 4 subpixel offsets; `edge._centroid` then
  answers each pin with a few dot products. See there for the estimator.

Rules
- Radii come in kinds 8 % apart: a template that is 4 % off in radius is still symmetric, so it costs a
  little noise (1 %) and no bias.
- Buffers are made once. What `refine` returns is a copy and stays good.
"""

from __future__ import annotations

import numpy as np
from scipy.special import erfc

from edge import _centroid
from edge.types import Array, Image, Pins, Rest

PHASES = 4
_LANES = 8
_HALF_MAX = 39
_KIND_STEP = 1.08
# How much of the window's variation the disc has to explain, and how much of its usual light (after the gain
# common to all pins) a pin must keep.
FIT_MIN = 0.4
AMPLITUDE_SHARE_MIN = 0.25
_REACH_PITCHES = 0.6
_CLASH_RADII = 1.1


class Refiner:
    """Reads the pins of `rest` in image after image, each near where it is predicted."""

    def __init__(self, rest: Rest) -> None:
        n = len(rest)
        pattern = rest.pattern
        radius = np.asarray(rest.pins.radius_px, np.float64)
        kind = np.rint(np.log(radius / radius.min()) / np.log(_KIND_STEP)).astype(np.int32)
        used, self._kind_of = np.unique(kind, return_inverse=True)
        self._kind_of = np.ascontiguousarray(self._kind_of, np.int32)
        self._kinds, self._templates, self._norms = _tables(
            radius.min() * _KIND_STEP**used, pattern.edge_px, pattern.pitch_px
        )
        self._radius = radius
        self._rest_amplitude = np.ascontiguousarray(rest.pins.brightness, np.float64)
        self._limits = np.array(
            [FIT_MIN, AMPLITUDE_SHARE_MIN, _REACH_PITCHES * pattern.pitch_px, _CLASH_RADII * radius.min()]
        )
        self._order = np.arange(n, dtype=np.int32)
        self._scratch = np.empty(n)
        self._out = np.empty((n, 5))

    def refine(self, image: Image, xy_img_predicted: Array) -> Pins:
        """Centroid of each pin near its prediction; row i is pin i, NaN where there is none.

        image             (h, w) uint8 or uint16
        xy_img_predicted  (n, 2) float64, px; within half a pitch of the truth; NaN gives NaN
        """
        predicted = np.ascontiguousarray(xy_img_predicted, np.float64)
        _centroid.refine(
            image,
            predicted,
            self._kind_of,
            self._kinds,
            self._templates,
            self._norms,
            self._rest_amplitude,
            self._limits,
            self._order,
            self._scratch,
            self._out,
        )
        out = self._out
        return Pins(out[:, :2].copy(), out[:, 2].copy(), self._radius, out[:, 3].copy())

    @property
    def fit(self) -> Array:
        """(n,) share of the window's variation that the disc explained in the last image."""
        return self._out[:, 4].copy()


def _tables(radii: Array, edge_px: float, pitch_px: float) -> tuple[Array, Array, Array]:
    """Kinds (k, 4) int64, templates float32 and norms (k, 16, 12) as `_centroid.refine` wants them."""
    kinds, parts, norms = [], [], []
    first = 0
    for radius in radii:
        support = min(radius + 3.0 * edge_px + 0.5, max(radius + 1.5 * edge_px, pitch_px - radius - edge_px))
        half = min(int(np.ceil(support + 0.5)), _HALF_MAX)
        size = 2 * half + 1
        stride = -(-size // _LANES) * _LANES
        for phase in range(PHASES * PHASES):
            centre = (np.array([phase % PHASES, phase // PHASES]) + 0.5) / PHASES - 0.5
            planes, norm = _templates(radius, edge_px, support, half, centre)
            norms.append(norm)
            padded = np.zeros((4, size, stride), np.float32)
            padded[:, :, :size] = planes
            parts.append(padded.ravel())
        step = 4 * size * stride
        kinds.append((half, stride, first, step))
        first += step * PHASES * PHASES
    return (
        np.array(kinds, np.int64),
        np.concatenate(parts),
        np.ascontiguousarray(np.array(norms).reshape(len(radii), PHASES * PHASES, 12)),
    )


def _templates(
    radius: float, edge_px: float, support: float, half: int, centre: Array
) -> tuple[Array, Array]:
    """Support, disc, and its slopes for one subpixel offset, and their norms."""
    grid = np.arange(-half, half + 1, dtype=np.float64)
    u, v = np.meshgrid(grid - centre[0], grid - centre[1])
    r = np.hypot(u, v)
    inside = (r <= support).astype(np.float64)
    disc = 0.5 * erfc((r - radius) / (np.sqrt(2.0) * edge_px))
    slope = (
        np.exp(-0.5 * ((r - radius) / edge_px) ** 2) / (edge_px * np.sqrt(2.0 * np.pi)) / np.maximum(r, 1e-9)
    )
    d = _without(disc * inside, inside)
    tx = _without(slope * u * inside, inside, d)
    ty = _without(slope * v * inside, inside, d)
    columns, rows = np.meshgrid(grid, grid)
    planes = [_without(p * inside, inside, d) for p in (columns, rows)]
    n, dd = inside.sum(), (d * d).sum()
    norm = np.array(
        [
            n, dd, (tx * tx).sum(), (ty * ty).sum(),
            (tx * planes[0]).sum(), (ty * planes[1]).sum(), (planes[0] ** 2).sum(), (planes[1] ** 2).sum(),
            (columns * inside).sum() / n, (rows * inside).sum() / n, (columns * d).sum() / dd, (rows * d).sum() / dd,
        ]
    )  # fmt: skip
    return np.stack([inside, d, tx, ty]), norm


def _without(plane: Array, *others: Array) -> Array:
    """`plane` less what the others explain of it, by least squares; all are zero outside of the support."""
    basis = np.stack([o.ravel() for o in others], axis=1)
    weight, *_ = np.linalg.lstsq(basis, plane.ravel(), rcond=None)
    return plane - (basis @ weight).reshape(plane.shape)
