"""The curves and polynomials of a calibration, evaluated together. Compiled; runs uncompiled too.

Idea: a file has half a dozen models of some sixty terms each, evaluated once a frame. The arithmetic takes
microseconds; a call from Python for each would take as long. So all models that share their inputs are laid
out one after the other in a few arrays, and evaluated in one call.

Rules
- The terms of a polynomial are products of inputs, given as columns of the row (inputs, their conjugates).
  Models share half of their terms, and terms their first factors: each product is computed once, as a shorter
  one times one more factor.
- Complex numbers are pairs of float64. A factor, which widens the sigma alone, is in single precision.
- A NaN among a model's inputs gives NaN, within the model's range.
- The GIL is held: the scratch belongs to the object, and the work is short.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

from collections.abc import Sequence

import cython
import numpy as np
from numpy.typing import NDArray

from edge.calibration.file import Curve, Polynomial
from edge.calibration.inputs import term_columns
from edge.types import Array, Mask

if cython.compiled:
    from cython.cimports.libc.math import NAN, isnan, sqrt
else:
    from math import isnan, sqrt
    from math import nan as NAN  # noqa: N812

#: Rows of a factor L that are summed together.
ROWS = 4


@cython.final
@cython.cclass
class ModelKernel:
    """Curves and polynomials of the same inputs.

    inputs   their names
    models   in the order of their outputs
    Raises   ValueError: arrays of a model of sizes that do not fit, an unknown input
    """

    def __init__(self, inputs: Sequence[str], models: Sequence[Curve | Polynomial]) -> None:
        self.n_inputs, self._n_models = len(inputs), len(models)
        self._wanted = np.ones(len(models), np.uint8)
        outputs: list[tuple[float, float, float]] = []
        first: list[tuple[int, int, int, int]] = [(0, 0, 0, 0)]
        curve_inputs: list[int] = []
        knots: list[tuple[float, float]] = []
        columns: list[list[int]] = []
        weights: list[tuple[float, float]] = []
        spread = np.zeros((0, 2 * ROWS), np.float32)
        for model in models:
            if isinstance(model, Curve):
                curve_inputs.append(_curve_input(model, inputs))
                knots += model.knots
                outputs.append((-np.inf, np.inf, model.sigma))
            else:
                curve_inputs.append(-1)
                columns += _columns_of(model, inputs)
                weights += model.weights
                spread = np.concatenate([spread, _rows_by_four(model)])
                outputs += [(*valid, s) for valid, s in zip(model.valid, model.sigma, strict=True)]
            first.append((len(outputs), len(knots), len(columns), len(spread)))
        self.n_outputs = len(outputs)
        begins = np.array(first, np.intp).T.copy()
        self._first_output, self._first_knot, self._first_term, self._first_spread = begins
        self._curve_input = np.array(curve_inputs, np.intp)
        self._knots = np.array(knots, np.float64).reshape(-1, 2)
        products, steps = _products_of(columns)
        self._shorter, self._column = np.array(steps, np.int32).reshape(-1, 2).T.copy()
        self._products = np.zeros((len(products), 2))
        self._product_of = np.array([products[tuple(factors)] for factors in columns], np.int32)
        self._weights = np.array(weights, np.float64).reshape(-1, 2)
        self._spread = spread
        self._low, self._high, self._sigma = np.array(outputs, np.float64).reshape(-1, 3).T.copy()
        self._row = np.zeros((2 * len(inputs), 2))
        self._terms = np.zeros((np.diff(begins[2]).max(initial=1), 2))

    def want(self, wanted: Mask) -> None:
        """Evaluate from now on the models of which this is true, (models,) bool; others become NaN.

        Raises ValueError: another number of models
        """
        if wanted.shape != (self._n_models,):
            raise ValueError(f"wanted ({self._n_models},) is needed")
        self._wanted = wanted.astype(np.uint8)

    def run(self, z: Array, out: Array) -> None:
        """Write value, sigma, and whether out of range, of every output of one frame.

        z        (2 inputs,) float64: real and imaginary part of each input
        out      (outputs, 3) float64, written
        """
        n: cython.Py_ssize_t = self.n_inputs
        i: cython.Py_ssize_t
        for i in range(n):
            self._row[i, 0] = self._row[n + i, 0] = z[2 * i]
            self._row[i, 1] = z[2 * i + 1]
            self._row[n + i, 1] = -z[2 * i + 1]
        self._multiply()
        for i in range(self._n_models):
            if not self._wanted[i]:
                self._leave_out(i, out)
            elif self._first_knot[i] < self._first_knot[i + 1]:
                self._run_curve(i, out)
            else:
                self._run_polynomial(i, out)

    def _multiply(self) -> None:
        """The products of this row."""
        i: cython.Py_ssize_t
        k: cython.Py_ssize_t
        re: cython.double
        im: cython.double
        q_re: cython.double
        q_im: cython.double
        self._products[0, 0] = 1.0
        self._products[0, 1] = 0.0
        for i in range(self._column.shape[0]):
            k = self._shorter[i]
            re = self._products[k, 0]
            im = self._products[k, 1]
            k = self._column[i]
            q_re = self._row[k, 0]
            q_im = self._row[k, 1]
            self._products[i + 1, 0] = re * q_re - im * q_im
            self._products[i + 1, 1] = re * q_im + im * q_re

    def _leave_out(self, m: cython.Py_ssize_t, out: Array) -> None:
        for output in range(self._first_output[m], self._first_output[m + 1]):
            out[output, 0] = NAN
            out[output, 1] = NAN
            out[output, 2] = 0.0

    def _run_curve(self, m: cython.Py_ssize_t, out: Array) -> None:
        """Linear between the knots, flat beyond them."""
        k: cython.Py_ssize_t = self._first_knot[m]
        last: cython.Py_ssize_t = self._first_knot[m + 1] - 1
        output: cython.Py_ssize_t = self._first_output[m]
        x: cython.double = self._row[self._curve_input[m], 0]
        y: cython.double = x
        inside: cython.bint = self._knots[k, 0] <= x <= self._knots[last, 0]
        if x <= self._knots[k, 0]:
            y = self._knots[k, 1]
        elif x >= self._knots[last, 0]:
            y = self._knots[last, 1]
        elif not isnan(x):
            while k + 1 < last and x >= self._knots[k + 1, 0]:
                k += 1
            y = (self._knots[k + 1, 1] - self._knots[k, 1]) / (self._knots[k + 1, 0] - self._knots[k, 0])
            y = y * (x - self._knots[k, 0]) + self._knots[k, 1]
        out[output, 0] = y
        out[output, 1] = self._sigma[output]
        out[output, 2] = 0.0 if inside else 1.0

    def _run_polynomial(self, m: cython.Py_ssize_t, out: Array) -> None:
        """Sum of weighted terms; sigma widened by |L psi|^2, psi being the terms."""
        begin: cython.Py_ssize_t = self._first_term[m]
        n: cython.Py_ssize_t = self._first_term[m + 1] - begin
        i: cython.Py_ssize_t
        k: cython.Py_ssize_t
        re: cython.double
        im: cython.double
        y_re: cython.double = 0.0
        y_im: cython.double = 0.0
        for i in range(n):
            k = self._product_of[begin + i]
            re = self._products[k, 0]
            im = self._products[k, 1]
            self._terms[i, 0] = re
            self._terms[i, 1] = im
            y_re += self._weights[begin + i, 0] * re - self._weights[begin + i, 1] * im
            y_im += self._weights[begin + i, 0] * im + self._weights[begin + i, 1] * re
        away: cython.double = self._square_of_spread(m, n)
        output: cython.Py_ssize_t = self._first_output[m]
        self._write(output, y_re, sqrt(1.0 + away), out)
        if output + 1 < self._first_output[m + 1]:
            self._write(output + 1, y_im, sqrt(1.0 + away), out)

    def _square_of_spread(self, m: cython.Py_ssize_t, n: cython.Py_ssize_t) -> float:
        """|L psi|^2, ROWS rows of L at a time."""
        by_re: cython.float[8] = [0.0] * 8
        by_im: cython.float[8] = [0.0] * 8
        spread: cython.float[:, ::1] = self._spread
        first: cython.Py_ssize_t
        i: cython.Py_ssize_t
        r: cython.Py_ssize_t
        re: cython.float
        im: cython.float
        total: cython.double = 0.0
        for first in range(self._first_spread[m], self._first_spread[m + 1], n):
            for r in range(8):
                by_re[r] = by_im[r] = 0.0
            for i in range(n):
                re = cython.cast(cython.float, self._terms[i, 0])
                im = cython.cast(cython.float, self._terms[i, 1])
                for r in range(8):
                    by_re[r] += spread[first + i, r] * re
                    by_im[r] += spread[first + i, r] * im
            for r in range(4):
                re = by_re[r] - by_im[4 + r]
                im = by_im[r] + by_re[4 + r]
                total += cython.cast(cython.double, re) * re + cython.cast(cython.double, im) * im
        return total

    def _write(self, output: cython.Py_ssize_t, y: float, widened: float, out: Array) -> None:
        """One output: its value within its range, its sigma, whether it was out of range."""
        below: cython.bint = y < self._low[output]
        above: cython.bint = y > self._high[output]
        out[output, 0] = self._low[output] if below else self._high[output] if above else y
        out[output, 1] = self._sigma[output] * widened
        out[output, 2] = 1.0 if below or above else 0.0


def _products_of(
    terms: Sequence[Sequence[int]],
) -> tuple[dict[tuple[int, ...], int], list[tuple[int, int]]]:
    """Rows of the products that terms are made of; and of each but the first, that of the product without its
    last factor, and this factor.
    """
    products: dict[tuple[int, ...], int] = {(): 0}
    steps: list[tuple[int, int]] = []
    for term in terms:
        for k, factor in enumerate(term):
            product = tuple(term[: k + 1])
            if product not in products:
                products[product] = len(products)
                steps.append((products[tuple(term[:k])], factor))
    return products, steps


def _rows_by_four(model: Polynomial) -> NDArray[np.float32]:
    """A factor's rows, four at a time and filled up with zeros, as `_square_of_spread` takes them."""
    n = len(model.terms)
    padding = [[(0.0, 0.0)] * n] * ((ROWS - len(model.spread) % ROWS) % ROWS)
    rows = np.array([*model.spread, *padding], np.float32).reshape(-1, ROWS, n, 2)
    return np.ascontiguousarray(rows.transpose(0, 2, 3, 1).reshape(-1, 2 * ROWS))


def _curve_input(model: Curve, inputs: Sequence[str]) -> int:
    """Column of a curve's input. Raises ValueError."""
    if model.input not in inputs or len(model.knots) < 2:
        raise ValueError(f"curve: two knots or more and an input of {', '.join(inputs)} are wanted")
    return inputs.index(model.input)


def _columns_of(model: Polynomial, inputs: Sequence[str]) -> list[list[int]]:
    """The columns of each term's factors. Raises ValueError."""
    n, outputs = len(model.terms), len(model.outputs)
    if n < 1 or len(model.weights) != n or any(len(row) != n for row in model.spread):
        raise ValueError(
            f"polynomial: {n} terms, but another number of weights or of numbers in a row of spread"
        )
    if outputs not in (1, 2) or len(model.valid) != outputs or len(model.sigma) != outputs:
        raise ValueError("polynomial: 1 or 2 outputs are wanted, and a range and a sigma for each")
    try:
        return term_columns(model.terms, inputs)
    except KeyError as error:
        raise ValueError(f"polynomial: input {error} is not one of {', '.join(inputs)}") from None
