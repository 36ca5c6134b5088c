"""Small facts about points, against their definitions."""

import numpy as np

from edge.geometry.layout import circumcentres


def test_a_circumcentre_is_as_far_from_all_corners() -> None:
    points = np.random.default_rng(0).uniform(0, 100, (60, 2))
    triangles = np.arange(60, dtype=np.int32).reshape(-1, 3)
    apart = points[triangles] - circumcentres(points, triangles)[:, None]
    radius = np.hypot(apart[..., 0], apart[..., 1])
    np.testing.assert_allclose(radius, radius[:, :1] * np.ones(3), rtol=1e-9)


def test_corners_on_a_line_have_no_finite_circumcentre() -> None:
    line = np.array([[0.0, 0.0], [1.0, 1.0], [3.0, 3.0]])
    assert not np.isfinite(circumcentres(line, np.array([[0, 1, 2]], np.int32))).any()
