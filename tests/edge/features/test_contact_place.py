"""Pins round a contact: its place and its moments."""

import numpy as np
import pytest

from edge.features.contact_place import ContactPlace
from edge.features.peaks import PeakFinder
from edge.features.regions import Regions
from edge.features.surface import Surface
from edge.geometry.thin_plate import thin_plate_operators
from edge.types import Array
from tests.support.fields import CENTRE, push, tip

pytestmark = pytest.mark.kernels

REST = tip(127)
PITCH = REST.pattern.pitch_px


def made() -> tuple[Surface, PeakFinder, Regions, ContactPlace]:
    surface = Surface(REST)
    peaks = PeakFinder(surface.inside)
    regions = Regions(peaks, float(surface.x_img[0]), float(surface.y_img[0]), surface.step_px)
    return surface, peaks, regions, ContactPlace(REST.xy_img, PITCH, surface.field, regions)


def find(
    surface: Surface, peaks: PeakFinder, regions: Regions, xy: Array, change: Array | None = None
) -> None:
    """Contacts of pins at xy, whose cells have grown by a tenth each or by `change`."""
    surface.field.set_area_change(np.full(127, 0.1) if change is None else change)
    surface.field.find(xy)
    peaks.set_field(surface.field.divergence)
    peaks.find(surface.divergence_noise, 0.1, 0.01)
    regions.merge(surface.divergence_noise, 0.05)


def test_places_are_means_of_the_nearest_pins_weighted_by_area_change() -> None:
    surface, peaks, regions, near = made()
    xy = REST.xy_img + push(REST, (60.0, -15.0), 40.0, 0.2) + push(REST, (-50.0, 30.0), 40.0, 0.15)
    change = np.random.default_rng(2).normal(0.1, 0.1, 127).astype(np.float32).astype(np.float64)
    find(surface, peaks, regions, xy, change)
    assert regions.n_contacts == 2
    near.find_places(xy)
    middles = np.array(regions.middle)[:2]
    distance = np.hypot(*(xy[:, None] - middles).transpose(2, 0, 1))
    for i in range(2):
        radius = max(2.0 * PITCH, 1.25 * regions.semi_axis[i])
        weight = np.maximum(change, 0.0) * np.maximum(1.0 - (distance[:, i] / radius) ** 2, 0.0)
        weight[distance[:, 1 - i] < distance[:, i]] = 0.0
        np.testing.assert_allclose(np.array(near.place)[i], weight @ xy / weight.sum(), atol=1e-9)


def test_moments_are_sums_over_the_points_nearest_to_each_contact() -> None:
    surface, peaks, regions, near = made()
    turning = (REST.xy_img - CENTRE) @ np.array([[0.0, 0.03], [-0.03, 0.0]])
    xy = REST.xy_img + push(REST, (60.0, -15.0), 40.0, 0.2) + push(REST, (-50.0, 30.0), 40.0, 0.15) + turning
    find(surface, peaks, regions, xy)
    assert regions.n_contacts == 2
    near.find_moments()
    _, along_x, along_y = thin_plate_operators(REST.xy_img, surface.points_img)
    u, v = (xy - REST.xy_img).T
    divergence, curl = along_x @ u + along_y @ v, along_x @ v - along_y @ u
    assert np.median(curl) == pytest.approx(0.06, rel=1e-3)
    middles = np.array(regions.middle)[:2]
    apart = surface.points_img[:, None] - middles
    distance = np.hypot(*apart.transpose(2, 0, 1))
    for i in range(2):
        radius = max(2.0 * PITCH, 1.25 * regions.semi_axis[i])
        weight = np.maximum(1.0 - (distance[:, i] / radius) ** 2, 0.0)
        weight[distance[:, 1 - i] < distance[:, i]] = 0.0
        total = weight @ np.maximum(divergence, 0.0)
        moment, turned = (weight * divergence) @ apart[:, i] / total, (weight * curl) @ apart[:, i] / total
        np.testing.assert_allclose(near.divergence_moment[i], moment, atol=2e-3 * PITCH)
        np.testing.assert_allclose(near.curl_moment[i], [-turned[1], turned[0]], atol=2e-3 * PITCH)
