"""Inputs of models: the same for the same touch at any resolution of the camera."""

from dataclasses import replace

import numpy as np
import pytest

from calib.extract import contact_inputs, frame_inputs
from edge.calibration.evaluation import InputRow
from edge.calibration.inputs import CONTACT_INPUTS, FRAME_INPUTS
from edge.types import ContactRegion, Features, FittedContact
from tests.support.calibrations import PATTERN, touched_features

pytestmark = pytest.mark.kernels

XY = np.array([0.3, -0.4])


def test_inputs_are_free_of_resolution() -> None:
    f = touched_features(0.05, (4.0, -2.0))
    assert f.shear_px is not None
    assert f.volume_px2 is not None
    doubled = replace(f, shear_px=2 * f.shear_px, volume_px2=4 * f.volume_px2)
    larger = replace(PATTERN, tip_radius_px=2 * PATTERN.tip_radius_px)
    np.testing.assert_allclose(frame_inputs(f, PATTERN), frame_inputs(doubled, larger))


def test_the_inputs_of_a_contact() -> None:
    f, r = touched_features(0.05, (4.0, -2.0)), PATTERN.tip_radius_px
    fitted = FittedContact(PATTERN.centre_img - r * XY, 2.0, 3.0, XY, -XY)
    contact = ContactRegion(
        XY, PATTERN.centre_img + r * XY, 0.1, 9.0, 0.0, 1.0, XY[None], PATTERN.centre_img, XY, -XY
    )
    p, shear = 0.3 - 0.4j, (4.0 - 2.0j) / r
    expected = [p, 0.1, shear, 3.0 / r, 0.0, p / r, -p / r, np.nan, np.nan, np.nan, np.nan, np.nan]
    z = contact_inputs(contact, replace(f, shear_px=np.array([4.0, -2.0])), PATTERN)
    np.testing.assert_allclose(z, expected, rtol=1e-12)
    row = InputRow(CONTACT_INPUTS)
    row.write_contact(replace(contact, fitted=fitted), f, PATTERN)
    np.testing.assert_allclose(row.values[7:], [-p, 3.0, 2.0, p, -p], rtol=1e-12)
    row.write_contact(contact, f, PATTERN)  # nothing of the contact before is left
    assert np.isnan(row.values[7:]).all()


def test_a_row_holds_nothing_of_the_frame_before() -> None:
    row = InputRow(FRAME_INPUTS)
    touched = touched_features(0.05, (4.0, -2.0))
    row.write_frame(replace(touched, modes_px=np.ones(21, np.complex128)), PATTERN)
    row.write_frame(Features(touched.area_change, touched.displacement_px, in_contact=True), PATTERN)
    np.testing.assert_array_equal(row.values[:-2], np.full(len(FRAME_INPUTS) - 2, np.nan + 0j))
    assert not row.values[-2:].any()
