"""The protocol `adaptive`: each batch of poses follows from the frames of those before it.

It begins with poses spread evenly over the range. Then processes are fitted to all frames so far, and of many
possible poses those are taken after which the values are most certain (`calib.next_poses`). It ends with the
number of poses that was asked for, or when the errors expected over the range are small enough.

Rules
- A batch is a function of the frames before it, so that a capture that is resumed goes on as it would have.
- What is wanted of the errors is no part of the protocol: it may be another when a capture is resumed.
- Where nothing can be fitted yet, the poses stay evenly spread.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import astuple, dataclass

import numpy as np
from scipy.stats import qmc

from calib.capture import pose_of
from calib.errors import FitError
from calib.extract import DEMAND, Measured, gather, measure
from calib.fit import fit_processes
from calib.next_poses import choose, covariances, expected_error, predict_inputs
from calib.protocols import FLAT, SURFACE_HIGH, SURFACE_LOW, Step, digest_of, rest_steps, sheared
from calib.rig.base import CLEAR, Pose
from calib.targets import targets_of_capture
from edge.frame import Pipeline
from edge.pins import take_rest
from edge.types import Complex, Frame, Image

STEPS_A_POSE = len(sheared(*SURFACE_LOW))
#: Before each fit, which takes seconds to minutes: the skin creeps under load.
LIFT = Step(CLEAR, FLAT, 0)


@dataclass(frozen=True, slots=True)
class AdaptiveParams:
    """Evidence: docs/tuning.md, "Choice of the next poses"."""

    poses_first: int = 24  # evenly spread
    batch_share: float = 0.25  # poses of a batch, of those before it
    candidates: int = 512  # evenly spread too, among which the others are chosen


PARAMS = AdaptiveParams()


class AdaptivePlan:
    """Steps that follow from the frames so far.

    poses     at most
    goals     errors by name of the value, in its unit: reached when all of them are
    pool      where processes are fitted; None: here
    on_fitted called with the number of poses and the expected errors by name of the value
    """

    name = "adaptive"

    def __init__(
        self,
        poses: int,
        goals: Mapping[str, float] | None = None,
        *,
        pool: Executor | None = None,
        on_fitted: Callable[[int, dict[str, float]], None] = lambda n, errors: None,
    ) -> None:
        self.steps: list[Step] = rest_steps(FLAT)
        self.n_frames = self.steps[0].frames + poses
        self._poses_max, self._goals, self._pool, self._on_fitted = poses, dict(goals or {}), pool, on_fitted
        self._rests: list[Image] = []
        self._pipelines: tuple[Pipeline, Pipeline] | None = None
        self._measured: list[Measured] = []
        self._rows: list[Mapping[str, str]] = []
        unit = qmc.Sobol(len(SURFACE_LOW), seed=0).random(PARAMS.candidates)
        spread = qmc.scale(unit, SURFACE_LOW, SURFACE_HIGH)
        self._spread = [sheared(*values) for values in np.round(spread, 4).tolist()]

    @property
    def digest(self) -> str:
        """Hash of the steps that it may take."""
        return digest_of([*self.steps[:1], *(step for steps in self._spread for step in steps)])

    def recall(self, poses: Mapping[int, Pose]) -> None:
        del self.steps[1:]
        for number, p in sorted(poses.items()):
            if number < len(self.steps):
                continue
            if number == len(self.steps) + STEPS_A_POSE:
                self.steps.append(LIFT)
            values = (p.depth_mm, p.tilt_x_deg, p.tilt_y_deg, p.shear_x_mm, p.shear_y_mm, p.twist_deg)
            self.steps += sheared(*values)

    def review(self, frames: Iterable[tuple[Frame, Mapping[str, str]]]) -> None:
        self._rests.clear()
        self._measured.clear()
        self._rows.clear()
        for frame, row in frames:
            self.take(frame, row)

    def take(self, frame: Frame, row: Mapping[str, str]) -> None:
        if row["role"] == "rest":
            self._rests.append(frame.image)
            return
        if self._pipelines is None:
            rest = take_rest(self._rests)
            self._pipelines = Pipeline(rest, demand=DEMAND), Pipeline(rest, demand=DEMAND)
        pipeline, without = self._pipelines
        self._measured.append(measure(pipeline, frame.image, without))
        self._rows.append(dict(row))

    def grow(self) -> bool:
        taken = len(self._rows)
        before, end = 0, PARAMS.poses_first
        while end <= taken:
            before, end = end, end + round(PARAMS.batch_share * end)
        if taken >= self._poses_max:
            return False
        if self.steps[-1].pose != CLEAR:
            self.steps.append(LIFT)
            return True
        batch = self._batch(before, end - before, check=before == taken)
        new = batch[taken - before : self._poses_max - before]
        for steps in new:
            self.steps += steps
        return bool(new)

    def _batch(self, before: int, count: int, *, check: bool) -> list[list[Step]]:
        """The poses that follow the first `before` frames. check: empty if the goals are reached."""
        if not before:
            return self._spread[:count]
        assert self._pipelines is not None
        rows = self._rows[:before]
        targets = targets_of_capture("frames so far", rows)
        extract = gather(self._measured[:before])
        try:
            found = fit_processes(self._pipelines[0].rest, targets, extract, self._pool)
        except FitError:
            return self._left(rows)[:count]
        usable = np.flatnonzero(found.usable)
        candidates = self._left(rows)
        known = letters_of([pose_of(dict(rows[i])) for i in usable], mirrored=found.mirrored)
        wanted = letters_of([steps[-1].pose for steps in candidates], mirrored=found.mirrored)
        inputs = predict_inputs(known, extract.inputs[usable], wanted)
        errors = {
            name: expected_error(process, inputs)
            for group, process in zip(found.groups, found.fitted, strict=True)
            for name in group.outputs
        }
        self._on_fitted(before, errors)
        if check and self._goals and all(errors.get(k, np.inf) <= v for k, v in self._goals.items()):
            return []
        chosen = choose(covariances(found.fitted, inputs), count)
        return [candidates[i] for i in chosen]

    def _left(self, rows: Sequence[Mapping[str, str]]) -> list[list[Step]]:
        """Poses that were not measured yet."""
        used = {pose_of(dict(row)) for row in rows}
        return [steps for steps in self._spread if steps[-1].pose not in used]


def letters_of(poses: Sequence[Pose], *, mirrored: bool) -> Complex:
    """(n, LETTERS) complex128, in the image's handedness."""
    rows = np.array([astuple(pose) for pose in poses])
    x, y, depth, tilt_x, tilt_y, shear_x, shear_y, twist = rows.T
    letters: Complex = np.column_stack(
        [x + 1j * y, depth + 0j, tilt_x + 1j * tilt_y, shear_x + 1j * shear_y, twist + 0j]
    )
    return letters.conj() if mirrored else letters
