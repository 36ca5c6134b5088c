"""From frames with known truth to a calibration file: the smallest model that predicts what it has not seen.

Models are polynomials in the complex modes of motion (`edge.features.modes`). Rotating tip and touch
together must rotate shear and tilt and leave depth and torsion alone, so only products of equal total
spin can take part: 14 terms instead of 210 for a quadratic shear. That is why fifty frames make a usable
calibration and why a sweep along one axis calibrates the others.

For each output, candidates from the paper's own curve (depth: monotone in the volume; shear: linear in the
mean motion, with an offset for preload) up to cubic products are fitted by ridge regression. Each is judged
by grouped cross-validation (frames of one pose stay together), and the one with the fewest terms within
one standard error of the best wins. Its sigma is the 68.3 % quantile of the held-out errors, over the
widening that the distance from the data gives.

A rig shows the tip at its best; in use pins are lost, dazzled, guessed. So the terms are also told how they
move when every pin is off by `PIN_NOISE`, and weights that would blow that up cost as much as errors do. A
plain ridge, which knows the terms' sizes alone, picks products of modes that say much of clean frames and
nothing of others (figures beside the constant).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression

from calib.errors import FitError
from calib.extract import Extract
from calib.targets import Targets
from edge.calibration import (
    CONTACT_INPUTS,
    FORMAT,
    FRAME_INPUTS,
    MODES,
    VERSION,
    Calibration,
    CalibrationFile,
    Curve,
    Data,
    Moments,
    Sensor,
    evaluate_terms,
    sensor_of,
    term_columns,
)
from edge.types import Array, Complex, Index, Mask, Rest

__all__ = [
    "Candidate",
    "Choice",
    "cross_validated_curve",
    "cross_validated_terms",
    "fit",
    "letters",
    "paper_curve",
    "terms_of_spin",
    "tip_of",
]

Letters = Sequence[tuple[str, int]]


@dataclass(frozen=True, slots=True)
class Group:
    """Values fitted together, and what they may depend on.

    outputs  one real value, or two as x + i y
    spin     0: does not change when tip and touch are turned together; 1: turns with them
    """

    outputs: tuple[str, ...]
    spin: int
    of_contact: bool = False


GROUPS = (
    Group(("displacement_mm",), 0),
    Group(("force_n",), 0),
    Group(("contact_area_mm2",), 0),
    Group(("tilt_x_deg", "tilt_y_deg"), 1),
    Group(("shear_x_mm", "shear_y_mm"), 1),
    Group(("torsion_deg",), 0),
    Group(("contact_x_mm", "contact_y_mm"), 1, of_contact=True),
    Group(("contact_depth_mm",), 0, of_contact=True),
)
#: (degree of the modes, factors in a product), from simple to rich. Richer ones than these gained nothing on
#: the published recordings and need more frames than a rig likes to take.
SIZES = ((0, 1), (1, 1), (2, 1), (3, 1), (5, 1), (1, 2), (2, 2), (3, 2), (4, 2), (5, 2), (2, 3))
#: Terms one spin off, in the same measure: what a rig's axis that misses the tip's own brings in. On the
#: published set they halve the depth's error, and gain nothing elsewhere.
OFF_AXIS = ((2, 1), (2, 2))
ROUND_MIN = 0.1  # smaller over larger variance of shear, tilt or place: below it, they went one way only
RIDGES = tuple(10.0 ** (k / 2) for k in range(-8, 7))
#: What a pin may be off in use, in pitches, of each coordinate. Mean error of the depth in um, ball anywhere,
#: 150 frames fitted, 90 others, two seeds; as rendered / with 0.1 px of noise / with 30 % of the pins lost:
#:
#:                        331 pins        127 pins
#:     ridge alone      62 / 89 / 72    65 / 107 / 107
#:     0.001            47 / 80 / 62    45 / 106 / 87
#:     0.003            36 / 60 / 46    59 / 75 / 81
#:     0.005            46 / 57 / 51    60 / 65 / 76
#:
#: On the published recordings, whose pins have three times that noise, nothing changes.
PIN_NOISE = 0.003
DRAWS = 4  # of that noise, for each frame: they add up over the frames
FOLDS = 10
ROWS_MIN = 12  # fewer cannot tell a model from chance
ROWS_PER_TERM = 1.5  # unknowns beyond this are noise, ridge or not
SPREAD_MIN = 1e-3  # of a column, in its unit: below it nothing was varied
KNOTS = 12  # of the displacement curve: the paper's has no more features than that
EXPLAINED_MIN = 0.1  # share of the held-out variance: torsion on the published set reaches 0.3, chance 0


@dataclass(frozen=True, slots=True)
class Candidate:
    """One model that was tried: its size, and its rms error on held-out frames with its standard error."""

    name: str
    n_terms: int
    rms: float
    rms_error: float
    ridge: float


@dataclass(frozen=True, slots=True)
class Choice:
    """What was chosen for a group of outputs, and against what."""

    outputs: tuple[str, ...]
    model: Moments | Curve
    chosen: Candidate
    tried: tuple[Candidate, ...]
    held_out: Complex  # (n,) prediction of each frame by a model that has not seen it


def letters(degree: int) -> Letters:
    """The modes of motion up to a degree and their conjugates, each with its spin."""
    powers = [(name, 1 - int(name[1]) + int(name[2]), int(name[1]) + int(name[2])) for name in MODES]
    return [pair for name, s, d in powers if d <= degree for pair in ((name, s), (f"{name}*", -s))]


#: Of one contact: its place, the mean motion (both turn with the tip), its height and its size.
#: Without the size the depth of one of several contacts is known to 0.6..0.7 mm rms, with it to 0.2..0.3
#: (a ball of 3 mm anywhere on simulated tips of 127 and 331 pins).
CONTACT_LETTERS: Letters = (("p", 1), ("p*", -1), ("shear", 1), ("shear*", -1), ("peak", 0))
#: The size is for the depth alone: a place has enough to choose from.
DEPTH_LETTERS: Letters = (*CONTACT_LETTERS, ("size", 0))


def terms_of_spin(spin: int, alphabet: Letters, factors: int) -> list[list[str]]:
    """Products of up to `factors` inputs with this total spin. The constant comes with spin 0.

    Returns  input names of `edge.calibration`; a star is the conjugate
    """
    return [
        [name for name, _ in product]
        for n in range(factors + 1)
        for product in itertools.combinations_with_replacement(alphabet, n)
        if sum(s for _, s in product) == spin
    ]


def _all_round(targets: Targets, rows: Mask) -> bool:
    """Whether shear, tilt or place went in all directions: else terms off axis cannot be told from chance."""
    for x, y in (group.outputs for group in GROUPS if group.spin == 1 and len(group.outputs) == 2):
        if x in targets.values and y in targets.values:
            xy = np.stack([targets.values[x][rows], targets.values[y][rows]])
            xy = xy[:, np.isfinite(xy).all(axis=0)]
            if xy.shape[1] > 1:
                low, high = np.linalg.eigvalsh(np.cov(xy))
                if low > ROUND_MIN * high:
                    return True
    return False


def _designs(group: Group, all_round: bool) -> Iterator[tuple[str, list[list[str]]]]:
    """Candidates by name: the terms of each."""
    if group.of_contact:
        for factors in (1, 2, 3):
            alphabet = CONTACT_LETTERS if group.spin == 1 else DEPTH_LETTERS
            yield f"place, {factors} factors", terms_of_spin(group.spin, alphabet, factors)
        return
    if group.spin == 1:
        yield "mean motion", [["shear"]]
    for (degree, factors), off in itertools.product(SIZES, (None, *OFF_AXIS) if all_round else (None,)):
        name = f"degree {degree}, {factors} factors"
        terms = terms_of_spin(group.spin, letters(degree), factors)
        if off is not None:
            name += f", off axis {off[0]}, {off[1]}"
            for spin in (group.spin + 1, group.spin - 1)[: 1 + group.spin]:
                terms = terms + terms_of_spin(spin, letters(off[0]), off[1])
        yield name, terms


def fit(
    rest: Rest,
    targets: Targets,
    extract: Extract,
    *,
    serial: str = "unnamed",
    mm_per_px: float | None,
    on_group: Callable[[str], None] = lambda text: None,
    on_refused: Callable[[str], None] = lambda text: None,
) -> tuple[Calibration, list[Choice]]:
    """Fit everything that the table has columns for.

    mm_per_px  scale on the tip; None: from contacts in known places, if there are any
    on_group   told before each group of outputs
    on_refused told why a group was left out: its values will be sent as invalid
    Returns    the calibration, and how each model was chosen
    Raises     FitError: nothing could be fitted; what the data lacks, naming the rows
    """
    usable = extract.sure & extract.touched & np.isfinite(extract.inputs[:, FRAME_INPUTS.index("c00")])
    if usable.sum() < ROWS_MIN:
        bad = ", ".join(targets.frames[i].name for i in np.flatnonzero(~usable)[:5])
        raise FitError(
            f"{targets.where}: {int(usable.sum())} usable frames, at least {ROWS_MIN} are needed"
            + (f"; not usable: {bad}" if bad else "")
        )
    poses = np.nan_to_num(np.column_stack(list(targets.values.values())), nan=1e9)
    # A coefficient is a mean over the pins of what they are off, along x and along y.
    coefficient = PIN_NOISE * rest.pattern.pitch_px / rest.pattern.tip_radius_px * np.sqrt(2.0 / len(rest))
    jobs: dict[tuple[int, bool, bytes], list[_Job]] = {}
    for group in GROUPS:
        job = _job(group, targets, extract, usable)
        if job is not None:
            jobs.setdefault((group.spin, group.of_contact, job.rows.tobytes()), []).append(job)
    choices: list[Choice] = []
    refused: list[str] = []
    for alike in jobs.values():
        rows = alike[0].rows
        on_group(", ".join(name for job in alike for name in job.group.outputs))
        frames = [path.name for path, use in zip(targets.frames, rows, strict=True) if use]
        inputs = (extract.contact if alike[0].group.of_contact else extract.inputs)[rows]
        round_here = _all_round(targets, rows)
        for result in _choose(
            alike, inputs, coefficient, _folds(poses[rows]), round_here, targets.where, frames
        ):
            if isinstance(result, FitError):
                refused.append(str(result))
                on_refused(str(result))
            else:
                choices.append(result)
    order = [group.outputs for group in GROUPS]
    choices.sort(key=lambda choice: order.index(choice.outputs))
    if not choices:
        raise FitError(
            refused[0]
            if refused
            else f"{targets.where}: no column varies by more than {SPREAD_MIN} over rows 2 to "
            f"{len(targets) + 1}; nothing could be fitted"
        )
    data = Data(
        source=", ".join(Path(part).name for part in targets.where.split(", ")),
        sha256=targets.sha256,
        n_frames=int(usable.sum()),
        created=datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
    )
    models = [choice.model for choice in choices]
    return _file(sensor_of(rest, serial), mm_per_px or _scale(targets, extract, rest), models, data), choices


def _file(sensor: Sensor, mm_per_px: float | None, models: list[Curve | Moments], data: Data) -> Calibration:
    return Calibration(CalibrationFile(FORMAT, VERSION, sensor, mm_per_px, models, data))


def tip_of(rest: Rest) -> Calibration:
    """A calibration that knows nothing but its tip: to compare another rest frame with."""
    return _file(sensor_of(rest, "unnamed"), None, [], Data("", "", 0, ""))


def _scale(targets: Targets, extract: Extract, rest: Rest) -> float | None:
    """mm per px, from contacts whose place on the tip is known; None: there are too few, or all in one place.

    How far the places in the image spread against the true ones, whichever way the rig's axes are turned.
    """
    if not {"contact_x_mm", "contact_y_mm"} <= targets.values.keys():
        return None
    true = targets.values["contact_x_mm"] + 1j * targets.values["contact_y_mm"]
    seen = extract.contact[:, 0] * rest.pattern.tip_radius_px
    rows = extract.sure & np.isfinite(true) & np.isfinite(seen)
    if rows.sum() < ROWS_MIN or np.ptp(np.abs(true[rows])) < SPREAD_MIN:
        return None
    true, seen = true[rows] - true[rows].mean(), seen[rows] - seen[rows].mean()
    return _short(float(abs(np.vdot(seen, true)) / np.vdot(seen, seen).real))


@dataclass(frozen=True, slots=True)
class _Job:
    """A group of outputs with its truth. Jobs of one spin over the same rows share the linear algebra.

    rows  (frames,) bool, frames with truth and inputs
    y     (rows,) complex128
    """

    group: Group
    rows: Mask
    y: Complex


def _job(group: Group, targets: Targets, extract: Extract, usable: Mask) -> _Job | None:
    """None: the table does not have these outputs, or they are the same in every frame."""
    if any(name not in targets.values for name in group.outputs):
        return None
    parts = [targets.values[name] for name in group.outputs]
    rows = usable & np.all(np.isfinite(parts), axis=0)
    if not any(_varies(part[rows]) for part in parts):
        return None
    if group.of_contact:
        rows &= np.isfinite(extract.contact[:, 0])
    y = np.zeros(int(rows.sum()), dtype=np.complex128)
    y.real = parts[0][rows]
    if len(parts) == 2:
        y.imag = parts[1][rows]
    return _Job(group, rows, y)


def _varies(column: Array) -> bool:
    return bool(column.size) and float(np.ptp(column)) > SPREAD_MIN


def _folds(poses: Array) -> Index:
    """Fold of each row; equal poses share one. Deterministic: poses are dealt out by their hash order."""
    _, group = np.unique(poses, axis=0, return_inverse=True)
    order = np.random.default_rng(0).permutation(int(group.max(initial=0)) + 1)
    return np.asarray(order[group.ravel()] % min(FOLDS, len(order)), dtype=np.int32)


_Tried = tuple[Candidate, list[list[str]], Complex]


def _choose(
    jobs: Sequence[_Job],
    inputs: Complex,
    coefficient: float,
    fold: Index,
    all_round: bool,
    where: str,
    frames: Sequence[str],
) -> list[Choice | FitError]:
    """One model for each job."""
    group, n = jobs[0].group, len(inputs)
    if n < ROWS_MIN:
        return [
            FitError(f"{where}: {' and '.join(j.group.outputs)}: {n} usable frames, {ROWS_MIN} are needed")
            for j in jobs
        ]
    names = CONTACT_INPUTS if group.of_contact else FRAME_INPUTS
    noise = None if group.of_contact else _noise(inputs, coefficient)
    real = len(group.outputs) == 1
    y = np.column_stack([job.y for job in jobs])
    tried: list[list[_Tried]] = [[] for _ in jobs]
    for name, terms in _designs(group, all_round):
        if [] not in terms:
            terms = [*terms, []]  # preload: the paper's offset at zero shear
        if len(terms) * ROWS_PER_TERM > n:
            continue
        psi, moved = _terms(inputs, noise, term_columns(terms, names, "fit"))
        for known, (candidate, predicted) in zip(
            tried, _cross_validate(name, psi, moved, y, fold, real=real), strict=True
        ):
            known.append((candidate, terms, predicted))
    return [
        _best(job, known, inputs, noise, fold, where, frames) for job, known in zip(jobs, tried, strict=True)
    ]


def _noise(inputs: Complex, coefficient: float) -> Complex:
    """What the inputs of each frame would be off: (draws, frames, inputs), the same from run to run.

    coefficient  rms of a mode's coefficient, in the inputs' unit; the terms of a basis that is orthonormal
                 over the pins are off independently of each other
    """
    pairs = np.random.default_rng(0).standard_normal((DRAWS, *inputs.shape, 2)) * (coefficient / np.sqrt(2))
    noise: Complex = pairs.view(np.complex128)[..., 0]
    noise[..., FRAME_INPUTS.index("volume")] = 0.0
    noise[..., FRAME_INPUTS.index("shear")] = noise[..., FRAME_INPUTS.index("c00")]
    return noise


def _terms(inputs: Complex, noise: Complex | None, columns: NDArray[np.intp]) -> tuple[Complex, Complex]:
    """The terms of each frame (n, n_terms), and what they are off by the noise (draws * n, n_terms)."""
    psi = evaluate_terms(inputs, columns)
    if noise is None:
        return psi, psi[:0]
    off = [evaluate_terms(inputs + d, columns) - evaluate_terms(inputs - d, columns) for d in noise]
    return psi, np.concatenate(off) / (2.0 * np.sqrt(len(noise)))


def _best(
    job: _Job,
    tried: list[_Tried],
    inputs: Complex,
    noise: Complex | None,
    fold: Index,
    where: str,
    frames: Sequence[str],
) -> Choice | FitError:
    """The smallest model within one standard error of the best."""
    outputs, y = job.group.outputs, job.y
    names = CONTACT_INPUTS if job.group.of_contact else FRAME_INPUTS
    curve: Curve | None = None
    if outputs == ("displacement_mm",) and np.all(np.isfinite(inputs[:, 0])):
        curve, candidate, predicted = _curve(inputs[:, 0].real, y.real, fold)
        tried.insert(0, (candidate, [], predicted))
    best, _, predicted = min(tried, key=lambda t: t[0].rms)
    explained = 1.0 - best.rms**2 / float((np.abs(y - y.mean()) ** 2).mean())
    if explained < EXPLAINED_MIN:
        worst = ", ".join(frames[i] for i in np.argsort(-np.abs(predicted - y))[:5])
        return FitError(
            f"{where}: {' and '.join(outputs)} cannot be told from these frames (the best model explains "
            f"{max(0.0, explained):.0%} of the variance); the rows that fit worst: {worst}"
        )
    good = [t for t in tried if t[0].rms <= best.rms + best.rms_error]
    chosen, terms, predicted = min(good, key=lambda t: (t[0].n_terms, t[0].rms))
    model: Moments | Curve
    if curve is not None and chosen.name == curve.input:
        model = curve
    else:
        psi, moved = _terms(inputs, noise, term_columns(terms, names, "fit"))
        model = _moments(outputs, terms, psi, moved, y, chosen.ridge, predicted)
    return Choice(outputs, model, chosen, tuple(t[0] for t in tried), predicted)


def _cross_validate(
    name: str, psi: Complex, moved: Complex, y: Complex, fold: Index, *, real: bool
) -> list[tuple[Candidate, Complex]]:
    """Held-out predictions with the best ridge, and their error, for each column of y.

    The error is that of the frame as it is, and that of the noise `moved` on top.

    The normal matrix of all rows is made once; a fold's is that less its own rows. One eigenvalue
    decomposition then serves every ridge and every column: penalties from 1e-4 of a row up keep the
    squared condition number harmless.
    """
    a, off = _scaled(psi, moved, real=real)[:2]
    target: Any = y.real if real else y
    noise = off.conj().T @ off
    gram, right = a.conj().T @ a, a.conj().T @ target
    predicted = np.zeros((len(RIDGES), *y.shape), dtype=np.complex128)
    blown_up = np.zeros((len(RIDGES), y.shape[1]))
    folds = int(fold.max()) + 1
    for k in range(folds):
        test = a[fold == k]
        left = test.conj().T
        e, v = np.linalg.eigh(gram - left @ test + noise)
        along, coordinates = test @ v, v.conj().T @ (right - left @ target[fold == k])
        noise_along = v.conj().T @ noise @ v
        for r, ridge in enumerate(RIDGES):
            w = coordinates / (np.maximum(e, 0.0) + ridge)[:, None]
            predicted[r, fold == k] = along @ w
            blown_up[r] += (w.conj() * (noise_along @ w)).sum(axis=0).real / (folds * len(y))
    squares = np.abs(predicted - y) ** 2
    found = []
    for j, means in enumerate((squares.mean(axis=1) + blown_up).T):
        r = int(np.argmin(means))
        rms = float(np.sqrt(means[r]))
        # Standard error of a root of a mean of squares, by the delta method.
        error = float(squares[r, :, j].std() / np.sqrt(len(y)) / (2 * rms)) if rms else 0.0
        found.append((Candidate(name, psi.shape[1], rms, error, RIDGES[r]), predicted[r, :, j]))
    return found


def cross_validated_terms(psi: Complex, y: Complex, poses: Array) -> Complex:
    """Prediction of each row by a ridge model of these terms that has not seen its pose.

    psi      (n, n_terms), of `evaluate_terms`
    y        (n,) complex truth, x + i y
    poses    (n, any): equal rows stay together
    Returns  (n,) complex128
    """
    return _cross_validate("", psi, psi[:0], y[:, None], _folds(poses), real=False)[0][1]


def paper_curve(volume: Array, depth: Array) -> Curve:
    """The paper's displacement curve of these frames; both (n,)."""
    return _curve(volume, depth, _folds(depth[:, None]))[0]


def cross_validated_curve(volume: Array, depth: Array) -> Array:
    """Prediction of each row by the paper's curve that has not seen its depth; both (n,)."""
    return _curve(volume, depth, _folds(depth[:, None]))[2].real


def _scaled(psi: Complex, moved: Complex, *, real: bool) -> tuple[Any, Any, Array]:
    """Terms of unit mean square, their noise in the same measure, and the scale.

    For a real output Re(psi w) = Re psi Re w - Im psi Im w: columns for both.
    """
    scale: Array = np.sqrt((np.abs(psi) ** 2).mean(axis=0))
    scale[scale < 1e-14] = np.inf  # a term that never occurs gets weight 0
    a, off = psi / scale, moved / scale
    if real:
        return np.hstack([a.real, -a.imag]), np.hstack([off.real, -off.imag]), scale
    return a, off, scale


def _ridge(psi: Complex, moved: Complex, y: Complex, ridge: float, *, real: bool) -> Complex:
    """Ridge weights of scaled terms: rows of noise have nothing to say."""
    a, off, scale = _scaled(psi, moved, real=real)
    u, s, vh = np.linalg.svd(np.concatenate([a, off]), full_matrices=False)
    w: Any = vh.conj().T @ (s / (s**2 + ridge) * (u[: len(a)].conj().T @ (y.real if real else y)))
    result: Complex = (w[: len(scale)] + 1j * w[len(scale) :] if real else w) / scale
    return result


def _moments(
    outputs: tuple[str, ...],
    terms: list[list[str]],
    psi: Complex,
    moved: Complex,
    y: Complex,
    ridge: float,
    held_out: Complex,
) -> Moments:
    """The chosen model on all frames, with its range, sigma and spread."""
    real = len(outputs) == 1
    weights = _ridge(psi, moved, y, ridge, real=real)
    varied = [_varies(part) for part in (y.real, y.imag)]
    spread = _spread(psi, moved, ridge)
    widening = np.sqrt(1.0 + (np.abs(psi @ spread.T) ** 2).sum(axis=1))
    errors = np.abs([(held_out - y).real, (held_out - y).imag][: len(outputs)]) / widening
    sigma = [max(1e-6, _short(float(np.quantile(e, 0.6827)))) for e in errors]
    valid = [(round(float(y.real.min()), 4), round(float(y.real.max()), 4))]
    if not real:
        # What is known in one direction is known in all: a round tip does not care.
        far = round(float(np.abs([y.real, y.imag]).max()), 4)
        valid = [(-far, far), (-far, far)]
        if not all(varied):
            sigma = [max(sigma)] * 2
    return Moments(
        outputs=list(outputs),
        terms=terms,
        weights=[(_short(w.real), _short(w.imag)) for w in weights],
        valid=valid,
        sigma=sigma,
        spread=[[(_short(v.real, 3), _short(v.imag, 3)) for v in row] for row in spread],
    )


SPREAD_ROWS = 8  # directions of largest uncertainty that are kept; more widen no sigma by a percent


def _spread(psi: Complex, moved: Complex, ridge: float) -> Complex:
    """Factor L with |L psi|^2 = psi^H (A^H A + noise + ridge)^-1 psi: largest directions, (r, n_terms)."""
    a, off, scale = _scaled(psi, moved, real=False)
    _, s, vh = np.linalg.svd(np.concatenate([a, off]), full_matrices=False)
    root = 1.0 / np.sqrt(s**2 + ridge)
    # How much each direction matters for frames like these: its variance times its uncertainty.
    rows = np.argsort(-root * s)[-SPREAD_ROWS:] if len(s) > SPREAD_ROWS else np.arange(len(s))
    result: Complex = root[rows, None] * vh[rows] / scale
    return result


def _short(value: float, digits: int = 6) -> float:
    """A number with so many significant digits: what the data supports, and a smaller file."""
    return float(f"{value:.{digits}g}")


def _curve(volume: Array, depth: Array, fold: Index) -> tuple[Curve, Candidate, Complex]:
    """The paper's displacement curve: monotone in the volume of deformation."""
    predicted = np.zeros(len(depth))
    for k in range(int(fold.max()) + 1):
        x, y = _knots(volume[fold != k], depth[fold != k])
        predicted[fold == k] = np.interp(volume[fold == k], x, y)
    x, y = _knots(volume, depth)
    squares = (predicted - depth) ** 2
    rms = float(np.sqrt(squares.mean()))
    error = float(squares.std() / np.sqrt(len(depth)) / (2 * rms)) if rms else 0.0
    sigma = max(1e-6, _short(float(np.quantile(np.abs(predicted - depth), 0.6827))))
    knots = [(_short(float(a)), _short(float(b))) for a, b in zip(x, y, strict=True)]
    curve = Curve(output="displacement_mm", input="volume", knots=knots, sigma=sigma)
    return curve, Candidate("volume", len(x), rms, error, 0.0), predicted.astype(np.complex128)


def _knots(volume: Array, depth: Array) -> tuple[Array, Array]:
    """Monotone regression, thinned to a few knots. Increasing inputs, non-decreasing outputs."""
    order = np.argsort(volume, kind="stable")
    x, y = volume[order], isotonic_regression(depth[order]).x
    parts = np.array_split(np.arange(len(x)), min(KNOTS, max(2, len(x) // 4)))
    kx = np.array([x[p].mean() for p in parts])
    ky = np.array([y[p].mean() for p in parts])
    keep = np.concatenate([[True], np.diff(kx) > 1e-12])
    return kx[keep], ky[keep]
