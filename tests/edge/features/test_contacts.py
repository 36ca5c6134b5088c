"""Contacts of fields with known truth."""

import numpy as np
import pytest

from calib.sim import Camera, Tip, Tool, ToolPose, deform
from edge.features.contacts import ContactFinder
from edge.features.params import CONTACTS_MAX
from edge.features.surface import Surface
from edge.geometry.thin_plate import thin_plate_operators
from edge.types import Array, ContactRegion, Rest
from tests.support.fields import CENTRE, bar, frame, make_rest, plane, push, tip

pytestmark = pytest.mark.kernels


def contacts(rest: Rest, motion: Array, noise: float = 0.05, seed: int = 0) -> tuple[ContactRegion, ...]:
    rng = np.random.default_rng(seed)
    xy = rest.xy_img + motion + rng.normal(0.0, noise, rest.xy_img.shape)
    tracks, cells = frame(rest, xy)
    finder = ContactFinder(Surface(rest), xy)
    finder.field.set_area_change(cells.area_px2 / cells.rest_area_px2 - 1.0)
    return finder.find(tracks.seen, noise)


@pytest.mark.parametrize("pins", [127, 331])
@pytest.mark.parametrize("at", [(0.0, 0.0), (31.0, -14.0), (-60.0, 52.0)])
def test_one_push_is_one_contact_in_its_place(pins: int, at: tuple[float, float]) -> None:
    rest = tip(pins)
    (found,) = contacts(rest, push(rest, at, 1.5 * rest.pattern.pitch_px, 0.2))
    assert np.hypot(*(found.xy_img - CENTRE - at)) < 0.1 * rest.pattern.pitch_px
    # A cell's area averages over the bump: 0.37.
    assert found.peak == pytest.approx(0.38, rel=0.08)
    assert len(found.ridge_img) == 1
    assert found.elongation < 1.3
    assert np.isnan(found.orientation_rad)


def test_dots_that_a_tool_drags_along_do_not_draw_its_contact_aside() -> None:
    rest, at, pitch = tip(331), np.array([20.0, -30.0]), 19.0
    motion = push(rest, (20.0, -30.0), 2.0 * pitch, 0.06)
    motion[:, 0] -= 0.4 * pitch * np.exp(-0.5 * ((rest.xy_img - CENTRE - at) ** 2).sum(axis=1) / pitch**2)
    (found,) = contacts(rest, motion)
    assert np.hypot(*(found.weighted_img - CENTRE - at)) > 0.9 * pitch
    assert np.hypot(*(found.xy_img - CENTRE - at)) < 0.6 * pitch


def test_there_are_no_more_contacts_than_the_table_holds() -> None:
    rest, across = tip(331), (-120.0, -40.0, 40.0, 120.0)
    motion = sum(push(rest, (x, y), 16.0, 0.3) for x in across for y in across)
    assert len(contacts(rest, np.asarray(motion))) == CONTACTS_MAX


@pytest.mark.parametrize("pins", [127, 331])
@pytest.mark.parametrize("two_sides", [0.0, 0.8])  # how far its rim stands out there
def test_a_flat_contact_is_one_with_an_area(pins: int, two_sides: float) -> None:
    rest = tip(pins)
    pitch, angle = rest.pattern.pitch_px, np.arctan2(*(rest.xy_img - CENTRE).T)
    radius = 4.0 * pitch if pins == 331 else 2.5 * pitch
    motion = plane(rest, radius, 0.12, 0.7 * pitch) * (1.0 + two_sides * np.cos(2.0 * angle))[:, None]
    (found,) = contacts(rest, motion)
    assert len(found.ridge_img) > 1  # its ring of maxima
    assert np.hypot(*(found.xy_img - CENTRE)) < 0.2 * pitch
    assert 0.5 < found.area_px2 / (np.pi * radius**2) < 1.5
    assert np.isnan(found.orientation_rad)


@pytest.mark.parametrize("degrees", [-80.0, -33.0, 0.0, 20.0, 57.0, 90.0])
def test_a_long_contact_is_one_with_a_direction(degrees: float) -> None:
    rest = tip(331)
    (found,) = contacts(rest, bar(rest, np.deg2rad(degrees), 8.0 * 19.0, 19.0, 0.3))
    assert abs((np.rad2deg(found.orientation_rad) - degrees + 90.0) % 180.0 - 90.0) < 3.0
    assert found.elongation > 3.0


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("tool", "pose", "expected"),
    [
        (Tool("sphere", 3.0), {"x_mm": 3.0, "y_mm": -2.0, "depth_mm": 2.0}, 1),
        (Tool("sphere", 3.0), {"depth_mm": 2.0, "shear_x_mm": 1.5, "shear_y_mm": -1.0}, 1),
        (Tool("flat"), {"depth_mm": 1.0}, 1),
        (Tool("flat"), {"depth_mm": 4.0, "tilt_x_deg": 12.0, "tilt_y_deg": -9.0}, 1),
        (Tool("flat"), {"depth_mm": 3.0, "tilt_x_deg": 8.0, "shear_x_mm": 2.0}, 1),
        (Tool("edge", 1.5, 30.0), {"depth_mm": 2.0}, 1),
        (Tool("edge", 1.5, -27.0), {"x_mm": 0.3, "y_mm": 0.6, "depth_mm": 0.4, "tilt_x_deg": -1.7}, 1),
        (Tool("two", 1.0, 25.0, 2.0), {"depth_mm": 2.0}, 1),
        (Tool("two", 1.0, 0.0, 4.0), {"depth_mm": 2.0}, 2),
        (Tool("two", 1.0, 40.0, 4.0), {"depth_mm": 1.5, "x_mm": 2.0, "y_mm": -3.0}, 2),
        (Tool("two", 1.5, 100.0, 4.0), {"depth_mm": 2.0, "x_mm": -4.0}, 2),
        (Tool("two", 1.5, 25.0, 5.0), {"depth_mm": 1.5}, 2),
        (Tool("two", 1.5, 70.0, 8.0), {"depth_mm": 1.5, "x_mm": 2.0}, 2),
    ],
)
def test_simulated_tools_make_a_contact_a_place(tool: Tool, pose: dict[str, float], expected: int) -> None:
    camera = Camera(tip=Tip())
    motion = camera.project(deform(camera.tip, (ToolPose(tool, **pose),)).tips_mm)
    rest_xy = camera.project(camera.tip.tips_mm)
    rest = make_rest(rest_xy + (CENTRE - camera.centre_img), 18.9)
    found = contacts(rest, motion - rest_xy)
    assert len(found) == expected
    if tool.kind == "edge":
        assert np.rad2deg(found[0].orientation_rad) == pytest.approx(tool.angle_deg, abs=5.0)


def test_a_jittering_pin_at_the_rim_is_no_contact() -> None:
    rest = tip(331)
    motion = push(rest, (0.0, 0.0), 40.0, 0.1)
    motion[np.argmax(rest.xy_img[:, 0])] -= [0.9, 0.0]
    assert len(contacts(rest, motion)) == 1


@pytest.mark.compiled
def test_of_noise_alone_the_highest_place_is_taken_as_one_contact() -> None:
    """Whether something touches was decided before, by cells together."""
    for seed in range(20):
        assert len(contacts(tip(331), np.zeros((331, 2)), seed=seed)) == 1


def test_where_no_cell_has_grown_there_is_no_contact() -> None:
    assert contacts(tip(331), np.zeros((331, 2)), noise=0.0) == ()


@pytest.mark.compiled
def test_a_single_touch_stays_one_with_poorly_seen_pins() -> None:
    """Noise that sigma does not show, with outliers, like that of pins behind glare."""
    rest = tip(127)
    rng = np.random.default_rng(9)
    for seed in range(20):
        motion = push(rest, (20.0, -30.0), 50.0, 0.25) + rng.normal(0.0, 0.4, (127, 2))
        motion[rng.choice(127, 6, replace=False)] += rng.normal(0.0, 2.0, (6, 2))
        assert len(contacts(rest, motion, seed=seed)) == 1


def test_moments_are_sums_over_the_points_nearest_to_each_contact() -> None:
    rest = tip(127)
    pitch = rest.pattern.pitch_px
    turning = (rest.xy_img - CENTRE) @ np.array([[0.0, 0.03], [-0.03, 0.0]])
    xy = rest.xy_img + push(rest, (60.0, -15.0), 40.0, 0.2) + push(rest, (-50.0, 30.0), 40.0, 0.15) + turning
    surface = Surface(rest)
    near = ContactFinder(surface, xy)
    near.field.set_area_change(np.full(127, 0.1))  # each cell has grown
    near.field.find(xy)
    near.peaks.set_field(near.field.divergence, near.field.active, near.field.n_active)
    near.peaks.find(surface.divergence_noise, 0.1, 0.01)
    near.regions.merge(surface.divergence_noise, 0.05)
    regions, points_img = near.regions, np.asarray(near.field.points)
    assert regions.n_contacts == 2
    near.find_moments()
    _, along_x, along_y = thin_plate_operators(rest.xy_img, points_img)
    u, v = (xy - rest.xy_img).T
    divergence, curl = along_x @ u + along_y @ v, along_x @ v - along_y @ u
    assert np.median(curl) == pytest.approx(0.06, rel=1e-3)
    middles = np.array(regions.middle)[:2]
    apart = points_img[:, None] - middles
    distance = np.hypot(*apart.transpose(2, 0, 1))
    for i in range(2):
        radius = max(2.0 * pitch, 1.25 * regions.semi_axis[i])
        weight = np.maximum(1.0 - (distance[:, i] / radius) ** 2, 0.0)
        weight[distance[:, 1 - i] < distance[:, i]] = 0.0
        total = weight @ np.maximum(divergence, 0.0)
        moment, turned = (weight * divergence) @ apart[:, i] / total, (weight * curl) @ apart[:, i] / total
        np.testing.assert_allclose(near.divergence_moment[i], moment, atol=2e-3 * pitch)
        np.testing.assert_allclose(near.curl_moment[i], [-turned[1], turned[0]], atol=2e-3 * pitch)
