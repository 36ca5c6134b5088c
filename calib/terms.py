"""Products of inputs, for many frames at once; of one frame `edge.calibration.evaluation` has them."""

from collections.abc import Sequence

import numpy as np

from edge.calibration.inputs import FRAME_INPUTS
from edge.types import Complex


def term_columns(terms: Sequence[Sequence[str]], inputs: Sequence[str]) -> list[list[int]]:
    """The factors of each term as columns of the row (inputs, conjugates of inputs).

    Raises  KeyError: a term names an unknown input
    """
    column = {name: i for i, name in enumerate((*inputs, *(f"{name}*" for name in inputs)))}
    return [[column[name] for name in term] for term in terms]


def frame_terms(inputs: Complex, terms: Sequence[Sequence[str]]) -> Complex:
    """(n, n_terms) complex128, products of the inputs of frames (n, k), columns `FRAME_INPUTS`."""
    return evaluate_terms(inputs, term_columns(terms, FRAME_INPUTS))


def evaluate_terms(z: Complex, terms: Sequence[Sequence[int]]) -> Complex:
    """Products of inputs.

    z        (n, k) complex128, one row a frame
    terms    from `term_columns`
    Returns  (n, n_terms) complex128
    """
    row = np.hstack([z, z.conj()])
    result = np.ones((len(z), len(terms)), dtype=np.complex128)
    for products, term in zip(result.T, terms, strict=True):
        for column in term:
            products *= row[:, column]
    return result
