"""Whether a rest frame shows a touch, where nothing is known of the tip: by the symmetry of its cells.

Cell areas of an untouched tip change smoothly for two reasons: dome and lens, alike in all directions, and a
camera that looks on at a slant, evenly across. Both are fitted and removed. What is left and still smooth is
asymmetry; it counts only if it exceeds the irregularity from cell to cell, which uneven pins make by chance.
A touch straight onto the middle is as symmetric as a dome, and is not detected.
"""

from dataclasses import dataclass

import numpy as np

from edge.cells import Tessellator
from edge.errors import DegenerateLayout
from edge.geometry.parts import parts_of
from edge.types import Array, Complex, Rest, Tracks

ASYMMETRY_MAX = 0.03  # rms relative area that lens and mount make


@dataclass(frozen=True, slots=True)
class RestSymmetry:
    """How symmetric the cells of a rest frame are, as rms relative area."""

    asymmetry: float  # smooth, and neither alike in all directions nor even across
    irregularity: float  # from cell to cell

    @property
    def in_contact(self) -> bool:
        """Whether something touches the tip, as far as that can be seen."""
        return self.asymmetry > max(ASYMMETRY_MAX, self.irregularity)

    @property
    def message(self) -> str:
        """A message for people."""
        return f"its cells are lopsided by {self.asymmetry:.1%}, pin by pin by {self.irregularity:.1%}"


def symmetry_of(rest: Rest) -> RestSymmetry:
    """Asymmetry and irregularity, of several parts those of the worst; too few pins have none."""
    found = [_symmetry_of(part) for _, part in parts_of(rest)]
    return max(found, key=lambda one: (one.in_contact, one.asymmetry))


def _symmetry_of(rest: Rest) -> RestSymmetry:
    pattern = rest.pattern
    all_seen = np.ones(len(rest), dtype=np.bool_)
    try:
        cells = Tessellator(rest).cells(Tracks.of(rest.xy_img, rest.pins.sigma_px, all_seen))
    except DegenerateLayout:
        return RestSymmetry(0.0, 0.0)
    place = np.asarray((rest.xy_img - pattern.centre_img) / pattern.tip_radius_px @ (1, 1j))
    used = (np.abs(place) < 1.0 - pattern.pitch_px / pattern.tip_radius_px) & np.isfinite(cells.area_px2)
    symmetric, smooth = _columns(place[used])
    free_n = int(used.sum()) - symmetric.shape[1] - smooth.shape[1]
    if free_n < smooth.shape[1]:
        return RestSymmetry(0.0, 0.0)
    base = np.linalg.qr(symmetric)[0]
    log_area = np.log(cells.area_px2[used])
    log_area = log_area - base @ (base.T @ log_area)
    base = np.linalg.qr(smooth - base @ (base.T @ smooth))[0]
    found = base.T @ log_area
    variance = float(np.sum((log_area - base @ found) ** 2)) / free_n
    # Irregularity alone leaves its variance in each column.
    asymmetry = max(float(np.sum(found**2)) - base.shape[1] * variance, 0.0) / int(used.sum())
    return RestSymmetry(float(np.sqrt(asymmetry)), float(np.sqrt(variance)))


def _columns(place: Complex) -> tuple[Array, Array]:
    """Terms of a symmetric tip seen at a slant, and smooth terms of any other."""
    square = np.abs(place) ** 2
    symmetric = [np.ones_like(square), square, square**2, square**3, place.real, place.imag]
    other = [
        part
        for order in (1, 2, 3)
        for power in (0, 1, 2)
        if (order, power) != (1, 0)
        for part in ((place**order).real * square**power, (place**order).imag * square**power)
    ]
    return np.column_stack(symmetric), np.column_stack(other)
