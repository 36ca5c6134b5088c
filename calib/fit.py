"""From frames with known truth to a calibration file: the smallest model that predicts held-out frames.

For each output, candidates from the paper's own curve (depth: monotone in the volume; shear: linear in the
mean motion, with an offset for preload) up to cubic products (`calib.designs`) are fitted by ridge regression
(`calib.ridge`). Each is evaluated by grouped cross-validation (frames of one pose stay together), and the one
with the fewest terms is chosen whose squared errors exceed the best's by no more than one standard error of
their difference, and by a tenth at most. Its sigma is the 68.3 % quantile of the held-out errors, divided by
the widening that follows from the distance to the data.

A symmetric Gaussian process (`calib.process_fit`), with the contact's place among its inputs, is a candidate
like the others; so is another tip's model that was changed as these frames say (`calib.carry_over`). If the
axes of a rig are mirrored against the image (`calib.axes`), its vectors are fitted mirrored.

A touch may be too light for a contact with a place. Such frames do not take part in a process, which depends
on the place; they are read by the smallest sufficient of the other candidates, which is kept beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from enum import StrEnum
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from scipy.spatial import cKDTree

from calib.axes import Axes, recognise_axes, recognise_handedness
from calib.carry_over import KnownModel
from calib.curve import CURVE, fit_curve
from calib.designs import GROUPS, MEAN_MOTION, Group, designs, is_round, went_all_round
from calib.errors import FitError
from calib.extract import LOSS_MAX, Extract
from calib.fit_params import PARAMS
from calib.press_axis import check_press
from calib.process_fit import INPUTS, FittedProcess, fit_process
from calib.ridge import (
    Candidate,
    InputNoise,
    Terms,
    as_candidate,
    cross_validate,
    error_of_mean,
    folds_of,
    pose_numbers,
    ridge_weights,
    rounded,
    share_of_pose,
    spread_factor,
)
from calib.targets import Targets
from calib.terms import evaluate_terms, term_columns
from edge.calibration import Calibration
from edge.calibration.checks import is_of_place
from edge.calibration.file import (
    FORMAT,
    TERMS_MAX,
    VERSION,
    CalibrationFile,
    Curve,
    Data,
    Model,
    Pair,
    Polynomial,
    Process,
    Sensor,
    encode,
)
from edge.calibration.inputs import CONTACT_INPUTS, FRAME_INPUTS, MODES
from edge.features.modes import mode_basis
from edge.geometry.parts import parts_of
from edge.types import Array, Complex, Index, Mask, Rest


class ModelKind(StrEnum):
    """Kind of a candidate."""

    PLAIN = "curve"  # the paper's: a curve of the volume, the plain mean motion
    POLYNOMIAL = "polynomial"
    PROCESS = "process"
    CARRIED = "carried over"  # another tip's model, changed


PROCESS_KINDS = (ModelKind.CARRIED, ModelKind.PROCESS)
ENOUGH = 2 * len(INPUTS)  # poses that decide a weight for each input of a process


class Prefer(StrEnum):
    """Which of several sufficient models is taken."""

    SPEED = "speed"  # the one with the fewest terms of those as good as the best
    ACCURACY = "accuracy"  # the best; a process rather than a polynomial as good as it


@dataclass(frozen=True, slots=True)
class Search:
    """The models that are tried, and which of several sufficient ones is taken.

    terms_max  of a process: more are left out, those with the smallest prior variance first
    known      another tip's models, by their outputs
    """

    prefer: Prefer = Prefer.SPEED
    kinds: frozenset[ModelKind] = frozenset(ModelKind)
    terms_max: int = TERMS_MAX
    known: Mapping[tuple[str, ...], KnownModel] = field(default_factory=dict, hash=False)


EVERYTHING = Search()


@dataclass(frozen=True, slots=True)
class Choice:
    """The chosen model for a group of outputs, and what it was chosen from.

    without_contact  the model of touched frames without a contact; None: the same, or none
    allowed   largest rms error on held-out frames of the candidates as good as the best, of which the one
              with fewest terms is chosen
    held_out  (n,) prediction of each frame by a model fitted without it
    truth     (n,) of these frames; share (n,) what each counts
    """

    outputs: tuple[str, ...]
    model: Model
    without_contact: Model | None
    chosen: Candidate
    tried: tuple[Candidate, ...]
    allowed: float
    held_out: Complex
    truth: Complex
    share: Array

    @property
    def best_of_kinds(self) -> dict[str, Candidate]:
        """The candidate of curves, polynomials, processes with the smallest error on held-out frames."""
        kinds: dict[str, Candidate] = {}
        for candidate in sorted(self.tried, key=lambda c: c.rms):
            kinds.setdefault(_kind_of(candidate.name), candidate)
        return kinds

    def cells(self, between: str) -> tuple[str, ...]:
        """For a table: outputs, model, terms, its error, the largest allowed, the best of kinds, sigmas."""
        sigma = self.model.sigma if isinstance(self.model.sigma, list) else [self.model.sigma]
        return (
            between.join(self.outputs),
            self.chosen.name,
            str(self.chosen.n_terms),
            f"{self.chosen.rms:.3g}",
            f"{self.allowed:.3g}",
            between.join(f"{kind.split()[0]} {best.rms:.3g}" for kind, best in self.best_of_kinds.items()),
            between.join(f"{s:.3g}" for s in sigma),
        )


def _kind_of(name: str) -> ModelKind:
    if name in (CURVE, MEAN_MOTION):
        return ModelKind.PLAIN
    return ModelKind(name) if name in PROCESS_KINDS else ModelKind.POLYNOMIAL


def fit(
    rest: Rest,
    targets: Targets,
    extract: Extract,
    *,
    serial: str = "unnamed",
    estimated: bool = False,
    mm_per_px: float | None,
    on_part: Callable[[float], None] = lambda groups: None,
    on_refused: Callable[[str], None] = lambda text: None,
    on_axes: Callable[[Axes], None] = lambda axes: None,
    search: Search = EVERYTHING,
    pool: Executor | None = None,
) -> tuple[Calibration, list[Choice]]:
    """Fit everything that the table has columns for.

    estimated  whether no image showed the rest frame
    mm_per_px  scale on the tip; None: from contacts in known places, if there are any
    on_part    called with what was done since the last call, a part of a group of outputs; each that varies
               adds up to 1
    on_refused called with the reason why a group was skipped: its values will be sent as invalid
    on_axes    called with the orientation of the rig's axes in the image
    search     what is tried, and which of several sufficient models is taken
    pool       where processes are fitted, a job for each group; None: here
    Returns    the calibration, and how each model was chosen
    Raises     FitError: nothing could be fitted; the message says what the data lack, naming the rows. Or a
               depth or force does not grow with the press (`calib.press_axis`).
               CalibrationError: the rest frame is not a plausible tip
    """
    sensor = msgspec.structs.replace(sensor_of(rest, serial), estimated=estimated)
    _checked(sensor, mm_per_px, [], Data("", "", 0, ""))
    rows_min = PARAMS.known_rows_min if search.known else PARAMS.rows_min
    usable = _usable_frames(targets, extract, len(rest), rows_min)
    check_press(targets, extract)
    choices: list[Choice] = []
    refused: list[str] = []
    problems = list(_problems(rest, targets, extract, usable))
    axes = _axes(problems, search.known)
    on_axes(axes)
    problems = [problem.in_the_image(axes) for problem in problems]
    started = [_start_processes(problem.rows(problem.in_contact), search, pool) for problem in problems]
    for problem, processes in zip(problems, started, strict=True):
        for result in _choose(problem, processes, search, on_part):
            on_part(0.5)
            if isinstance(result, FitError):
                refused.append(str(result))
                on_refused(str(result))
            else:
                choices.append(result)
    if not choices:
        nothing = (
            f"{targets.where}: no column varies by more than {PARAMS.variation_min} over its "
            f"{len(targets)} frames; nothing could be fitted"
        )
        raise FitError(refused[0] if refused else nothing)
    choices.sort(key=lambda choice: [group.outputs for group in GROUPS].index(choice.outputs))
    scale = mm_per_px or _scale(targets, extract, rest)
    of_place = any(is_of_place(c.model) for c in choices)
    without = [c.without_contact for c in choices if c.without_contact] if of_place else None
    return _checked(sensor, scale, [c.model for c in choices], _data(targets, usable), without), choices


def _data(targets: Targets, usable: Mask) -> Data:
    """The file's statement on the frames."""
    return Data(
        source=", ".join(Path(part).name for part in targets.where.split(", ")),
        sha256=targets.sha256,
        n_frames=int(usable.sum()),
        created=datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
    )


@dataclass(frozen=True, slots=True)
class Processes:
    """The processes of all groups that there are frames enough for.

    usable    (frames,) bool, those that they were fitted to
    mirrored  whether the rig's axes are mirrored against the image
    """

    groups: tuple[Group, ...]
    fitted: tuple[FittedProcess, ...]
    usable: Mask
    mirrored: bool


def fit_processes(rest: Rest, targets: Targets, extract: Extract, pool: Executor | None = None) -> Processes:
    """The processes alone. Raises FitError: too few frames can be used, or none varies."""
    usable = _usable_frames(targets, extract, len(rest), PARAMS.rows_min) & _with_place(extract.inputs)
    problems = [p for p in _problems(rest, targets, extract, usable) if not p.groups[0].of_contact]
    axes = _axes(problems, {})
    problems = [problem.in_the_image(axes) for problem in problems]
    jobs = [job for problem in problems for job in _start_processes(problem, EVERYTHING, pool)]
    groups = [group for problem in problems for group in problem.groups]
    found = [(g, run()) for g, job in zip(groups, jobs, strict=True) for run in job.values()]
    if not found:
        raise FitError(f"{targets.where}: {int(usable.sum())} usable frames are too few for a process")
    groups_found, processes = zip(*found, strict=True)
    return Processes(groups_found, processes, usable, any(axes.mirrored.values()))


def groups_of(targets: Targets) -> list[Group]:
    """Groups of outputs that the table has columns for."""
    return [group for group in GROUPS if all(name in targets.values for name in group.truth)]


def sensor_of(rest: Rest, serial: str) -> Sensor:
    """The file's description of a tip, from its rest frame."""
    p = rest.pattern
    return Sensor(
        serial=serial,
        size_px=p.size_px,
        pin_radius_px=p.pin_radius_px,
        pitch_px=p.pitch_px,
        centre_px=(float(p.centre_img[0]), float(p.centre_img[1])),
        tip_radius_px=p.tip_radius_px,
        background=p.background,
        brightness=p.brightness,
        noise=p.noise,
        rest_xy_px=[(round(float(x), 3), round(float(y), 3)) for x, y in rest.xy_img],
        lens=p.lens,
        on_surface=p.on_surface,
    )


def tip_of(rest: Rest) -> Calibration:
    """A calibration without models: to compare another rest frame with its tip."""
    sensors = [sensor_of(own, "unnamed") for _, own in parts_of(rest)]
    files = [CalibrationFile(FORMAT, VERSION, one, None, [], Data("", "", 0, "")) for one in sensors]
    return of_views([Calibration(file) for file in files])


def of_views(views: Sequence[Calibration]) -> Calibration:
    """One calibration of those of all views of a skin. Raises CalibrationError: they do not fit together."""
    content = msgspec.structs.replace(views[0].content, views=[view.content for view in views[1:]])
    return Calibration.of(content, "the calibration fitted")


def _checked(
    sensor: Sensor,
    mm_per_px: float | None,
    models: list[Model],
    data: Data,
    without: list[Model] | None = None,
) -> Calibration:
    """The calibration after encoding and checking. Raises CalibrationError."""
    content = CalibrationFile(FORMAT, VERSION, sensor, mm_per_px, models, data, without)
    return Calibration.parse(encode(content), "the calibration fitted")


def _usable_frames(targets: Targets, extract: Extract, pins_n: int, rows_min: int) -> Mask:
    """(frames,) bool: identities certain, touched, inputs computed. Raises FitError: too few, and why.

    With more pins lost than the effect of a loss is learnt for, one frame may spoil a model of all.
    """
    reasons = {
        "pins not identified": ~extract.trusted,
        f"more than {LOSS_MAX:.0%} of the pins lost": extract.seen_n < (1.0 - LOSS_MAX) * pins_n,
        "nothing touches": ~extract.in_contact,
        "motion not computed": ~np.isfinite(extract.inputs[:, FRAME_INPUTS.index("c00")]),
    }
    usable: Mask = np.ones(len(targets), dtype=np.bool_)
    why = []
    for message, bad in reasons.items():
        new = np.flatnonzero(usable & bad)
        usable[new] = False
        if len(new):
            why.append(f"{message} in {len(new)} (first: {targets.frames[new[0]].name})")
    if usable.sum() < rows_min:
        fewer = f" ({PARAMS.known_rows_min} with --prior)" if rows_min > PARAMS.known_rows_min else ""
        raise FitError(
            f"{targets.where}: {int(usable.sum())} of {len(targets)} frames can be used, at least "
            f"{rows_min}{fewer} are needed" + "".join(f"; {message}" for message in why)
        )
    return usable


def _scale(targets: Targets, extract: Extract, rest: Rest) -> float | None:
    """mm per px, from contacts whose place on the tip is known; None: there are too few, or all in one place.

    The spread of the places in the image over that of the true ones; independent of the rig's axes.
    """
    if not {"contact_x_mm", "contact_y_mm"} <= targets.values.keys():
        return None
    true = targets.values["contact_x_mm"] + 1j * targets.values["contact_y_mm"]
    seen = extract.contact[:, 0] * rest.pattern.tip_radius_px
    rows = extract.trusted & np.isfinite(true) & np.isfinite(seen)
    if rows.sum() < PARAMS.rows_min or np.ptp(np.abs(true[rows])) < PARAMS.variation_min:
        return None
    true, seen = true[rows] - true[rows].mean(), seen[rows] - seen[rows].mean()
    along = max(abs(np.vdot(seen, true)), abs(np.vdot(seen, true.conj())))
    return rounded(float(along / np.vdot(seen, seen).real))


@dataclass(frozen=True)
class _Observed:
    """What was seen of some frames. All problems of these share it; an array is made when it is wanted.

    which     (n,) the frames of the extract
    possible  errors of the inputs
    motion    (r, modes), whose products with modes are as far apart as the pins' motion
    """

    extract: Extract
    which: Index
    possible: InputNoise
    motion: Complex
    parts: dict[bytes, _Observed] = field(default_factory=dict)

    @cached_property
    def inputs(self) -> Complex:
        """(n, k) complex128, of the frame."""
        return self.extract.inputs[self.which]

    @cached_property
    def lossy(self) -> Complex:
        """(n, losses, k) complex128, the same with pins removed."""
        return self.extract.lossy[self.which]

    @cached_property
    def noise(self) -> Complex:
        """(draws, n, k) complex128."""
        return self.possible.draws()

    def rows(self, chosen: Mask) -> _Observed:
        """Of some of the frames."""
        key = chosen.tobytes()
        if key not in self.parts:
            possible = replace(self.possible, rows=self.possible.rows[chosen])
            self.parts[key] = _Observed(self.extract, self.which[chosen], possible, self.motion)
        return self.parts[key]


@dataclass(frozen=True, slots=True)
class _Problem:
    """Groups of outputs of one spin over the same frames: they share terms and linear algebra.

    seen       of the frames
    contact    (n, k) complex128, inputs of the contact, which it is about; None: it is about the frame
    y          (n, groups) complex128, truth
    fold       (n,) of the cross-validation
    pose       (n,) number of each frame's: frames of one pose count as one
    all_round  whether shear, tilt or place cover all directions
    where, frames  the table and the frames' names, for messages
    mirrored   groups whose y is the truth's mirror image: the rig's axes are mirrored against the image
    """

    groups: tuple[Group, ...]
    seen: _Observed
    contact: Complex | None
    y: Complex
    fold: Index
    pose: Index
    all_round: bool
    where: str
    frames: tuple[str, ...]
    mirrored: frozenset[Group] = frozenset()

    @property
    def inputs(self) -> Complex:
        return self.seen.inputs if self.contact is None else self.contact

    @property
    def names(self) -> tuple[str, ...]:
        return CONTACT_INPUTS if self.groups[0].of_contact else FRAME_INPUTS

    @property
    def real(self) -> bool:
        """Whether each group is one real output; else two, as x + i y."""
        return len(self.groups[0].outputs) == 1

    @property
    def in_contact(self) -> Mask:
        """(n,) whether the frame has a contact."""
        return _with_place(self.seen.inputs)

    def rows(self, chosen: Mask) -> _Problem:
        """Some of the frames."""
        if chosen.all():
            return self
        pose = pose_numbers(self.pose[chosen, None].astype(np.float64))
        frames = tuple(name for name, use in zip(self.frames, chosen, strict=True) if use)
        return replace(
            self,
            seen=self.seen.rows(chosen),
            contact=None if self.contact is None else self.contact[chosen],
            y=self.y[chosen],
            pose=pose,
            fold=folds_of(pose[:, None].astype(np.float64)),
            frames=frames,
        )

    def terms(self, names: list[list[str]]) -> Terms:
        noise = self.seen.noise if self.contact is None else None
        return Terms(self.inputs, noise, term_columns(names, self.names), self.real, self.share)

    @property
    def share(self) -> Array:
        return share_of_pose(self.pose)

    def in_the_image(self, axes: Axes) -> _Problem:
        """The same problem with the truth of mirrored vectors mirrored."""
        mirrored = [axes.mirrored.get(group.outputs, False) for group in self.groups]
        y = np.where(mirrored, self.y.conj(), self.y)
        return replace(
            self, y=y, mirrored=frozenset(g for g, m in zip(self.groups, mirrored, strict=True) if m)
        )


def _with_place(inputs: Complex) -> Mask:
    """(n,) whether a frame has a contact; its inputs are 0 otherwise."""
    return np.asarray(inputs[:, FRAME_INPUTS.index("size")] != 0)


def _axes(problems: Sequence[_Problem], models: Mapping[tuple[str, ...], KnownModel]) -> Axes:
    """Orientation of the rig's axes in the image, from all vectors that cover more directions than one."""
    found = []
    for problem in problems:
        known = np.isfinite(problem.seen.inputs).all(axis=1)
        for group, y in zip(problem.groups, problem.y.T, strict=True):
            if len(group.outputs) == 2 and is_round(np.stack([y.real, y.imag])[:, known]):
                inputs, expected = problem.seen.inputs[known], None
                if group.outputs in models:
                    model = models[group.outputs].in_the_image(inputs)
                    expected = model.values(inputs)
                found.append(recognise_handedness(group.outputs, inputs, y[known], expected))
    return recognise_axes(found)


_Jobs = Mapping[ModelKind, Callable[[], FittedProcess]]


def _start_processes(problem: _Problem, search: Search, pool: Executor | None) -> list[_Jobs]:
    """Functions for each group that return a process of these frames alone, and one carried over.

    Without those that are not wanted, and those that frames or inputs are missing for.
    """
    poses = int(problem.pose.max(initial=-1)) + 1
    if problem.contact is not None or not np.isfinite(problem.inputs).all():
        return [{} for _ in problem.groups]
    jobs: list[_Jobs] = []
    for group, y in zip(problem.groups, problem.y.T, strict=True):
        call = partial(
            _fit_process,
            possible=problem.seen.possible,
            y=y,
            symmetry=group.symmetry,
            fold=problem.fold,
            lossy=problem.seen.lossy,
            all_round=problem.all_round,
            pose=problem.pose,
            motion=problem.seen.motion,
        )
        calls: dict[ModelKind, Callable[[], FittedProcess]] = {}
        # Fewer poses decide a weight for all modes, if they repeat.
        if poses >= (PARAMS.process_rows_min if poses == len(y) else PARAMS.rows_min):
            calls[ModelKind.PROCESS] = partial(call, problem.inputs, terms_max=search.terms_max)
        if len(y) >= PARAMS.known_rows_min and group.outputs in search.known:
            known = search.known[group.outputs].in_the_image(problem.inputs)
            calls[ModelKind.CARRIED] = partial(call, problem.inputs, known=known)
        wanted = {kind: run for kind, run in calls.items() if kind in search.kinds}
        jobs.append(wanted if pool is None else {k: pool.submit(run).result for k, run in wanted.items()})
    return jobs


def _fit_process(inputs: Complex, possible: InputNoise, **given: Any) -> FittedProcess:
    """A job for another process, which makes the noise itself: half of the memory of a job that waits."""
    return fit_process(inputs, moved=list(possible.draws()), **given)


def _poses_that_count(poses: Array, inputs: Complex) -> Index:
    """(n,) number of each frame's pose, or its own: the poses are too few, or not all that the frames show.

    The table may lack what tells poses apart; then most frames move most like one of another pose.
    """
    pose, own = pose_numbers(poses), np.arange(len(poses), dtype=np.int32)
    repeated = np.flatnonzero(np.bincount(pose)[pose] > 1)
    if int(pose.max(initial=0)) < PARAMS.rows_min - 1 or not len(repeated):
        return own
    motion = inputs[:, [FRAME_INPUTS.index(name) for name in MODES]]
    places = np.hstack([motion.real, motion.imag])
    nearest = cKDTree(places).query(places[repeated], [2])[1][:, 0]
    return pose if np.mean(pose[nearest] == pose[repeated]) > 0.5 else own


def _problems(rest: Rest, targets: Targets, extract: Extract, usable: Mask) -> Iterator[_Problem]:
    """All groups of outputs that the table has and that vary."""
    alike: dict[tuple[int, bool, bool, bytes], list[tuple[Group, Mask, Complex]]] = {}
    for group in GROUPS:
        truth = _truth(group, targets, extract, usable)
        if truth is not None:
            rows, y = truth
            key = group.spin, group.of_contact, group.fitted, rows.tobytes()
            alike.setdefault(key, []).append((group, rows, y))
    poses = targets.poses
    # The error of a mode's coefficient is a mean over the errors of the pins, along x and along y.
    pattern = rest.pattern
    off = PARAMS.pin_noise * pattern.pitch_px / pattern.tip_radius_px * np.sqrt(2.0 / len(rest))
    motion: Complex = np.linalg.qr(mode_basis(rest))[1]
    shared: dict[bytes, _Observed] = {}
    for (_, of_contact, _, chosen), members in alike.items():
        groups, (rows, *_), columns = zip(*members, strict=True)
        if chosen not in shared:
            which = np.flatnonzero(rows).astype(np.int32)
            every = np.arange(len(which), dtype=np.int32)
            possible = InputNoise((len(which), extract.inputs.shape[1]), off, every)
            shared[chosen] = _Observed(extract, which, possible, motion)
        yield _Problem(
            groups=groups,
            seen=shared[chosen],
            contact=extract.contact[rows] if of_contact else None,
            y=np.column_stack(columns),
            fold=folds_of(poses[rows]),
            pose=_poses_that_count(poses[rows], extract.inputs[rows]),
            all_round=went_all_round(targets, rows),
            where=targets.where,
            frames=tuple(path.name for path, use in zip(targets.frames, rows, strict=True) if use),
        )


def _truth(group: Group, targets: Targets, extract: Extract, usable: Mask) -> tuple[Mask, Complex] | None:
    """Which frames have the group's truth, and the truth; None: no such columns, or they do not vary."""
    if any(name not in targets.values for name in group.truth):
        return None
    parts = [targets.values[name] for name in group.truth]
    rows = usable & np.all(np.isfinite(parts), axis=0)
    if not any(_varies(part[rows]) for part in parts):
        return None
    if group.of_contact:
        rows &= np.isfinite(extract.contact[:, CONTACT_INPUTS.index("fitted_p" if group.fitted else "p")])
        if group.fitted and rows.sum() < PARAMS.rows_min:
            return None  # made by an extract without fits
    y = np.zeros(int(rows.sum()), dtype=np.complex128)
    y.real = parts[0][rows]
    if len(parts) == 2:
        y.imag = parts[1][rows]
    return rows, y


def _varies(column: Array) -> bool:
    return bool(column.size) and float(np.ptp(column)) > PARAMS.variation_min


_Tried = tuple[Candidate, list[list[str]], Complex]


def _choose(
    problem: _Problem, processes: Sequence[_Jobs], search: Search, on_part: Callable[[float], None]
) -> Iterator[Choice | FitError]:
    """One model for each group."""
    n, poses = len(problem.inputs), problem.share.sum()
    tried: list[list[_Tried]] = [[] for _ in problem.groups]
    candidates = list(designs(problem.groups[0], problem.all_round))
    for name, terms in candidates:
        on_part(0.5 * len(problem.groups) / len(candidates))
        if [] not in terms:
            terms = [*terms, []]  # preload: the paper's offset at zero shear
        if (
            poses < max(PARAMS.rows_min, len(terms) * PARAMS.rows_per_term)
            or _kind_of(name) not in search.kinds
        ):
            continue
        results = cross_validate(name, problem.terms(terms), problem.y, problem.fold)
        for known, (candidate, predicted) in zip(tried, results, strict=True):
            known.append((candidate, terms, predicted))
    for i, (group, known, jobs) in enumerate(zip(problem.groups, tried, processes, strict=True)):
        if n < PARAMS.rows_min and not jobs:
            why = f"{n} usable frames, {PARAMS.rows_min} are needed"
            yield FitError(f"{problem.where}: {' and '.join(group.outputs)}: {why}")
        else:
            yield _best(problem, i, known, {kind: run() for kind, run in jobs.items()}, search)


def _best(
    whole: _Problem,
    i: int,
    of_all: list[_Tried],
    processes: Mapping[ModelKind, FittedProcess],
    search: Search,
) -> Choice | FitError:
    """The smallest model of group i that is as good as the best, or what `Prefer.ACCURACY` takes.

    of_all  models of all frames; a process is one of those with a contact, and compared on these
    """
    outputs, y = whole.groups[i].outputs, whole.y[:, i]
    curve = _curve(whole, i) if ModelKind.PLAIN in search.kinds else None
    if curve is not None:
        of_all.insert(0, (curve[1], [], curve[2]))
    rows = whole.in_contact if processes else np.ones(len(y), np.bool_)
    problem, tried = whole.rows(rows), [_on_rows(one, rows, y, whole.share) for one in of_all]
    y = problem.y[:, i]
    for kind, one in processes.items():
        squares = np.abs(one.held_out - y) ** 2
        candidate = as_candidate(kind, len(one.terms), squares, problem.share, one.pin_noise)
        tried.append((candidate, one.terms, one.held_out))
    tried = _with_a_prior(tried, y, problem.share)
    if not tried:
        return FitError(f"{whole.where}: {' and '.join(outputs)}: no model of the kinds that are wanted")
    best, _, predicted = min(tried, key=lambda t: t[0].rms)
    explained = _explained(best, y)
    if explained < PARAMS.explained_min:
        worst = ", ".join(problem.frames[k] for k in np.argsort(-np.abs(predicted - y))[:5])
        return FitError(
            f"{whole.where}: {' and '.join(outputs)} cannot be predicted from these frames (the best "
            f"model explains {max(0.0, explained):.0%} of the variance); largest errors: {worst}"
        )
    good = _sufficient(tried, y, problem.share, search.prefer)
    allowed = max(t[0].rms for t in good)
    chosen, _, predicted = min(good, key=_terms_then_error)
    mirror = _mirrored if whole.groups[i] in whole.mirrored else lambda model: model

    def of_all_frames(name: str) -> Model:
        candidate, terms, held_out = next(t for t in of_all if t[0].name == name)
        if curve is not None and name == CURVE:
            return curve[0]
        return mirror(_polynomial(whole, i, terms, candidate.ridge, held_out))

    kind = _kind_of(chosen.name)
    if kind not in processes:
        model, of_light_touch = of_all_frames(chosen.name), None
    else:
        process = _process(problem, i, processes[kind])
        if kind is ModelKind.CARRIED:
            process = _valid_too(process, search.known[outputs])
        model = mirror(process)
        good = _sufficient(of_all, whole.y[:, i], whole.share, Prefer.SPEED)
        simple = min(good, key=_terms_then_error)[0] if good else None
        known = simple is not None and _explained(simple, whole.y[:, i]) >= PARAMS.explained_min
        of_light_touch = of_all_frames(simple.name) if simple is not None and known else None
    if mirror is _mirrored:
        predicted, y = predicted.conj(), y.conj()
    all_tried, held_out = tuple(t[0] for t in tried), np.asarray(predicted, np.complex128)
    return Choice(outputs, model, of_light_touch, chosen, all_tried, allowed, held_out, y, problem.share)


def _curve(problem: _Problem, i: int) -> tuple[Curve, Candidate, Complex] | None:
    """The paper's curve of the depth over the volume; None: another output, too few frames, no such curve."""
    volume, y = problem.inputs[:, 0].real, problem.y[:, i].real
    of_depth = problem.groups[i].outputs == ("displacement_mm",)
    enough = len(y) >= PARAMS.rows_min and bool(np.all(np.isfinite(problem.inputs[:, 0])))
    return fit_curve(volume, y, problem.fold) if of_depth and enough else None


def _on_rows(tried: _Tried, rows: Mask, y: Complex, share: Array) -> _Tried:
    """The same model, and its error on some of the frames."""
    if rows.all():
        return tried
    candidate, terms, predicted = tried
    squares = np.abs(predicted - y) ** 2
    noise = max(0.0, candidate.rms**2 - float(np.average(squares, weights=share)))
    return (
        as_candidate(candidate.name, candidate.n_terms, squares[rows], share[rows], noise, candidate.ridge),
        terms,
        predicted[rows],
    )


def _explained(candidate: Candidate, y: Complex) -> float:
    """Share of the variance that a model explains on held-out frames."""
    return 1.0 - candidate.rms**2 / float((np.abs(y - y.mean()) ** 2).mean())


def _with_a_prior(tried: list[_Tried], y: Complex, share: Array) -> list[_Tried]:
    """The models without a process of few poses of their own, if another tip's model is as good as the best.

    So few do not decide a weight for each input, and such a process may look better than it is.
    """
    carried = next((t for t in tried if t[0].name == ModelKind.CARRIED), None)
    if carried is None or share.sum() >= ENOUGH:
        return tried
    best, _, predicted = min(tried, key=lambda t: t[0].rms)
    if not _as_good(carried, best, predicted, y, share):
        return tried
    return [t for t in tried if t[0].name != ModelKind.PROCESS]


def _sufficient(tried: list[_Tried], y: Complex, share: Array, prefer: Prefer) -> list[_Tried]:
    """The models as good as the best. One carried over is as fast as the user chose for the other tip."""
    if not tried:
        return []
    best, _, predicted = min(tried, key=lambda t: t[0].rms)
    good = [t for t in tried if _as_good(t, best, predicted, y, share)]
    among = good if share.sum() < ENOUGH else [t for t in good if t[0] is best]
    if prefer is Prefer.SPEED and not any(_kind_of(t[0].name) is ModelKind.CARRIED for t in among):
        # Few poses may not tell whether a smaller model errs clearly more: then none is taken for speed.
        shown = [t for t in good if _as_good(t, best, predicted, y, share, shown=True)]
        if len(shown) > 1:
            return shown
    # The best of many polynomials looks better than it is, most of all in few poses; a process is one try.
    processes = [t for t in good if _kind_of(t[0].name) in PROCESS_KINDS]
    return [min(processes or good, key=lambda t: t[0].rms)]


def _terms_then_error(tried: _Tried) -> tuple[int, float]:
    return tried[0].n_terms, tried[0].rms


def _as_good(
    tried: _Tried, best: Candidate, predicted: Complex, y: Complex, share: Array, *, shown: bool = False
) -> bool:
    """Whether a model errs more than the best by no more than one standard error of the difference.

    Frames that are hard for all models are in the errors of each, not in their difference. In few poses that
    error is large because they do not tell: then a model that errs clearly more is not as good. One frame
    that is far from all others does not decide against a process of many, whose sigma says so.

    shown  it must not err clearly more even if the difference is one standard error larger
    """
    more = np.abs(tried[2] - y) ** 2 - np.abs(predicted - y) ** 2
    error = error_of_mean(more, share)
    allowed = min(error, PARAMS.worse_max * best.rms**2 - shown * error)
    worse = tried[0].rms ** 2 - best.rms**2
    kind, few = _kind_of(tried[0].name), share.sum() < ENOUGH
    if kind is ModelKind.CARRIED or (kind is ModelKind.PROCESS and not few):
        worse -= max(0.0, float((share * more).max()) / float(share.sum()))
    return worse <= (error if few and kind is ModelKind.CARRIED else allowed)


def _polynomial(
    problem: _Problem, i: int, terms: list[list[str]], ridge: float, held_out: Complex
) -> Polynomial:
    """The chosen model of group i on all frames, with its range, sigma and spread."""
    outputs, y = problem.groups[i].outputs, problem.y[:, i]
    values = problem.terms(terms)
    weights = ridge_weights(values, y, ridge)
    spread = spread_factor(values, ridge)
    psi = evaluate_terms(problem.inputs, values.columns)
    widening = np.sqrt(1.0 + (np.abs(psi @ spread.T) ** 2).sum(axis=1))
    errors = np.abs([(held_out - y).real, (held_out - y).imag][: len(outputs)]) / widening
    sigma = [max(1e-6, rounded(float(np.quantile(e, 0.6827)))) for e in errors]
    if not problem.real and not (_varies(y.real) and _varies(y.imag)):
        sigma = [max(sigma)] * 2
    return Polynomial(
        outputs=list(outputs),
        terms=terms,
        weights=[(rounded(w.real), rounded(w.imag)) for w in weights],
        valid=_valid(y, real=problem.real),
        sigma=sigma,
        spread=[[(rounded(v.real, 3), rounded(v.imag, 3)) for v in row] for row in spread],
    )


def _process(problem: _Problem, i: int, fitted: FittedProcess) -> Process:
    """The process in the file's form."""
    noise, across = fitted.noise, fitted.across
    return Process(
        outputs=list(problem.groups[i].outputs),
        terms=fitted.terms,
        weights=[(rounded(w.real, 8), rounded(w.imag, 8)) for w in fitted.weights],
        valid=_valid(problem.y[:, i], real=problem.real),
        sigma=[rounded(float(s)) for s in fitted.sigma],
        factor=[[(rounded(v.real, 4), rounded(v.imag, 4)) for v in row] for row in fitted.factor],
        far=rounded(fitted.far),
        noise_terms=noise.terms,
        noise_weights=[rounded(float(w)) for w in noise.weights],
        noise_range=(rounded(noise.low), rounded(noise.high)),
        across_weights=[] if across is None else [rounded(float(w)) for w in across.weights],
        across_range=(0.0, 0.0) if across is None else (rounded(across.low), rounded(across.high)),
        lost=fitted.lost,
    )


def _valid(y: Complex, *, real: bool) -> list[tuple[float, float]]:
    """Range of each output in the data."""
    if real:
        return [(round(float(y.real.min()), 4), round(float(y.real.max()), 4))]
    # A range known in one direction holds in all: the tip is round.
    far = round(float(np.abs([y.real, y.imag]).max()), 4)
    return [(-far, far), (-far, far)]


def _valid_too(model: Process, known: KnownModel) -> Process:
    """The model, valid where the other tip's is, too; beyond its own frames sigma grows."""
    ends = [np.transpose(both) for both in zip(model.valid, known.valid, strict=True)]
    valid = [(float(low.min()), float(high.max())) for low, high in ends]
    return msgspec.structs.replace(model, valid=valid, own=model.valid)


def _mirrored(model: Polynomial | Process) -> Polynomial | Process:
    """The model whose value is the conjugate: of conjugate inputs, with conjugate weights."""
    terms = [[name[:-1] if name.endswith("*") else f"{name}*" for name in term] for term in model.terms]

    def conjugate(row: list[Pair]) -> list[Pair]:
        return [(re, -im) for re, im in row]

    weights = conjugate(model.weights)
    if isinstance(model, Polynomial):
        spread = [conjugate(row) for row in model.spread]
        return msgspec.structs.replace(model, terms=terms, weights=weights, spread=spread)
    factor = [conjugate(row) for row in model.factor]
    return msgspec.structs.replace(model, terms=terms, weights=weights, factor=factor)
