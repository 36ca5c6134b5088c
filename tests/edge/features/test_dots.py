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

pytestmark = [pytest.mark.kernels, pytest.mark.compiled]
GEL = SurfaceDots(144)
REST = make_rest(GEL.project(GEL.caps_mm()), 25.0)
NOISE_PX = 0.04
EVENLY = [Ball(1.0 + a * np.cos(0.5), -1.0 + a * np.sin(0.5), 1.0) for a in np.linspace(-6.0, 6.0, 7)]


@pytest.fixture(scope="module")
def dots() -> DotContacts:
    return DotContacts(Surface(REST))


def contacts(
    dots: DotContacts, tools: Sequence[Ball | Bar], lost: Sequence[int] = (), *, outwards: float = 1.0
) -> tuple[ContactRegion, ...]:
    noise = NOISE_PX * np.random.default_rng(1).standard_normal(REST.xy_img.shape)
    seen = ~np.isin(np.arange(len(REST)), lost)
    xy = REST.xy_img + outwards * (GEL.project(GEL.caps_mm(tools)) - REST.xy_img) + noise
    xy[~seen] = REST.xy_img[~seen]
    return dots.find(xy, seen)


def off_mm(found: Sequence[ContactRegion], balls: Sequence[Ball]) -> float:
    """Largest distance of a ball from the contact next to it."""
    places = GEL.project(np.array([(ball.x_mm, ball.y_mm, 0.0) for ball in balls]))
    away = np.array([np.hypot(*(places - contact.middle_img).T) for contact in found])
    return float(away.min(axis=0).max() * GEL.pitch_mm / REST.pattern.pitch_px)


@pytest.mark.parametrize("outwards", [1.0, -1.0])  # a skin that is compressed goes inwards
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
def test_each_ball_is_a_contact_in_its_place(dots: DotContacts, balls: list[Ball], outwards: float) -> None:
    found = contacts(dots, balls, outwards=outwards)
    assert len(found) == len(balls)
    assert off_mm(found, balls) < 0.6
    assert [contact.peak for contact in found] == sorted((c.peak for c in found), reverse=True)
    assert found[0].fitted is not None
    if any(shear := balls[0].shear_mm):
        assert outwards * found[0].fitted.shear @ np.array(shear) > 0.0


@pytest.mark.parametrize("tools", [*([Bar(1.0, -1.0, 0.5, *b)] for b in [(1.0,), (0.6, 12.0, 0.3)]), EVENLY])
def test_a_bar_or_edge_is_one_with_a_direction(dots: DotContacts, tools: list[Ball | Bar]) -> None:
    (found,) = contacts(dots, tools)
    assert found.orientation_rad == pytest.approx(0.5, abs=np.radians(5.0))
    assert found.elongation > 2.0


def test_noise_is_no_contact_and_lost_dots_make_and_hide_none(dots: DotContacts) -> None:
    assert contacts(dots, []) == ()
    ball = Ball(4.0, -3.0, 1.0, radius_mm=2.6)
    far = np.argsort(np.hypot(*(GEL.roots_mm - (4.0, -3.0)).T))[-40:]
    (found,) = contacts(dots, [ball], far.tolist())
    assert off_mm([found], [ball]) < 0.6
    assert contacts(dots, [ball], list(range(8, 144))) == ()
    # None of four that are alike has the evidence alone on 36 dots.
    far = np.flatnonzero(np.abs(GEL.roots_mm).max(axis=1) > 3.0 * GEL.pitch_mm)
    four = [Ball(x, y, 0.6, radius_mm=2.6) for x in (-5.5, 5.5) for y in (-5.5, 5.5)]
    assert len(contacts(dots, four, far.tolist())) == 4
