"""The Gaussian processes of a calibration, evaluated together. Compiled; runs uncompiled too.

Idea: the kernel of such a process (`calib.process_likelihood`) is a polynomial of third degree, so that the
process is one too: its features are products of inputs with the spin of its outputs, and the fit gives the
mean and the covariance of their weights. With those the data are no longer needed: a frame costs a product
for each term and a few rows of the covariance's root, instead of a kernel for each point.

    value     = sum_k weight_k psi_k                             psi_k = product of inputs
    variance  = sigma^2 (noise + learnt + lost)
    noise     = exp(sum_k noise_weight_k Re psi'_k)              within the range seen in the data
    learnt    = |L psi|^2                                        the uncertainty of the weights
    lost      = exp(scale + sum_k lost_weight_k Re psi"_k) gap^gap_power volume^volume_power
                                                                 the uncertainty due to lost pins

Two outputs are a vector with a different noise along its direction u and across it: when the contact slips,
the length of a shear is less certain than its direction. The noise of x is then u_x^2 along + u_y^2 across,
that of y u_y^2 along + u_x^2 across.

Rules
- Terms of all models share one tree: a product is its parent times one input.
- Only the models in demand are evaluated, and only the products that they need.
- With one output, the real parts of the value and of each row of L are taken; with two, they are x + i y.
- A value outside of `valid` is set to its end. That, and `learnt` above `far`, is reported as out of range.
- A NaN among a model's inputs gives NaN. So does a gap larger than any that the fit tried.
- The GIL is held: the scratch belongs to the object, and the work is short.
"""

# mypy: disable-error-code="valid-type,untyped-decorator,no-any-return"

from __future__ import annotations

from collections.abc import Sequence

import cython
import numpy as np

from edge.calibration.file import Process
from edge.types import Array, Mask

if cython.compiled:
    from cython.cimports.libc.math import NAN, exp, isnan, log, sqrt
else:
    from math import exp, isnan, log, sqrt
    from math import nan as NAN  # noqa: N812

#: Rows of L are padded to whole blocks of so many, for vector instructions.
BLOCK = 4
LOST_MAX = cython.declare(cython.double, 100.0)  # of the logarithm: more is no number any more
VOLUME_MIN = cython.declare(cython.double, 1e-6)  # of the tip's circle times its radius: no load at all


@cython.final
@cython.cclass
class ProcessKernel:
    """The processes of one calibration.

    inputs  names of the frame's inputs, `gap` and `volume` among them
    models  in the order of their outputs
    Raises  KeyError: a term names an unknown input
    """

    def __init__(self, inputs: Sequence[str], models: Sequence[Process]) -> None:
        for model in models:
            _check_sizes(model)
        self.n_inputs, self.n_models = len(inputs), len(models)
        self._gap, self._volume = inputs.index("gap"), inputs.index("volume")
        tree = _Tree(inputs)
        nodes = [[tree.node(term) for term in model.terms] for model in models]
        noise = [[tree.node(term) for term in model.noise_terms] for model in models]
        lost = [[tree.node(term) for term in (m.lost.terms if m.lost else ())] for m in models]
        self._parent, self._letter = np.array(tree.parents, np.int32), np.array(tree.letters, np.int32)
        self._n_nodes = len(tree.parents)
        counts = [
            [len(n), len(e), len(m.outputs), len(o)]
            for n, e, m, o in zip(nodes, noise, models, lost, strict=True)
        ]
        ends = np.cumsum(np.array([[0, 0, 0, 0], *counts]), axis=0)
        self._first = ends.astype(np.int32)
        self.n_outputs = int(ends[-1, 2])
        self._node = np.array([n for part in nodes for n in part], np.int32)
        self._noise_node = np.array([n for part in noise for n in part], np.int32)
        self._lost_node = np.array([n for part in lost for n in part], np.int32)
        self._weight = np.array([w for m in models for w in m.weights], np.float64).reshape(-1, 2)
        self._noise_weight = np.array([w for m in models for w in m.noise_weights], np.float64)
        across = [w for m in models for w in (m.across_weights or m.noise_weights)]
        self._across_weight = np.array(across, np.float64)
        lost_weight = [w for m in models if m.lost for w in m.lost.weights]
        self._lost_weight = np.array(lost_weight, np.float64)
        rows = max((len(model.factor) for model in models), default=0)
        self._width = BLOCK * ((rows + BLOCK - 1) // BLOCK)
        factor = np.zeros((int(ends[-1, 0]), 2, self._width))
        for model, first in zip(models, ends, strict=False):
            part = np.array(model.factor, np.float64).reshape(-1, len(model.terms), 2)
            factor[first[0] : first[0] + len(model.terms), :, : len(part)] = part.transpose(1, 2, 0)
        self._factor = factor
        self._limits = np.array([_limits(m) for m in models], np.float64).reshape(-1, 9)
        self._valid = np.array(
            [(*v, s) for m in models for v, s in zip(m.valid, m.sigma, strict=True)], np.float64
        ).reshape(-1, 3)
        self._re, self._im = np.zeros(self._n_nodes), np.zeros(self._n_nodes)
        self._sums = np.zeros((2, self._width))
        self._active = np.zeros(self._n_nodes, np.int32)
        self._needed = np.zeros(self._n_nodes, np.uint8)
        self.want(np.ones(self.n_models, np.bool_))

    def want(self, wanted: Mask) -> None:
        """Evaluate from now on the models of which this is true, (models,) bool; others become NaN.

        Raises ValueError: another number of models
        """
        if wanted.shape != (self.n_models,):
            raise ValueError(f"wanted ({self.n_models},) is needed")
        self._wanted = wanted.astype(np.uint8)
        self._select()

    def run(self, z: Array, out: Array) -> None:
        """Write value, sigma, and whether out of range, of the outputs of one frame.

        z        (2 inputs,) float64: real and imaginary part of each input
        out      (outputs, 3) float64, written
        """
        self._multiply(z)
        for m in range(self.n_models):
            if self._wanted[m]:
                self._evaluate(m, z[2 * self._gap], z[2 * self._volume], out)
            else:
                self._leave_out(m, out)

    def _select(self) -> None:
        """Which products the wanted models need."""
        m: cython.Py_ssize_t
        k: cython.Py_ssize_t
        for k in range(self._n_nodes):
            self._needed[k] = 0
        for m in range(self.n_models):
            if self._wanted[m]:
                for k in range(self._first[m, 0], self._first[m + 1, 0]):
                    self._needed[self._node[k]] = 1
                for k in range(self._first[m, 1], self._first[m + 1, 1]):
                    self._needed[self._noise_node[k]] = 1
                for k in range(self._first[m, 3], self._first[m + 1, 3]):
                    self._needed[self._lost_node[k]] = 1
        for k in range(self._n_nodes - 1, 0, -1):
            if self._needed[k]:
                self._needed[self._parent[k]] = 1
        self._n_active = 0
        for k in range(1, self._n_nodes):
            if self._needed[k]:
                self._active[self._n_active] = cython.cast(cython.int, k)
                self._n_active += 1

    def _multiply(self, z: Array) -> None:
        k: cython.Py_ssize_t
        p: cython.Py_ssize_t
        a: cython.Py_ssize_t
        x: cython.double
        y: cython.double
        self._re[0] = 1.0
        self._im[0] = 0.0
        for i in range(self._n_active):
            k = self._active[i]
            p = self._parent[k]
            a = self._letter[k]
            if a < self.n_inputs:
                x = z[2 * a]
                y = z[2 * a + 1]
            else:
                a -= self.n_inputs
                x = z[2 * a]
                y = -z[2 * a + 1]
            self._re[k] = self._re[p] * x - self._im[p] * y
            self._im[k] = self._re[p] * y + self._im[p] * x

    def _evaluate(self, m: cython.Py_ssize_t, gap: float, volume: float, out: Array) -> None:
        first: cython.Py_ssize_t = self._first[m, 2]
        two: cython.bint = self._first[m + 1, 2] - first == 2
        value_re: cython.double = 0.0
        value_im: cython.double = 0.0
        k: cython.Py_ssize_t
        width: cython.Py_ssize_t = self._width
        for j in range(width):
            self._sums[0, j] = 0.0
            self._sums[1, j] = 0.0
        for k in range(self._first[m, 0], self._first[m + 1, 0]):
            x = self._re[self._node[k]]
            y = self._im[self._node[k]]
            value_re += self._weight[k, 0] * x - self._weight[k, 1] * y
            value_im += self._weight[k, 0] * y + self._weight[k, 1] * x
            for j in range(width):
                self._sums[0, j] += self._factor[k, 0, j] * x - self._factor[k, 1, j] * y
            if two:
                for j in range(width):
                    self._sums[1, j] += self._factor[k, 0, j] * y + self._factor[k, 1, j] * x
        learnt: cython.double = 0.0
        for j in range(width):
            learnt += self._sums[0, j] * self._sums[0, j] + self._sums[1, j] * self._sums[1, j]
        spread: cython.double = learnt + self._lost(m, gap, volume)
        along: cython.double = self._noise(m, self._noise_weight, 1)
        # Written so that a NaN is reported as out of range too.
        known: cython.bint = learnt <= self._limits[m, 0]
        if not two:
            self._write(first, value_re, spread + along, known, out)
            return
        across: cython.double = self._noise(m, self._across_weight, 3)
        square: cython.double = value_re * value_re + value_im * value_im
        share: cython.double = 0.5  # of x in the direction
        if square > 0.0:
            share = value_re * value_re / square
        self._write(first, value_re, spread + share * along + (1.0 - share) * across, known, out)
        self._write(first + 1, value_im, spread + share * across + (1.0 - share) * along, known, out)

    def _noise(self, m: cython.Py_ssize_t, weight: Array, limit: cython.Py_ssize_t) -> float:
        """Variance of the noise, in units of sigma^2. limit: where its range stands."""
        h: cython.double = 0.0
        k: cython.Py_ssize_t
        for k in range(self._first[m, 1], self._first[m + 1, 1]):
            h += weight[k] * self._re[self._noise_node[k]]
        if h < self._limits[m, limit]:
            h = self._limits[m, limit]
        if h > self._limits[m, limit + 1]:
            h = self._limits[m, limit + 1]
        return exp(h)

    def _lost(self, m: cython.Py_ssize_t, gap: float, volume: float) -> float:
        """Variance from pins that are not seen, in units of sigma^2; NaN: more than the fit tried."""
        if gap <= 0.0:
            return 0.0
        if not gap <= self._limits[m, 8]:
            return NAN
        if volume < VOLUME_MIN:
            volume = VOLUME_MIN
        h: cython.double = self._limits[m, 5]
        k: cython.Py_ssize_t
        for k in range(self._first[m, 3], self._first[m + 1, 3]):
            h += self._lost_weight[k] * self._re[self._lost_node[k]]
        h += self._limits[m, 6] * log(gap) + self._limits[m, 7] * log(volume)
        return exp(min(h, LOST_MAX))

    def _write(self, o: cython.Py_ssize_t, value: float, variance: float, known: bool, out: Array) -> None:
        if isnan(variance):
            value = NAN
        elif value < self._valid[o, 0]:
            value = self._valid[o, 0]
            known = False
        elif value > self._valid[o, 1]:
            value = self._valid[o, 1]
            known = False
        out[o, 0] = value
        out[o, 1] = self._valid[o, 2] * sqrt(variance)
        out[o, 2] = 0.0 if known or isnan(value) else 1.0

    def _leave_out(self, m: cython.Py_ssize_t, out: Array) -> None:
        o: cython.Py_ssize_t
        for o in range(self._first[m, 2], self._first[m + 1, 2]):
            out[o, 0] = NAN
            out[o, 1] = NAN
            out[o, 2] = 0.0


class _Tree:
    """Products of inputs, each its parent times one input; node 0 is 1."""

    def __init__(self, inputs: Sequence[str]) -> None:
        self._letter = {name: i for i, name in enumerate((*inputs, *(f"{name}*" for name in inputs)))}
        self._node: dict[tuple[int, ...], int] = {(): 0}
        self.parents = [0]
        self.letters = [0]

    def node(self, term: Sequence[str]) -> int:
        """Number of a product; it and its parents are added if new."""
        letters = tuple(sorted(self._letter[name] for name in term))
        for n in range(1, len(letters) + 1):
            if letters[:n] not in self._node:
                self._node[letters[:n]] = len(self.parents)
                self.parents.append(self._node[letters[: n - 1]])
                self.letters.append(letters[n - 1])
        return self._node[letters]


def _limits(model: Process) -> Array:
    """One row of `_limits`."""
    lost = model.lost
    known = (-np.inf, 0.0, 0.0, np.inf) if lost is None else (
        lost.scale, lost.gap_power, lost.volume_power, lost.gap_max
    )  # fmt: skip
    across = model.across_range if model.across_weights else model.noise_range
    return np.array([model.far, *model.noise_range, *across, *known])


def _check_sizes(model: Process) -> None:
    """Raises ValueError: lists that belong together differ in length."""
    noise, outputs = len(model.noise_terms), len(model.outputs)
    sizes = len(model.terms), noise, noise if model.across_weights else 0, outputs, outputs
    given = tuple(
        len(part)
        for part in (model.weights, model.noise_weights, model.across_weights, model.valid, model.sigma)
    )
    if given != sizes:
        raise ValueError(f"{sizes} weights, noise, across, valid, sigma are wanted, not {given}")
    if model.lost is not None and len(model.lost.weights) != len(model.lost.terms):
        raise ValueError(f"{len(model.lost.terms)} weights of lost are wanted, not {len(model.lost.weights)}")
