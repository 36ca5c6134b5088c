"""The rig's z: which way it counts, and where it is when the tip is first touched.

The deeper the press, the further the pins move apart (their divergence, `c10`), whatever else the touch does.
So a depth or a force that falls meanwhile is counted the other way: z points up, or the gauge gives what the
tip does to it.

An arm gives positions, of which only differences are depths. Frames on both sides of the first touch show
where it is. Where all are pressed, the volume of deformation bounds it, which grows between linearly and with
the square of the depth. The bounds are a millimetre or two apart: they tell a position from a depth, and make
no depth of it.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from calib.axes import CERTAIN
from calib.errors import FitError, TableError
from calib.extract import Extract
from calib.fit_params import PARAMS
from calib.targets import LEAST_DEPTH_MM, MOST, Targets
from edge.calibration.inputs import FRAME_INPUTS
from edge.types import Array, Mask

#: Each value that grows with the press, and the table's column of it.
COLUMNS = {"displacement_mm": "pose_z", "contact_depth_mm": "contact_depth", "force_n": "force_z"}
TOUCH_MM = 0.5  # a depth's zero is known to this: a touch is seen from 0.1 to 0.3 mm on
IDLE_REL = 0.1  # share of a force's range: touches that are not seen have less


@dataclass(frozen=True, slots=True)
class PressAxis:
    """How a column of the table is counted.

    name   the value that it is to be
    sign   1: it grows with the press; -1: it falls; 0: the frames do not show it
    touch  the least and the largest reading times sign at the first touch; None: not known, or a force
    seen   whether frames on both sides of the first touch show that, closely enough to count from there
    idle   of a force, the reading where nothing touches; NaN: as good as 0, or not known
    """

    name: str
    sign: int
    touch: tuple[float, float] | None = None
    seen: bool = False
    idle: float = math.nan

    @property
    def from_zero(self) -> bool:
        """Whether the column is 0 at the first touch, as far as that is known."""
        if self.touch is None:
            return True
        return self.touch[0] <= TOUCH_MM and self.touch[1] >= -TOUCH_MM

    @property
    def zero(self) -> float:
        """Reading times sign at the first touch."""
        return 0.0 if self.touch is None or self.from_zero else round(sum(self.touch) / 2.0, 4)

    @property
    def line(self) -> str:
        """`displacement_mm = 412.3 - pose_z`, and what it rests on."""
        column = COLUMNS[self.name]
        text = f"{'-' if self.sign < 0 else ''}{column}"
        if self.zero:
            text = f"{-self.zero:g} - {column}" if self.sign < 0 else f"{column} {-self.zero:+g}"
        if self.idle == self.idle:
            text += f" ({self.idle:.3g} N where nothing touches: is the gauge tared?)"
        return f"{self.name} = {text}" + (f" (first touch at {self._at_touch})" if self.touch else "")

    @property
    def fault(self) -> str:
        """Why the column is not the value as it stands; "": it is."""
        column = f"column {COLUMNS[self.name]} ({self.name})"
        why = f"{column} falls as the pins move apart; "
        if self.sign < 0 and self.name == "force_n":
            return f"{why}a press pushes: is it what the tip does to the gauge? negate it"
        if self.sign < 0:
            text = f"{why}a depth grows: does z point up? negate it"
            return text if self.from_zero else f"{text}, and count from the first touch, at {self._at_touch}"
        if self.from_zero:
            return ""
        where = f"{column} is {self._at_touch} at the first touch; "
        return f"{where}a depth is 0 there: is it the arm's position? subtract its reading there"

    @property
    def _at_touch(self) -> str:
        low, high = sorted(self.sign * z for z in self.touch or ())
        return f"{low:.2f} to {high:.2f} mm"


def recognise_press(targets: Targets, extract: Extract) -> list[PressAxis]:
    """How each column that grows with a press is counted. Raises TableError: a depth in metres."""
    inputs = extract.inputs[:, [FRAME_INPUTS.index("c10"), FRAME_INPUTS.index("volume")]].real
    known = extract.trusted & np.isfinite(inputs).all(axis=1)
    found = []
    for name in COLUMNS.keys() & targets.values.keys():
        rows = known & np.isfinite(targets.values[name])
        column, apart, volume = targets.values[name][rows], *inputs[rows].T
        sign, touch, seen, idle = _sign(column, apart), None, False, math.nan
        if sign and name == "force_n":
            idle = _idle(column, extract.in_contact[rows])
        elif sign:
            if (span := np.ptp(column)) < LEAST_DEPTH_MM:
                raise TableError(
                    f"{targets.where}: column {COLUMNS[name]} changes by {span:.2g} mm where the pins move "
                    "apart; its unit is mm"
                )
            touch, seen = _first_touch(sign * column, volume, extract.in_contact[rows])
        found.append(PressAxis(name, sign, touch, seen, idle))
    return sorted(found, key=lambda axis: list(COLUMNS).index(axis.name))


def check_press(targets: Targets, extract: Extract) -> None:
    """Raises FitError: a depth or force that falls with the press, or a depth not 0 at the first touch."""
    for axis in recognise_press(targets, extract):
        if axis.fault:
            raise FitError(f"{targets.where}: {axis.fault}")


def along_press(
    targets: Targets, extract: Extract, *, captured: bool, rest_given: bool
) -> tuple[Targets, tuple[str, ...]]:
    """The table with its depths from the first touch and its forces into the tip, and what was found.

    captured    its depths are the rig's own, which are right or refused by a fit
    rest_given  motion counts from an image that is known to be untouched, not from one chosen by the table
    Raises      TableError: a column is no depth, and the frames do not show what would make it one
    """
    values, lines = dict(targets.values), []
    for axis in recognise_press(targets, extract):
        depth, column = axis.name != "force_n", values[axis.name]
        if captured and depth:
            continue
        counted = axis.sign * column - axis.zero if axis.sign else column
        if depth and axis.fault:  # before the first touch nothing is pressed
            counted = np.where(counted < 0.0, 0.0, counted)
        if axis.fault and not rest_given and (depth or not (column == 0.0).any()):
            raise TableError(f"{targets.where}: {axis.fault}, and give --rest an image of the untouched tip")
        if depth and ((not axis.from_zero and not axis.seen) or (axis.sign < 0 and axis.touch is None)):
            step = f"{TOUCH_MM / 5:g} mm"
            raise TableError(
                f"{targets.where}: {axis.fault}, or add frames every {step} from before that touch on"
            )
        if depth and np.nanmax(np.abs(counted)) > MOST["mm"]:
            raise TableError(
                f"{targets.where}: column {COLUMNS[axis.name]}: over {MOST['mm']:g} mm is no depth, and the "
                "frames do not show how it changes with the press; give depths from the first touch on"
            )
        values[axis.name] = counted
        if axis.sign:
            lines.append(axis.line)
    return replace(targets, values=values), tuple(lines)


def _sign(column: Array, apart: Array) -> int:
    """Sign of their correlation; 0: it is not certain, or explains next to nothing."""
    if len(column) < PARAMS.known_rows_min or np.ptp(column) <= PARAMS.variation_min or not np.ptp(apart):
        return 0
    r = float(np.corrcoef(column, apart)[0, 1])
    certain = r * r >= PARAMS.explained_min and abs(r) * math.sqrt(len(column) - 2) >= CERTAIN * math.sqrt(
        1 - r * r
    )
    return int(math.copysign(certain, r))


def _idle(force: Array, in_contact: Mask) -> float:
    """A force (n,) N where nothing touches, if it is more than a light touch could be."""
    if (~in_contact).sum() < PARAMS.known_rows_min:
        return math.nan
    idle = float(np.median(force[~in_contact]))
    return idle if abs(idle) > IDLE_REL * np.ptp(force) else math.nan


def _first_touch(z: Array, volume: Array, in_contact: Mask) -> tuple[tuple[float, float] | None, bool]:
    """Least and largest z (n,) mm at the first touch, and whether frames on both sides of it show that."""
    order = np.argsort(z, kind="stable")
    z, volume, in_contact = z[order], volume[order], in_contact[order]
    # Frames on the wrong side, if the touch were before each of them, or after the last.
    wrong = (
        np.cumsum(np.concatenate([[0], in_contact]))
        + np.cumsum(np.concatenate([[0], ~in_contact[::-1]]))[::-1]
    )
    best = np.flatnonzero(wrong == wrong.min())
    if best[0] > 0 and best[-1] < len(z) and 2 * wrong.min() < min(in_contact.sum(), (~in_contact).sum()):
        low, high = float(z[best[0] - 1]), float(z[best[-1]])
        return (low, high), high - low <= TOUCH_MM
    z, volume = z[in_contact], volume[in_contact]
    if len(z) < PARAMS.known_rows_min or not np.ptp(volume) or not np.ptp(z):
        return None, False
    bounds = []
    for power in (0.5, 1.0):
        extent = np.maximum(volume, 0.0) ** power
        r = float(np.corrcoef(z, extent)[0, 1])
        if r <= 0.0:
            return None, False
        # Either may have the errors: the line through z over the volume, and that through the volume over z.
        steps = r * z.std() / extent.std(), z.std() / (r * extent.std())
        bounds += [float(z.mean() - step * extent.mean()) for step in steps]
    return (min(bounds), max(bounds)), False
