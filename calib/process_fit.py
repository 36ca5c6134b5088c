"""A symmetric Gaussian process as the polynomial that it is: its terms, their weights, the noise.

The kernel of `calib.process_likelihood` is a polynomial of third degree, so its features are the products of
up to three inputs (or their conjugates). Mean over turns and mirror leaves those of the outputs' own spin and
parity; each has a prior variance that follows from the kernel's weights. Most inputs have weights near 0, and
products whose prior variance is far below the noise are left out: some ten to some hundred are left. With
those it is Bayesian linear regression, exactly.

How wrong it is, it is asked of frames that it has not seen: the frames are split into groups, settings are
fitted without each, and all that is said of errors rests on these. (The errors of settings that have seen
every frame are too small, by a third with a hundred frames.)

The noise (`calib.process_noise`) is the likeliest for those errors, along the value's direction and across.
Judged by a noise that has not seen their group either, they say how much wider or narrower sigma has to be to
cover as many of them as it should.

Frames of one pose share how the tool was set down, so most of their noise is common to them. Their
differences, with one and the same truth, show what the value does not depend on (a skin that creeps), and
count the more, the less unseen poses differ in themselves (`_with_own`).

Fewer than two poses for each input do not decide its weight: which inputs count would depend on single poses.
If they repeat, the modes share one weight that falls with their degree, and the others share another one; the
noise is the same in all frames then, but along a vector and across it.

If a model of another tip is known (`calib.carry_over`), its weights and what changes them take the place of
the kernel: few frames are enough then.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.linalg import block_diag, cholesky, solve_triangular

from calib.carry_over import KnownModel, changed
from calib.process_likelihood import Repeats, Settings, Symmetry, fit_settings
from calib.process_noise import WITHIN, NoiseModel, fit_lost, fit_noise, likeliest_scales, scales_of
from calib.ridge import blocks, share_of_pose
from calib.terms import evaluate_terms, term_columns
from edge.calibration.file import TERMS_MAX, Lost
from edge.calibration.inputs import FRAME_INPUTS, MODES
from edge.types import Array, Complex, Index, Mask


@dataclass(frozen=True, slots=True)
class Input:
    """One input of the frame that processes use.

    degree  of the polynomial that it is a coefficient of; 0: it is of the touch as a whole
    real    its imaginary part is 0
    """

    name: str
    spin: int
    degree: int
    real: bool = False


INPUTS = (
    *(Input(f"c{a}{d - a}", 1 - 2 * a + d, d) for d in range(6) for a in range(d, -1, -1)),
    Input("p", 1, 0),
    Input("volume", 0, 0, real=True),
    Input("peak", 0, 0, real=True),
    Input("size", 0, 0, real=True),
)


@dataclass(frozen=True, slots=True)
class ProcessParams:
    """Evidence: docs/tuning.md, "Fit by a Gaussian process"."""

    negligible: float = 0.03  # of the noise's variance: a term whose prior variance is smaller is left out
    rows_max: int = 32  # of the covariance's root
    open_share: float = 0.99  # of what the weights leave open, that these rows hold
    apart: float = 0.1  # share of inputs that go their own ways in what the rows must hold
    constant: float = 0.1  # prior deviation of the constant, in units of the output's own
    repeats: int = 4  # frames of a pose that settings are fitted to
    own_min: float = 0.1  # variance of a frame about its pose, over that of the pose, assumed at least
    groups_min: int = 3  # that settings are fitted without
    rows_groups: int = 1440  # frames of all groups' fits together that are worth their time, with more groups
    far: float = 4.0  # times the largest variance of held-out frames: twice their sigma


EVERY = slice(None)
SIGMA_MIN = 1e-6  # in the output's unit: data without any error
PARAMS = ProcessParams()


@dataclass(frozen=True, slots=True)
class FittedProcess:
    """The process in terms of its weights. Units: the outputs' own; sigma of each output.

    terms          input names
    weights        (terms,) complex128
    factor         (rows, terms) complex128, L over sigma
    sigma          (1 or 2,)
    far            largest |L psi|^2 that is no extrapolation
    noise          over sigma^2; of two outputs along the value
    across         the same across the value; None: one output
    lost           what lost pins add to the variance, over sigma^2; None: not tried
    pin_noise      variance of the value, of both outputs together, that noise of the inputs causes
    held_out       (n,) complex128, prediction of each row by settings that have not seen its group, and
                   weights that have not seen its fold
    uncertainty    what the weights leave open
    """

    terms: list[list[str]]
    weights: Complex
    factor: Complex
    sigma: Array
    far: float
    noise: NoiseModel
    across: NoiseModel | None
    lost: Lost | None
    pin_noise: float
    held_out: Complex
    uncertainty: Uncertainty


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """The variation that the weights leave open, and how two inputs share it."""

    features: _Features
    root: Complex

    def rows(self, inputs: Complex) -> Complex:
        """(n, r): the scalar product of two rows is the covariance of the values there, of each output."""
        result: Complex = self.features.rows(inputs) @ self.root
        return result


def fit_process(
    inputs: Complex,
    moved: Sequence[Complex],
    y: Complex,
    symmetry: Symmetry,
    fold: Index,
    lossy: Complex,
    *,
    all_round: bool,
    terms_max: int = TERMS_MAX,
    known: KnownModel | None = None,
    pose: Index,
    motion: Complex | None = None,
) -> FittedProcess:
    """Settings of largest likelihood, then the weights.

    inputs     (n, k) complex128, columns `FRAME_INPUTS`, finite
    moved      draws of what the inputs may be off, each (n, k)
    y          (n,) complex128, x + i y, or real; fold (n,): rows that stay together when held out
    lossy      (n, losses, k) complex128, the inputs with some of the pins taken away; NaN: not known
    all_round  False: the data went one way only, and cannot tell what is not symmetric
    terms_max  more are left out, those with the smallest prior variance first
    known      another tip's model of these outputs, whose terms it then has; None: none
    pose       (n,) its number: frames of one pose count as one
    motion     (r, modes), whose products with modes are as far apart as the pins' motion; None: not known
    """
    mean, unit, target = _standardised(y, symmetry, inputs[:, FRAME_INPUTS.index("volume")].real)
    few = int(pose.max()) + 1 < min(len(pose), 2 * len(INPUTS))
    known = known and known.scaled(unit, mean)
    of_own = partial(_prior, all_round=all_round, terms_max=terms_max, few=few, motion=motion)
    find = partial(partial(_changed, known) if known else of_own, symmetry=symmetry)
    data = _with_own(find, _Data(inputs, moved, target, fold, pose))
    prior = data.prior(find, data.some_each(PARAMS.repeats))
    features, posterior = prior.features, _Posterior(prior, data)
    group = fold % _n_groups(fold, len(data.some_each(PARAMS.repeats)))
    unseen, learnt = _held_out(partial(find, start=prior.start), data, group)
    factor = posterior.factor()
    learnt *= posterior.share_held(inputs, factor)
    if features.turning:  # the variance of a complex weight is that of its two parts together
        factor, learnt = factor / math.sqrt(2.0), learnt / 2.0
    errors = _Errors(data, unseen, learnt, symmetry, all_round=all_round, known=known, few=few)
    along, across, level = errors.noise()
    scale = errors.scale(group)
    over = max(math.sqrt(level * float((scale**2).mean())), SIGMA_MIN / unit)
    weights = prior.mean + features.of_terms(posterior.weights[None])[0]
    return FittedProcess(
        terms=features.terms,
        weights=(weights + mean / unit * np.eye(1, len(weights))[0]) * unit,
        factor=features.of_terms(factor / math.sqrt(level)),
        sigma=np.maximum(scale * unit * math.sqrt(level), SIGMA_MIN),
        far=PARAMS.far * (1.0 + float(learnt.max()) / level) - 1.0,
        noise=along,
        across=across,
        lost=_effect_of_loss(features, weights / over, inputs, lossy)
        or (known.lost_over(over) if known else None),
        pin_noise=_pin_noise(features, weights, inputs, moved) * unit**2,
        held_out=unseen * unit + mean,
        uncertainty=Uncertainty(features, posterior.root() * (unit / math.sqrt(1.0 + features.turning))),
    )


def _pin_noise(features: _Features, weights: Complex, inputs: Complex, moved: Sequence[Complex]) -> float:
    """Variance of the values, by what the inputs may be off."""
    off = [features.values(inputs + d, weights) - features.values(inputs - d, weights) for d in moved]
    return float(np.mean(np.abs(off) ** 2)) / 4.0 if off else 0.0


def _effect_of_loss(features: _Features, weights: Complex, inputs: Complex, lossy: Complex) -> Lost | None:
    """The variance that lost pins add, over the unit of the weights; None: there are too few losses."""
    rows = lossy.reshape(-1, inputs.shape[1])
    change = features.values(rows, weights) - np.repeat(features.values(inputs, weights), lossy.shape[1])
    return fit_lost(rows, change, turning=features.turning)


def _standardised(y: Complex, symmetry: Symmetry, volume: Array) -> tuple[float, float, Complex]:
    """The part that is subtracted, the unit, and y in these terms.

    At rest all inputs and values are 0; only a depth may be counted from elsewhere (the arm's position).
    Where most of its mean remains without a volume it is subtracted, as the process expects 0 at rest.
    """
    mean = float(y.real.mean()) if symmetry is Symmetry.EVEN else 0.0
    spread = volume - volume.mean()
    of_volume = float(spread @ y.real) / max(float(spread @ spread), 1e-300) * float(volume.mean())
    if abs(mean - of_volume) < abs(of_volume):
        mean = 0.0
    unit = float(np.sqrt((np.abs(y - mean) ** 2).mean()))
    return mean, unit, (y - mean) / unit


def _n_groups(fold: Index, rows: int) -> int:
    """Take as many as are worth their time: settings from few frames depend on each of them."""
    folds = int(fold.max()) + 1
    return min(folds, max(PARAMS.groups_min, PARAMS.rows_groups // rows))


@dataclass(frozen=True, slots=True)
class _Data:
    """What a process is fitted to, as `fit_process` has it; the target in its unit.

    own  variance of a frame about its pose
    """

    inputs: Complex
    moved: Sequence[Complex]
    target: Complex
    fold: Index
    pose: Index
    own: float = 0.0

    def some_each(self, most: int, among: Mask | slice = EVERY) -> Index:
        """Rows of up to so many frames of each pose, by chance: first one of each, then the others."""
        order = np.arange(len(self.pose))[among]
        order = order[np.random.default_rng(0).permutation(len(order))]
        by_pose = np.argsort(self.pose[order], kind="stable")
        rank = np.empty(len(order), dtype=np.int32)
        rank[by_pose] = np.concatenate([np.arange(n) for n in np.bincount(self.pose[order])])
        first = np.argsort(rank, kind="stable")
        return order[first[rank[first] < most]].astype(np.int32)

    def prior(self, find: Callable[..., _Prior], rows: Index) -> _Prior:
        """Of settings that are fitted to these rows."""
        repeats = Repeats(self.pose[rows], self.own)
        return find(self.inputs[rows], target=self.target[rows], repeats=repeats)

    def whole_poses(self) -> Sequence[Index]:
        """Some rows at a time, those of one pose together."""
        order = np.argsort(self.pose, kind="stable")
        pose = self.pose[order]
        starts = np.unique(np.searchsorted(pose, [pose[block.start] for block in blocks(len(pose))]))
        return np.split(order, starts[1:])

    def whitened(self, values: Any, rows: Index, noise: float) -> Any:
        """Values (n, k) of whole poses, in combinations with independent noise, of the variance of a pose."""
        pose = np.unique(self.pose[rows], return_inverse=True)[1]
        counts = np.bincount(pose)
        mean = np.zeros((len(counts), values.shape[1]), values.dtype)
        np.add.at(mean, pose, values)
        mean /= counts[:, None]
        if len(counts) == len(pose):
            return values
        to_own = math.sqrt(noise / self.own)
        return mean[pose] / np.sqrt(counts)[pose, None] + to_own * (values - mean[pose])


def _with_own(find: Callable[..., _Prior], data: _Data) -> _Data:
    """The data with the variance of a frame about its pose, by predictions of unseen poses.

    Their truth is the same in all frames; if they differ in themselves as much as from it, the press was not
    held, and what they differ by must not count as what the value does not depend on.
    """
    counts = np.bincount(data.pose)
    if counts.max() == 1:
        return data
    prior = data.prior(find, data.some_each(1))
    posterior = _Posterior(prior, replace(data, own=prior.noise))
    error = prior.features.values(data.inputs, prior.mean) - data.target
    for k in np.unique(data.fold):
        error[data.fold == k] += posterior.held_out(data.fold == k)[0]
    mean = np.zeros(len(counts), error.dtype)
    np.add.at(mean, data.pose, error)
    mean /= counts
    within = float((np.abs(error - mean[data.pose]) ** 2).sum()) / (len(error) - len(counts))
    return replace(data, own=max(within, PARAMS.own_min * float((np.abs(mean) ** 2).mean())))


def _held_out(find: Callable[..., _Prior], data: _Data, group: Index) -> tuple[Complex, Array]:
    """(n,) prediction of each row, and what the weights leave open of it.

    Settings have not seen its group, weights not its fold. Weights that have not seen the group either would
    err more than the edge's, which all rows decide.
    """
    predicted, learnt = np.empty_like(data.target), np.empty(len(data.target))
    for k in range(int(group.max()) + 1):
        unseen = group == k
        prior = data.prior(find, data.some_each(PARAMS.repeats, ~unseen))
        posterior = _Posterior(prior, data)
        for j in np.unique(data.fold[unseen]):
            predicted[data.fold == j], learnt[data.fold == j] = posterior.held_out(data.fold == j)
        predicted[unseen] += prior.features.values(data.inputs[unseen], prior.mean)
    return predicted, learnt


class _Errors:
    """Errors of predictions of unseen frames, and the noise that explains them.

    predicted  (n,) complex128
    learnt     (n,) variance of the prediction that the weights leave open
    symmetry   turning: two outputs, whose errors are looked at along the prediction and across it
    all_round  False: the data went one way only, and say nothing of errors across it
    known      another tip's model, whose noise is where that of this one is looked for; None: none
    few        the poses do not decide how noise differs between frames
    """

    def __init__(
        self,
        data: _Data,
        predicted: Complex,
        learnt: Array,
        symmetry: Symmetry,
        *,
        all_round: bool,
        known: KnownModel | None,
        few: bool,
    ) -> None:
        self._known, self._few = known is not None, few
        self._before = (None, None) if known is None else (known.noise, known.across or known.noise)
        self._inputs, self._learnt = data.inputs, learnt
        self._share = share_of_pose(data.pose)
        self._turning, self._all_round = symmetry is Symmetry.TURNING, all_round
        self._few_known = known is not None and self._share.sum() < 2 * len(INPUTS)
        self._error = predicted - data.target
        length = np.abs(predicted)
        self._direction = np.where(length > 0, predicted / np.where(length > 0, length, 1.0), 1.0)

    def noise(self, rows: Mask | slice = EVERY) -> tuple[NoiseModel, NoiseModel | None, float]:
        """Noise of one output, or of two along the value, and across it; and their typical variance."""
        inputs, learnt, share = self._inputs[rows], self._learnt[rows], self._share[rows]
        constant = self._few or self._few_known
        fitted = partial(fit_noise, inputs, learnt=learnt, share=share, constant=constant)
        if not self._turning or not self._all_round:
            one = fitted(squares=np.abs(self._error[rows]) ** 2, before=self._before[0])
            return one.over(one.level), None, one.level
        error = (self._error * self._direction.conj())[rows]
        along = fitted(squares=error.real**2, before=self._before[0])
        across = fitted(squares=error.imag**2, before=self._before[1])
        if self._few_known:  # what slid lightly may have gone in another direction: the larger one counts
            one = max((along, across), key=lambda noise: noise.level)
            return one.over(one.level), None, one.level
        level = (along.level + across.level) / 2.0
        return along.over(level), across.over(level), level

    def scale(self, group: Index) -> Array:
        """(outputs,) of sigma, that it covers as many errors as it should, with another tip's model no fewer.

        Errors of few poses make sigma no smaller with it.
        """
        standardised, poses = self._standardised(group), float(self._share.sum())
        if self._few and not self._known:  # neither who is beyond two sigma, nor which output errs more
            return np.full(len(standardised), scales_of([np.concatenate(standardised)])[0, 0])
        if not self._known:
            return likeliest_scales(standardised, poses)
        return np.asarray(scales_of(standardised, len(WITHIN)).max(axis=1, initial=float(self._few_known)))

    def _standardised(self, group: Index) -> list[Array]:
        """Errors of each output over their deviation, by a noise that has not seen their group."""
        parts = [np.empty(len(group)) for _ in range(1 + self._turning)]
        for k in range(int(group.max()) + 1):
            rows = group == k
            for part, found in zip(parts, self._over(rows, *self.noise(~rows)), strict=True):
                part[rows] = found
        return parts

    def _over(
        self, rows: Mask, along: NoiseModel, across: NoiseModel | None, level: float
    ) -> Iterator[Array]:
        inputs, error, learnt = self._inputs[rows], self._error[rows], self._learnt[rows]
        one = level * along.variance(inputs)
        if across is None:
            both = (error.real, error.imag) if self._few_known and self._all_round else (np.abs(error),) * 2
            for part in both[: 1 + self._turning]:
                yield part / np.sqrt(learnt + one)
            return
        other = level * across.variance(inputs)
        share = self._direction[rows].real ** 2
        yield error.real / np.sqrt(learnt + share * one + (1.0 - share) * other)
        yield error.imag / np.sqrt(learnt + share * other + (1.0 - share) * one)


@dataclass(frozen=True, slots=True)
class _Prior:
    """Factor of the weights, and the noise, in units of the target.

    mean  (terms,) complex128
    start that led to the settings; None: there are no others
    """

    features: _Features
    mean: Complex
    noise: float
    start: int | None


def _changed(
    known: KnownModel,
    inputs: Complex,
    target: Complex,
    symmetry: Symmetry,
    repeats: Repeats,
    start: int | None = None,
) -> _Prior:
    """Another tip's weights, and what is likely to have changed them."""
    mean, root, noise = changed(known, inputs, target, symmetry, repeats)
    return _Prior(_Features(known.terms, root, symmetry), mean, noise, start)


def _prior(
    inputs: Complex,
    target: Complex,
    symmetry: Symmetry,
    *,
    all_round: bool,
    terms_max: int,
    few: bool,
    motion: Complex | None,
    repeats: Repeats,
    start: int | None = None,
) -> _Prior:
    """The features of the likeliest kernel that are not negligible; the likelihood takes the first rows.

    few      the poses do not decide a weight for each input; the part linear in `motion` is of all spins
    repeats  how frames of one pose share their noise
    start    the search's only one; None: all are tried
    """
    columns = [FRAME_INPUTS.index(one.name) for one in INPUTS]
    scale = np.sqrt((np.abs(inputs[:, columns]) ** 2).mean(axis=0))
    used = [i for i, rms in enumerate(scale) if rms > 0]
    letters = [INPUTS[i] for i in used]
    plain = None
    if few and all_round and motion is not None:
        of_pins = inputs[:, [FRAME_INPUTS.index(name) for name in MODES]] @ motion.T
        size = math.sqrt((np.abs(of_pins) ** 2).sum(axis=1).mean())
        motion, plain = motion / size, (of_pins @ of_pins.conj().T).real / size**2
    settings = fit_settings(
        inputs[:, [columns[i] for i in used]] / scale[used],
        np.array([one.spin for one in letters]),
        np.array([float(one.degree) for one in letters]),
        target,
        symmetry,
        asymmetric=all_round,
        few=few,
        repeats=repeats,
        start=start,
        plain=plain,
    )
    terms: list[list[str]] = [[]]
    prior = [[PARAMS.constant * (all_round or symmetry is Symmetry.EVEN)] * 2]
    for term, power, size in _products(letters, scale[used], settings, symmetry):
        terms.append(term)
        prior.append([math.sqrt(part) / size for part in power])
    deviation = np.array(prior)
    kept = _not_negligible(terms, deviation, inputs, settings.noise, terms_max)
    terms, deviation = [terms[i] for i in kept], deviation[kept]
    root = np.diag(deviation[:, 0] + 0j)
    if symmetry is not Symmetry.TURNING:  # the real and the imaginary part of a weight are two features
        root = np.hstack([root, 1j * np.diag(deviation[:, 1])])
    root = root[:, np.abs(root).any(axis=0)]
    if motion is not None and settings.plain > PARAMS.negligible * settings.noise:
        terms, root = _with_plain(terms, root, math.sqrt(settings.plain) * motion, symmetry)
    features = _Features(terms, root, symmetry)
    return _Prior(features, np.zeros(len(terms), dtype=np.complex128), settings.noise, settings.start)


def _with_plain(
    terms: list[list[str]], root: Complex, motion: Complex, symmetry: Symmetry
) -> tuple[list[list[str]], Complex]:
    """Terms and root with the modes themselves, of all spins, so that each pin's motion counts alike."""
    linear, of_linear = [[name] for name in MODES], np.hstack([motion.T, 1j * motion.T])
    if symmetry is Symmetry.TURNING:
        linear += [[f"{name}*"] for name in MODES]
        of_linear = block_diag(motion.T, motion.conj().T) / math.sqrt(2.0)
    every = terms + [term for term in linear if term not in terms]
    wide = np.zeros((len(every), root.shape[1] + of_linear.shape[1]), np.complex128)
    wide[: len(terms), : root.shape[1]] = root
    wide[[every.index(term) for term in linear], root.shape[1] :] = of_linear
    return every, wide


def _not_negligible(
    terms: list[list[str]], deviation: Array, inputs: Complex, noise: float, most: int
) -> Index:
    """Which terms have a prior variance that is not far below the noise's. The constant stays first."""
    columns = term_columns(terms, FRAME_INPUTS)
    parts = [(np.abs(evaluate_terms(inputs[rows], columns)) ** 2).sum(axis=0) for rows in blocks(len(inputs))]
    size = np.sum(parts, axis=0) / len(inputs)
    share = (deviation**2).max(axis=1) * size / noise
    share[0] = np.inf
    kept = np.sort(np.argsort(-share, kind="stable")[:most])
    return np.asarray(kept[share[kept] > PARAMS.negligible])


def _products(
    letters: Sequence[Input], scale: Array, settings: Settings, symmetry: Symmetry
) -> Iterator[tuple[list[str], tuple[float, float], float]]:
    """Products of one, two, three inputs; prior variances of their real and imaginary part; their unit.

    Of a term and its conjugate, which a real output cannot tell apart, only one.
    """
    # Name, spin, share of the scalar product, unit, place of the letter and of its conjugate.
    alphabet = [
        (one.name, one.spin, w * w / (1.0 if one.real else 2.0), unit, 2 * i, 2 * i + (not one.real))
        for i, (one, w, unit) in enumerate(zip(letters, settings.weight, scale, strict=True))
    ]
    alphabet += [(f"{n}*", -s, q, unit, c, i) for n, s, q, unit, i, c in alphabet if i != c]
    turning = symmetry is Symmetry.TURNING
    spin = 1 if turning else 0
    for factors in (1, 2, 3):
        symmetric, asymmetric = settings.symmetric[factors - 1], settings.asymmetric[factors - 1]
        for product in itertools.combinations_with_replacement(alphabet, factors):
            places = [one[4] for one in product]
            if sum(one[1] for one in product) != spin and asymmetric == 0.0:
                continue
            shared = math.factorial(factors) * math.prod(one[2] for one in product)
            shared /= math.prod(math.factorial(n) for n in Counter(places).values())
            same_spin = symmetric if sum(one[1] for one in product) == spin else 0.0
            power = (shared * (same_spin + asymmetric),) * 2
            if not turning:
                conjugate = sorted(one[5] for one in product)
                if sorted(places) > conjugate:
                    continue
                pair = shared * (1.0 if sorted(places) == conjugate else 2.0)
                scalar, torsion = (2.0, 0.0) if symmetry is Symmetry.EVEN else (0.0, 2.0)
                power = (pair * (scalar * same_spin + asymmetric), pair * (torsion * same_spin + asymmetric))
            yield [one[0] for one in product], power, math.prod(one[3] for one in product)


class _Features:
    """Sums of terms whose weights have unit prior variance, independent of each other.

    Of a turning output the weights are complex; of a real one they are real, and the real parts count.

    root  (terms, features) complex128: weights of the terms in each feature
    """

    def __init__(self, terms: list[list[str]], root: Complex, symmetry: Symmetry) -> None:
        self.terms, self._root = terms, root
        self.turning = symmetry is Symmetry.TURNING
        self._columns = term_columns(terms, FRAME_INPUTS)

    def rows(self, inputs: Complex) -> Any:
        """Features of each frame: (n, features)."""
        found = evaluate_terms(inputs, self._columns) @ self._root
        return found if self.turning else found.real

    def values(self, inputs: Complex, weights: Complex) -> Complex:
        """(n,) of these weights of the terms."""
        parts = [evaluate_terms(inputs[rows], self._columns) @ weights for rows in blocks(len(inputs))]
        value: Complex = np.concatenate([np.empty(0, np.complex128), *parts])
        if not self.turning:
            value.imag = 0.0
        return value

    def of_terms(self, rows: Any) -> Complex:
        """Rows (r, features) over the features as rows (r, terms) over the terms."""
        result: Complex = rows @ self._root.T
        return result


class _Posterior:
    """Bayesian linear regression of what a prior's mean leaves, with unit prior variances."""

    def __init__(self, prior: _Prior, data: _Data) -> None:
        features, inputs, moved = prior.features, data.inputs, data.moved
        left = data.target - features.values(inputs, prior.mean)
        self._y: Any = left if features.turning else left.real
        self._features, self._data, self._noise = features, data, prior.noise
        share = share_of_pose(data.pose)[:, None]
        gram: Any = 0.0
        size: Any = 0.0
        off: Any = 0.0  # what the features may be off, squared
        self._right: Any = 0.0
        for rows in data.whole_poses():
            design = features.rows(inputs[rows])
            size = size + (design * share[rows]).conj().T @ design
            square, right = self._products(design, rows)
            gram = gram + square
            self._right = self._right + right
            for d in moved:
                change = features.rows(inputs[rows] + d[rows]) - features.rows(inputs[rows] - d[rows])
                off = off + (change * share[rows]).conj().T @ change / (4.0 * len(moved))
        self._precision = gram + off + self._noise * np.eye(len(gram))
        self._second_moment = size / share.sum()
        self.weights: Complex = np.linalg.solve(self._precision, self._right)

    def held_out(self, rows: Mask) -> tuple[Complex, Array]:
        """Prediction of whole poses by weights that have not seen them; what the weights leave open of it."""
        design = self._features.rows(self._data.inputs[rows])
        square, right = self._products(design, np.flatnonzero(rows).astype(np.int32))
        others = self._precision - square
        solved = np.linalg.solve(others, np.column_stack([design.conj().T, self._right - right]))
        left = self._noise * (design * solved[:, :-1].T).sum(axis=1).real
        return design @ solved[:, -1], np.maximum(left, 0.0)

    def _products(self, design: Any, rows: Index) -> tuple[Any, Any]:
        """(f, f), (f,) squares of whole poses' features, and their products with the truth."""
        both = self._data.whitened(np.column_stack([design, self._y[rows]]), rows, self._noise)
        left = both[:, :-1].conj().T
        return left @ both[:, :-1], left @ both[:, -1]

    def root(self) -> Complex:
        """(f, f) of the weights' covariance: root root^H."""
        lower = cholesky(self._precision, lower=True)
        eye = np.eye(len(lower))
        result: Complex = math.sqrt(self._noise) * solve_triangular(lower, eye, lower=True).conj().T
        return result

    def factor(self) -> Complex:
        """(r, f): |row . features|^2, summed, is the variance that the weights leave open.

        The rows that hold most of it over the data, and over inputs that go their own ways.
        """
        size = np.diag(np.diag(self._second_moment).real)
        held = (1.0 - PARAMS.apart) * self._second_moment + PARAMS.apart * size
        e, v = np.linalg.eigh(held)
        e = np.maximum(e, 1e-12 * e.max(initial=0.0))  # Without features nothing tells the value.
        root, inverse_root = (v * np.sqrt(e)) @ v.conj().T, (v / np.sqrt(e)) @ v.conj().T
        covariance = self._noise * np.linalg.inv(self._precision)
        s, u = np.linalg.eigh(root @ covariance @ root)
        s, u = np.maximum(s[::-1], 0.0), u[:, ::-1]
        enough = int(np.searchsorted(np.cumsum(s), PARAMS.open_share * s.sum())) + 1
        rows = slice(0, min(enough, PARAMS.rows_max))
        result: Complex = ((inverse_root @ u[:, rows]) * np.sqrt(s[rows])).T
        return result

    def share_held(self, inputs: Complex, factor: Complex) -> Array:
        """(n,) of what the weights leave open of these rows, the share that the factor's rows hold."""
        covariance = self._noise * np.linalg.inv(self._precision)
        shares = []
        for rows in blocks(len(inputs)):
            design = self._features.rows(inputs[rows])
            whole = (design @ covariance * design.conj()).sum(axis=1).real
            held = (np.abs(design @ factor.T) ** 2).sum(axis=1)
            shares.append(np.minimum(held / np.maximum(whole, 1e-300), 1.0))
        return np.concatenate(shares)
