"""One or two, the direction of a long contact, and what is wanted as fitted: on an elastic half-space."""

from dataclasses import replace

import numpy as np
import pytest

from edge.features.contacts import ContactFinder
from edge.features.several.fitted_contacts import Fits
from edge.features.surface import Surface
from edge.types import ContactRegion, Mask
from tests.bench.half_space import Ball, Bar, displace
from tests.support.fields import CENTRE, frame, tip

PITCH_MM, LEVER_MM = 1.5, 0.8
REST = tip(127)
SCALE = REST.pattern.pitch_px / PITCH_MM


class Touch:
    """The frames of one tip."""

    def __init__(self) -> None:
        self.xy = np.empty_like(REST.xy_img)
        self.finder = ContactFinder(Surface(REST), self.xy)


def contacts(
    tools: list[Ball | Bar],
    lost: Mask | None = None,
    fits: Fits = Fits.ALL,
    seed: int = 0,
    touch: Touch | None = None,
) -> tuple[ContactRegion, ...]:
    """Of pins that are levers under the skin, with a centroid's noise.

    touch  that saw the frame before; None: a new one
    """
    skin = displace((REST.xy_img - CENTRE) / SCALE, tools)
    noise = np.random.default_rng(seed).normal(0.0, 0.04, REST.xy_img.shape)
    xy = REST.xy_img + SCALE * (skin.along_mm - LEVER_MM * skin.slope) + noise
    tracks, cells = frame(REST, xy)
    touch = touch or Touch()
    touch.xy[:] = xy
    touch.finder.field.set_area_change(cells.area_px2 / cells.rest_area_px2 - 1.0)
    seen = tracks.seen if lost is None else tracks.seen & ~lost
    return touch.finder.find(seen, 0.04, fits=fits)


@pytest.mark.compiled
def test_two_balls_are_two_and_each_in_its_place() -> None:
    rng = np.random.default_rng(4)
    for seed in range(5):
        half = 1.5 * PITCH_MM * np.exp(1j * rng.uniform(0.0, np.pi))
        balls = [Ball(z.real, z.imag, 1.0, radius_mm=2.4) for z in (0.5 + half, 0.5 - half)]
        found = contacts(list(balls), seed=seed)
        assert len(found) == 2
        assert found[0].peak > found[1].peak
        for contact in found:
            assert contact.fitted is not None
            place = (contact.fitted.place_img - CENTRE) / SCALE
            assert min(np.hypot(*(place - (b.x_mm, b.y_mm))) for b in balls) < 0.3 * PITCH_MM


@pytest.mark.compiled
@pytest.mark.parametrize(
    "tools",
    [
        [Bar(0.6, -0.4, 0.5, 1.0, 6.0, 1.5)],
        [Ball(-1.5, 0.3, 1.0, radius_mm=2.4), Ball(1.5, 0.0, 1.0, radius_mm=2.4)],
    ],
)
def test_a_decision_that_stands_is_what_a_new_one_would_be(tools: list[Ball | Bar]) -> None:
    touch = Touch()
    depths = [*np.linspace(0.6, 1.2, 12), *np.full(12, 1.2), *np.linspace(1.2, 0.6, 12)]
    for seed, depth in enumerate(depths):
        pressed = [replace(tool, depth_mm=depth * tool.depth_mm) for tool in tools]
        follows = contacts(pressed, fits=Fits.NONE, seed=seed, touch=touch)
        fresh = contacts(pressed, fits=Fits.NONE, seed=seed)
        assert len(follows) == len(fresh) == len(tools)
        for one, two in zip(follows, fresh, strict=True):
            np.testing.assert_allclose(one.xy_img, two.xy_img, atol=0.3)
            if isinstance(tools[0], Bar):
                assert abs(one.orientation_rad - two.orientation_rad) < np.deg2rad(1.0)


@pytest.mark.compiled
def test_the_potential_where_two_balls_press_is_that_of_both() -> None:
    """A ball deepens the place of its neighbour: the sum says so, the own part does not."""
    alone = contacts([Ball(-2.5, 0.0, 1.0, radius_mm=2.4)])[0].fitted
    pair = contacts([Ball(-2.5, 0.0, 1.0, radius_mm=2.4), Ball(2.5, 0.0, 1.0, radius_mm=2.4)])
    assert alone is not None
    for contact in pair:
        assert contact.fitted is not None
        assert contact.fitted.potential == pytest.approx(alone.potential, rel=0.1)


@pytest.mark.compiled
def test_only_contacts_in_demand_are_fitted() -> None:
    ball, other = Ball(-3.0, 0.0, 1.0, radius_mm=2.4), Ball(3.0, 0.0, 1.0, radius_mm=2.4)
    for fits, alone, several in (
        (Fits.NONE, False, False),
        (Fits.SEVERAL, False, True),
        (Fits.ALL, True, True),
    ):
        assert [c.fitted is not None for c in contacts([ball], fits=fits)] == [alone]
        assert [c.fitted is not None for c in contacts([ball, other], fits=fits)] == [several] * 2


@pytest.mark.compiled
def test_where_few_pins_are_seen_nothing_is_fitted() -> None:
    lost = np.ones(len(REST), np.bool_)
    lost[:15] = False
    for contact in contacts([Ball(0.0, 0.0, 1.0, radius_mm=2.4)], lost=lost):
        assert contact.fitted is None


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("x_mm", "y_mm", "degrees", "depth_mm"),
    [(-1.43, 0.75, 102.9, 0.40), (0.68, -0.19, 147.9, 0.38), (-0.14, -2.54, 2.2, 0.59)],
)
def test_a_shallow_ball_by_a_deeper_one_is_another_where_their_region_is_round(
    x_mm: float, y_mm: float, degrees: float, depth_mm: float
) -> None:
    """Its peak is hardly parted from the other's, and too low to lengthen the region."""
    way = 2.0 * PITCH_MM * np.exp(1j * np.deg2rad(degrees))
    balls = [
        Ball(x_mm, y_mm, 0.95, radius_mm=1.8),
        Ball(x_mm + way.real, y_mm + way.imag, depth_mm, radius_mm=1.8),
    ]
    assert [len(contacts(list(balls), seed=seed)) for seed in range(5)] == [2] * 5
