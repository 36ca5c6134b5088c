"""The divergence between the pins: exact where it can be, sharper than two surfaces where it cannot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from edge.geometry.motion_field import (
    PREDICTING,
    SHARP,
    component_covariance,
    divergence_operator,
    precision,
)
from edge.geometry.thin_plate import thin_plate_operators
from edge.types import Array
from tests.support.fields import tip

REST = tip(331)
PITCH = REST.pattern.pitch_px
KNOTS = REST.xy_img
LINE = np.linspace(-6.0, 6.0, 25) * PITCH
POINTS = np.stack(np.meshgrid(LINE, LINE), axis=-1).reshape(-1, 2) + KNOTS.mean(axis=0)
OPERATOR = divergence_operator(KNOTS, POINTS, PITCH, SHARP)


def gradient(xy: Array, centre: Array, width: float) -> tuple[Array, Array]:
    """Gradient of a Gaussian hill at xy, and its divergence there."""
    d = xy - centre
    r2 = (d**2).sum(axis=1) / width**2
    hill = np.exp(-0.5 * r2)
    return -d * hill[:, None], -(2.0 - r2) * hill


def test_an_affine_motion_has_its_trace_everywhere() -> None:
    motion = KNOTS @ np.array([[0.03, 0.01], [-0.02, 0.05]]).T + [4.0, -7.0]
    np.testing.assert_allclose(OPERATOR @ motion.ravel(), 0.08, atol=1e-9)


def test_divergence_of_a_gradient_field_is_more_exact_than_by_two_surfaces() -> None:
    _, along_x, along_y = thin_plate_operators(KNOTS, POINTS)
    rng = np.random.default_rng(0)
    ours, theirs = [], []
    for _ in range(20):
        centre = KNOTS.mean(axis=0) + rng.uniform(-4.0, 4.0, 2) * PITCH
        motion, _ = gradient(KNOTS, centre, 1.2 * PITCH)
        _, true = gradient(POINTS, centre, 1.2 * PITCH)
        ours.append(OPERATOR @ motion.ravel() - true)
        theirs.append(along_x @ motion[:, 0] + along_y @ motion[:, 1] - true)
    assert np.sqrt(np.mean(np.square(ours))) < 0.5 * np.sqrt(np.mean(np.square(theirs)))


def test_a_rotation_of_a_patch_has_hardly_any_divergence() -> None:
    motion, _ = gradient(KNOTS, KNOTS.mean(axis=0), 2.0 * PITCH)
    turned = np.column_stack([-motion[:, 1], motion[:, 0]])
    assert np.abs(OPERATOR @ turned.ravel()).max() < 0.02 * np.abs(OPERATOR @ motion.ravel()).max()


def test_the_unit_of_length_is_free() -> None:
    np.testing.assert_allclose(
        divergence_operator(10.0 * KNOTS, 10.0 * POINTS, 10.0 * PITCH, SHARP), OPERATOR / 10.0, atol=1e-9
    )


def test_components_are_independent_where_there_is_as_much_curl_as_divergence() -> None:
    xy = tip(61).xy_img / 45.0
    joint = precision(xy, 1.0, replace(PREDICTING, curl=1.0))
    inverse = np.linalg.inv(component_covariance(xy, PREDICTING))
    affine = np.column_stack([np.ones(61), xy - xy.mean(axis=0)])
    weighted = inverse @ affine
    single = inverse - weighted @ np.linalg.solve(affine.T @ weighted, weighted.T)
    np.testing.assert_allclose(joint[::2, ::2], single, atol=1e-9 * np.abs(single).max())
    np.testing.assert_allclose(joint[::2, 1::2], 0.0, atol=1e-9 * np.abs(single).max())
