"""Orientation of the rig's axes in the image: rotated, swapped, negated, mirrored.

A model of a vector that rotates with the tip also fits a rotated rig: its weights are complex and take up the
rotation. A mirror is different: half of all rigs have their y axis up, the image has its y down, and then the
truth rotates left when the touch rotates right. So each vector is explained twice, unchanged and mirrored, by
the input that follows it most closely in any touch (mean motion, place of contact), and the better one is
taken. All vectors of one rig are mirrored or none is; if they disagree, a column has the wrong sign, which is
reported.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.terms import frame_terms
from edge.types import Complex

#: Inputs that shear, tilt and place follow most closely.
TERMS: tuple[list[str], ...] = (["c00"], ["p"], ["c11"], ["c21"], ["volume", "p"], ["volume", "c00"], [])
RIDGE = 1e-3  # share of the rows: keeps a few rows from being explained by chance
#: Mean difference of squared errors, each frame's over their sum, over its standard error: below it the data
#: do not decide.
CERTAIN = 4.0
QUARTER_DEG = 15.0  # an axis this close to one of the image's is named after it


@dataclass(frozen=True, slots=True)
class Handedness:
    """The evidence of one vector.

    certain      mean difference of the frames' squared errors, each over their sum, over its standard error;
                 positive for mirrored
    turn_deg     direction of the rig's x in the image, after mirroring, if it is mirrored
    """

    outputs: tuple[str, ...]
    certain: float
    turn_deg: tuple[float, float]

    @property
    def mirrored(self) -> bool:
        return self.certain > 0

    @property
    def known(self) -> bool:
        return abs(self.certain) >= CERTAIN


@dataclass(frozen=True, slots=True)
class Axes:
    """The rig's axes in the image.

    mirrored  outputs -> whether their vector is mirrored against the image
    lines     the relation found, for the user
    warnings  what is ambiguous, or disagrees
    """

    mirrored: dict[tuple[str, ...], bool]
    lines: tuple[str, ...]
    warnings: tuple[str, ...]


def recognise_handedness(
    outputs: tuple[str, ...],
    inputs: Complex,
    y: Complex,
    expected: Complex | None = None,
) -> Handedness:
    """Which of y and its mirror image the inputs explain better.

    inputs    (n, k) complex128, finite, columns `FRAME_INPUTS`
    y         (n,) complex128, the truth x + i y in the rig's axes
    expected  (n,) complex128, not mirrored, by another tip's model: it explains alone; None: there is none
    """
    psi = frame_terms(inputs, TERMS)
    size = np.sqrt((np.abs(psi) ** 2).mean(axis=0))
    psi = psi[:, size > 0] / size[size > 0]
    by = psi if expected is None else expected[:, None] / np.sqrt((np.abs(expected) ** 2).mean())
    gram = by.conj().T @ by + RIDGE * len(y) * np.eye(by.shape[1])
    solved = np.linalg.solve(gram, by.conj().T)
    # Errors of each row by weights fitted without it.
    left_out = 1.0 - np.minimum((by * solved.T).sum(axis=1).real, 0.99)
    straight, mirrored = ((target - by @ (solved @ target)) / left_out for target in (y, y.conj()))
    squares = np.abs(straight) ** 2, np.abs(mirrored) ** 2
    # A share, from -1 to 1: a few frames that all agree are certain, whatever their sizes.
    gain = (squares[0] - squares[1]) / np.maximum(squares[0] + squares[1], 1e-300)
    error = float(gain.std()) / math.sqrt(len(gain))
    certain = float(gain.mean()) / error if error > 0 else 0.0
    # The mean motion carries shear, the place tilt and place: whichever follows y better.
    turn = []
    for target in (y, y.conj()):
        along = [np.vdot(psi[:, k], target - target.mean()) for k in range(min(2, psi.shape[1]))]
        turn.append(math.degrees(float(np.angle(max(along, key=abs)))))
    return Handedness(outputs, certain, (turn[0], turn[1]))


def recognise_axes(vectors: Sequence[Handedness]) -> Axes:
    """Decide from all vectors together: one that is uncertain follows the others."""
    known = [v for v in vectors if v.known]
    sides = {v.mirrored for v in known}
    together = sum(v.certain for v in known) > 0
    mirrored = {v.outputs: (v.mirrored if v.known else together) for v in vectors}
    warnings = []
    if len(sides) == 2:
        parts = [
            f"{' and '.join(v.outputs)} {'is' if v.mirrored else 'is not'} mirrored against the image"
            for v in known
        ]
        warnings.append(
            f"the rig's axes do not agree: {', '.join(parts)}; is the sign of one of these columns wrong?"
        )
    for v in vectors:
        if not v.known and not known:
            warnings.append(
                f"{' and '.join(v.outputs)}: the frames do not show whether the rig's axes are mirrored "
                "against the image; taken as not mirrored (move in more than one direction)"
            )
    lines = tuple(_relation(v, mirrored[v.outputs]) for v in known)
    return Axes(mirrored, lines, tuple(warnings))


def _relation(v: Handedness, mirrored: bool) -> str:
    """`shear_x_mm = image -y, shear_y_mm = image x`."""
    turn = v.turn_deg[1 if mirrored else 0]
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    # The rig's x + i y is the image's, rotated, or its conjugate. Parts of the rig's axes along the image's.
    rows = [(c, -s), (-s, -c) if mirrored else (s, c)]
    parts = []
    for name, (along_x, along_y) in zip(v.outputs, rows, strict=True):
        angle = math.degrees(math.atan2(along_y, along_x))
        quarter = round(angle / 90.0)
        if abs(angle - 90.0 * quarter) <= QUARTER_DEG:
            parts.append(f"{name} = image {('x', 'y', '-x', '-y')[quarter % 4]}")
        else:
            parts.append(f"{name} = image x turned by {angle:.0f} deg")
    return ", ".join(parts) + (" (mirrored)" if mirrored else "")
