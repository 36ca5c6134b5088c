"""Inputs of models: the same for the same touch at any resolution of the camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from edge.calibration.inputs import frame_inputs
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
    for size in (0, 27, 29):
        with pytest.raises(ValueError, match=r"\(28,\) is wanted"):
            frame_inputs(f, PATTERN, np.empty(size, np.complex128))


@pytest.mark.parametrize("radius_px", [0.0, -1.0, 1e-200, np.nan])
def test_a_tip_without_a_radius_is_refused(radius_px: float) -> None:
    f, pattern = touched_features(0.05, (4.0, -2.0)), replace(PATTERN, tip_radius_px=radius_px)
    with pytest.raises(ValueError, match="tip_radius_px: above 0 is wanted"):
        frame_inputs(f, pattern)
