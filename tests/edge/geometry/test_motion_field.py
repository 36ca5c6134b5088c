"""The motion's covariance: its two components are independent where it says so."""

from dataclasses import replace

import numpy as np

from edge.geometry.motion_field import PREDICTING, component_covariance, precision
from tests.support.fields import tip


def test_components_are_independent_where_there_is_as_much_curl_as_divergence() -> None:
    xy = tip(61).xy_img / 45.0
    joint = precision(xy, 1.0, replace(PREDICTING, curl=1.0))
    inverse = np.linalg.inv(component_covariance(xy, PREDICTING))
    affine = np.column_stack([np.ones(61), xy - xy.mean(axis=0)])
    weighted = inverse @ affine
    single = inverse - weighted @ np.linalg.solve(affine.T @ weighted, weighted.T)
    np.testing.assert_allclose(joint[::2, ::2], single, atol=1e-9 * np.abs(single).max())
    np.testing.assert_allclose(joint[::2, 1::2], 0.0, atol=1e-9 * np.abs(single).max())
