"""Synthetic frames: modes of motion with a known law for the truth."""

from pathlib import Path

import numpy as np

from calib.extract import Extract
from calib.targets import Targets
from edge.calibration.inputs import CONTACT_INPUTS, FRAME_INPUTS, MODES
from edge.types import Array, Complex
from tests.support.fields import tip

REST = tip(127)


def make(n: int, seed: int = 0, noise: float = 0.0) -> tuple[Extract, dict[str, Array]]:
    """Inputs drawn at random, and truths that follow from them.

    depth   3 + 40 Re c10 + 300 |c00|^2                 a product of two modes, spin 0
    shear   50 c00 - 400 c01 conj(c00) + (0.1 - 0.05j)  off centre and tilted, with preload
    torsion 200 Im c10
    """
    rng = np.random.default_rng(seed)
    shape = (n, len(FRAME_INPUTS))
    inputs = np.empty(shape, complex)
    inputs.real, inputs.imag = 0.02 * rng.normal(size=shape), 0.02 * rng.normal(size=shape)
    for name in ("volume", "peak", "size"):
        inputs[:, FRAME_INPUTS.index(name)] = np.abs(inputs[:, FRAME_INPUTS.index(name)])
    for name in ("gap", "gap_place"):
        inputs[:, FRAME_INPUTS.index(name)] = 0.0
    mode = {name: inputs[:, FRAME_INPUTS.index(name)] for name in MODES}
    shear = 50 * mode["c00"] - 400 * mode["c01"] * mode["c00"].conj() + (0.1 - 0.05j)
    depth = 3 + 40 * mode["c10"].real + 300 * np.abs(mode["c00"]) ** 2
    values = {
        "displacement_mm": depth + noise * rng.normal(size=n),
        "shear_x_mm": shear.real + noise * rng.normal(size=n),
        "shear_y_mm": shear.imag + noise * rng.normal(size=n),
        "torsion_deg": 200 * mode["c10"].imag + noise * rng.normal(size=n),
    }
    return of_inputs(inputs), values


def of_inputs(inputs: Complex) -> Extract:
    """The edge's result with these inputs: identities trusted, no contact."""
    n = len(inputs)
    return Extract(
        inputs=inputs,
        contact=np.full((n, len(CONTACT_INPUTS)), np.nan, dtype=np.complex128),
        confidence=np.ones(n),
        seen_n=np.full(n, len(REST)),
        trusted=np.ones(n, dtype=np.bool_),
        in_contact=np.ones(n, dtype=np.bool_),
        counts=np.zeros(n, dtype=np.int32),
        angle_rad=np.full(n, np.nan),
        time_us=np.full(n, 1000.0),
        lossy=np.empty((n, 0, len(FRAME_INPUTS)), dtype=np.complex128),
    )


def targets(values: dict[str, Array]) -> Targets:
    n = len(next(iter(values.values())))
    return Targets("table.csv", tuple(Path(f"image_{i}.png") for i in range(n)), values, "0" * 64)
