"""Pins round a contact: area change near a place, share of visible pins, and place; and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from edge.features.contact_place import ContactPlace
from edge.features.peaks import PeakFinder
from edge.features.regions import Regions
from edge.features.split import SplitTest
from edge.features.surface import Surface
from tests.support.fields import CENTRE, push, tip

pytestmark = pytest.mark.kernels

REST = tip(127)
PITCH = REST.pattern.pitch_px


def made() -> tuple[Surface, PeakFinder, Regions, ContactPlace]:
    surface = Surface(REST)
    peaks = PeakFinder(surface.inside)
    regions = Regions(peaks, float(surface.x_img[0]), float(surface.y_img[0]), surface.step_px)
    return surface, peaks, regions, ContactPlace(REST.xy_img, PITCH, surface.field, peaks, regions)


def test_area_change_near_a_place_is_the_weighted_mean_of_the_cells() -> None:
    surface, _, _, near = made()
    change = np.random.default_rng(0).normal(size=127)
    surface.field.find(change, REST.xy_img)
    at = CENTRE + np.array([25.0, -31.0])
    d2 = ((REST.xy_img - at) ** 2).sum(axis=1) / PITCH**2
    weight = np.exp(-d2) * (d2 <= 9.0)
    assert near.area_change_near(*at) == pytest.approx(weight @ change / weight.sum(), rel=1e-6)
    assert near.area_change_near(-1e6, 0.0) == 0.0


def test_visible_share_counts_pins_within_two_and_a_half_pitches() -> None:
    *_, near = made()
    seen = np.random.default_rng(1).random(127) < 0.5
    within = np.hypot(*(REST.xy_img - CENTRE).T) <= 2.5 * PITCH
    assert near.visible_share(seen, *CENTRE) == pytest.approx(seen[within].mean())
    assert near.visible_share(seen, -1e6, 0.0) == 0.0


def test_places_are_means_of_the_nearest_pins_weighted_by_area_change() -> None:
    surface, peaks, regions, near = made()
    xy = REST.xy_img + push(REST, (60.0, -15.0), 40.0, 0.2) + push(REST, (-50.0, 30.0), 40.0, 0.15)
    change = np.random.default_rng(2).normal(0.1, 0.1, 127).astype(np.float32).astype(np.float64)
    surface.field.find(change, xy)
    peaks.set_field(surface.field.divergence)
    peaks.find(surface.divergence_noise, 0.1, 0.01)
    regions.merge(surface.divergence_noise, 0.05)
    assert regions.n_contacts == 2
    near.find_places(xy)
    middles = np.array(regions.middle)[:2]
    distance = np.hypot(*(xy[:, None] - middles).transpose(2, 0, 1))
    for i in range(2):
        radius = max(2.0 * PITCH, 1.25 * regions.semi_axis[i])
        weight = np.maximum(change, 0.0) * np.maximum(1.0 - (distance[:, i] / radius) ** 2, 0.0)
        weight[distance[:, 1 - i] < distance[:, i]] = 0.0
        np.testing.assert_allclose(np.array(near.place)[i], weight @ xy / weight.sum(), atol=1e-9)


def test_peaks_without_area_change_and_guessed_contacts_are_dropped() -> None:
    surface, peaks, regions, near = made()
    places = np.array([[60.0, -15.0], [-50.0, 30.0]])
    xy = REST.xy_img + push(REST, tuple(places[0]), 40.0, 0.2) + push(REST, tuple(places[1]), 40.0, 0.15)
    away = np.hypot(*(REST.xy_img[:, None] - CENTRE - places).transpose(2, 0, 1)) / PITCH

    def contacts(change: np.ndarray, seen: np.ndarray) -> list[float]:
        surface.field.find(change, xy)
        peaks.set_field(surface.field.divergence)
        peaks.find(surface.divergence_noise, 0.1, 0.01)
        near.drop_peaks_without_area_change()
        regions.merge(surface.divergence_noise, 0.05)
        near.drop_guesses(seen)
        return [float(regions.ridge(i)[0, 0] - CENTRE[0]) for i in range(regions.n_contacts)]

    everyone, area_change = np.ones(127, np.bool_), np.full(127, 0.1)
    assert contacts(area_change, everyone) == pytest.approx([60.0, -50.0], abs=0.5 * PITCH)
    assert contacts(np.where(away[:, 0] < 3.0, 0.0, 0.1), everyone) == pytest.approx([-50.0], abs=0.5 * PITCH)
    assert contacts(area_change, away[:, 1] > 3.0) == pytest.approx([60.0], abs=0.5 * PITCH)
    assert len(contacts(area_change, np.zeros(127, np.bool_))) == 2  # all there is


def test_sizes_that_do_not_fit_are_refused() -> None:
    surface, peaks, regions, near = made()
    with pytest.raises(ValueError, match="wanted"):
        near.visible_share(np.ones(126, np.bool_), 0.0, 0.0)
    with pytest.raises(ValueError, match="wanted"):
        near.find_places(REST.xy_img[1:])
    with pytest.raises(ValueError, match="wanted"):
        ContactPlace(REST.xy_img[1:], PITCH, surface.field, peaks, regions)


def test_the_split_test_refuses_arrays_of_other_sizes() -> None:
    surface, peaks, regions, _ = made()
    grid, divergences = surface.sharper_grid(2.0)
    with pytest.raises(ValueError, match="divergences"):
        SplitTest(grid, divergences[1:], surface.field, peaks, regions, PITCH)
    with pytest.raises(ValueError, match="divergences"):
        SplitTest(grid, divergences[:, 1:], surface.field, peaks, regions, PITCH)
    x, y, point = grid
    far = np.where(point >= 0, 10**6, -1)
    with pytest.raises(ValueError, match="point"):
        SplitTest((x, y, far), divergences, surface.field, peaks, regions, PITCH)
    look = SplitTest(grid, divergences, surface.field, peaks, regions, PITCH)
    for i in (-1, 0, 8):  # no contact yet
        with pytest.raises(ValueError, match="contact"):
            look.find_peaks(i)
    assert not look.find_pair(0.05)
