"""Inputs of models: the same for the same touch at any resolution of the camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from edge.calibration.inputs import FRAME_INPUTS, InputRow, frame_inputs
from edge.types import Features
from tests.support.calibrations import PATTERN, touched_features

pytestmark = pytest.mark.kernels


def test_inputs_are_free_of_resolution() -> None:
    f = touched_features(0.05, (4.0, -2.0))
    doubled = Features(
        area_change=f.area_change,
        displacement_px=f.displacement_px,
        in_contact=True,
        shear_px=2 * f.shear_px if f.shear_px is not None else None,
        contacts=f.contacts,
        volume_px2=4 * f.volume_px2 if f.volume_px2 is not None else None,
    )
    larger = replace(PATTERN, tip_radius_px=2 * PATTERN.tip_radius_px)
    np.testing.assert_allclose(frame_inputs(f, PATTERN), frame_inputs(doubled, larger))


def test_a_row_of_another_size_is_refused() -> None:
    f = touched_features(0.05, (4.0, -2.0))
    for names in ((), FRAME_INPUTS[1:], (*FRAME_INPUTS, "more")):
        with pytest.raises(ValueError, match="28 inputs are wanted"):
            InputRow(names).write_frame(f, PATTERN)
    assert f.contacts
    with pytest.raises(ValueError, match="12 inputs are wanted"):
        InputRow(FRAME_INPUTS).write_contact(f.contacts[0], f, PATTERN)


def test_modes_of_another_number_are_refused() -> None:
    f = replace(touched_features(0.05, (4.0, -2.0)), modes_px=np.zeros(20, np.complex128))
    with pytest.raises(ValueError, match=r"modes \(21,\) are wanted"):
        frame_inputs(f, PATTERN)


def test_a_row_holds_nothing_of_the_frame_before() -> None:
    row = InputRow(FRAME_INPUTS)
    touched = touched_features(0.05, (4.0, -2.0))
    row.write_frame(replace(touched, modes_px=np.ones(21, np.complex128)), PATTERN)
    row.write_frame(Features(touched.area_change, touched.displacement_px, in_contact=True), PATTERN)
    np.testing.assert_array_equal(row.values[:-2], np.full(len(FRAME_INPUTS) - 2, np.nan + 0j))
    assert not row.values[-2:].any()


@pytest.mark.parametrize("radius_px", [0.0, -1.0, 1e-200, np.nan])
def test_a_tip_without_a_radius_is_refused(radius_px: float) -> None:
    f, pattern = touched_features(0.05, (4.0, -2.0)), replace(PATTERN, tip_radius_px=radius_px)
    with pytest.raises(ValueError, match="tip_radius_px: above 0 is wanted"):
        frame_inputs(f, pattern)
