"""Contacts of dots on the surface of a bonded gel, seen by a camera that sees their depth too."""

from collections.abc import Sequence

import numpy as np
import pytest

from edge.features.several import DotContacts
from edge.features.surface import Surface
from edge.types import ContactRegion
from tests.bench.bonded_layer import SurfaceDots
from tests.bench.half_space import Ball, Bar
from tests.support.fields import make_rest
from tests.support.waiting import present

pytestmark = [pytest.mark.kernels, pytest.mark.compiled]
GEL = SurfaceDots(144)
REST = make_rest(GEL.project(GEL.caps_mm()), 25.0)
NOISE_PX = 0.04


@pytest.fixture(scope="module")
def dots() -> DotContacts:
    return DotContacts(Surface(REST))


def contacts(
    dots: DotContacts, tools: Sequence[Ball | Bar], lost: Sequence[int] = ()
) -> tuple[ContactRegion, ...]:
    noise = NOISE_PX * np.random.default_rng(1).standard_normal(REST.xy_img.shape)
    seen = ~np.isin(np.arange(len(REST)), list(lost))
    xy = np.where(seen[:, None], GEL.project(GEL.caps_mm(tools)) + noise, REST.xy_img)
    return dots.find(xy, seen)


def off_mm(found: Sequence[ContactRegion], balls: Sequence[Ball]) -> float:
    """Largest distance of a ball from the contact next to it."""
    places = GEL.project(np.array([(ball.x_mm, ball.y_mm, 0.0) for ball in balls]))
    away = np.array([np.hypot(*(places - contact.middle_img).T) for contact in found])
    return float(away.min(axis=0).max() * GEL.pitch_mm / REST.pattern.pitch_px)


@pytest.mark.parametrize(
    "balls",
    [
        [Ball(4.0, -3.0, 1.0, radius_mm=2.6)],
        [Ball(-3.0, 1.0, 0.8, radius_mm=2.6), Ball(3.0, 3.0, 0.6, radius_mm=2.6)],
        [Ball(-5.0, 0.0, 3.0, radius_mm=2.6), Ball(2.0, 1.0, 1.0, radius_mm=2.6)],
        [Ball(x, y, 0.8, radius_mm=2.6) for x, y in ((0.0, 4.0), (-4.0, -2.5), (3.5, -2.5))],
        [Ball(3.0, 2.0, 2.0, (1.2, -0.9), 5.0)],
    ],
)
def test_as_many_contacts_as_balls_and_each_in_its_place(dots: DotContacts, balls: list[Ball]) -> None:
    found = contacts(dots, balls)
    assert len(found) == len(balls)
    assert off_mm(found, balls) < 0.6
    assert [contact.peak for contact in found] == sorted((c.peak for c in found), reverse=True)
    if any(shear := balls[0].shear_mm):
        assert present(found[0].fitted).shear @ np.array(shear) > 0.0


@pytest.mark.parametrize(("radius_mm", "depth_mm"), [(2.0, 1.0), (0.3, 0.6)])
def test_a_bar_or_edge_is_one_with_a_direction(dots: DotContacts, radius_mm: float, depth_mm: float) -> None:
    found = contacts(dots, [Bar(1.0, -1.0, 0.5, depth_mm, 12.0, radius_mm)])
    assert len(found) == 1
    assert found[0].orientation_rad == pytest.approx(0.5, abs=np.radians(5.0))
    assert found[0].elongation > 2.0


def test_noise_and_a_pull_are_no_contact_and_lost_dots_make_none(dots: DotContacts) -> None:
    assert contacts(dots, []) == ()
    ball = Ball(4.0, -3.0, 1.0, radius_mm=2.6)
    place = GEL.project(np.array([(4.0, -3.0, 0.0)]))[0]
    far = np.argsort(np.hypot(*(REST.xy_img - place).T))[-40:]
    found = contacts(dots, [ball], far.tolist())
    assert len(found) == 1
    assert off_mm(found, [ball]) < 0.6
    assert contacts(dots, [ball], list(range(8, 144))) == ()
    pulled = 2.0 * REST.xy_img - GEL.project(GEL.caps_mm([ball]))
    assert dots.find(pulled, np.ones(len(REST), np.bool_)) == ()
