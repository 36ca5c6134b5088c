"""Pins round a contact: its place and its moments."""

import numpy as np
import pytest

from edge.features.contacts import ContactFinder
from edge.features.surface import Surface
from edge.geometry.thin_plate import thin_plate_operators
from edge.types import Array
from tests.support.fields import CENTRE, push, tip

pytestmark = pytest.mark.kernels

REST = tip(127)
PITCH = REST.pattern.pitch_px


def finder_of(xy: Array, change: Array | None = None) -> ContactFinder:
    """Regions of pins at xy, whose cells have grown by a tenth each or by `change`."""
    surface = Surface(REST)
    made = ContactFinder(surface, xy)
    made.field.set_area_change(np.full(127, 0.1) if change is None else change)
    made.field.find(xy)
    made.peaks.set_field(made.field.divergence, made.field.active, made.field.n_active)
    made.peaks.find(surface.divergence_noise, 0.1, 0.01)
    made.regions.merge(surface.divergence_noise, 0.05)
    return made


def test_moments_are_sums_over_the_points_nearest_to_each_contact() -> None:
    turning = (REST.xy_img - CENTRE) @ np.array([[0.0, 0.03], [-0.03, 0.0]])
    xy = REST.xy_img + push(REST, (60.0, -15.0), 40.0, 0.2) + push(REST, (-50.0, 30.0), 40.0, 0.15) + turning
    near = finder_of(xy)
    regions, points_img = near.regions, np.asarray(near.field.points)
    assert regions.n_contacts == 2
    near.find_moments()
    _, along_x, along_y = thin_plate_operators(REST.xy_img, points_img)
    u, v = (xy - REST.xy_img).T
    divergence, curl = along_x @ u + along_y @ v, along_x @ v - along_y @ u
    assert np.median(curl) == pytest.approx(0.06, rel=1e-3)
    middles = np.array(regions.middle)[:2]
    apart = points_img[:, None] - middles
    distance = np.hypot(*apart.transpose(2, 0, 1))
    for i in range(2):
        radius = max(2.0 * PITCH, 1.25 * regions.semi_axis[i])
        weight = np.maximum(1.0 - (distance[:, i] / radius) ** 2, 0.0)
        weight[distance[:, 1 - i] < distance[:, i]] = 0.0
        total = weight @ np.maximum(divergence, 0.0)
        moment, turned = (weight * divergence) @ apart[:, i] / total, (weight * curl) @ apart[:, i] / total
        np.testing.assert_allclose(near.divergence_moment[i], moment, atol=2e-3 * PITCH)
        np.testing.assert_allclose(near.curl_moment[i], [-turned[1], turned[0]], atol=2e-3 * PITCH)
