"""Pins that vanish: side by side or by chance, in a hole, many at once; and when values return."""

import numpy as np
import pytest

from edge.faults.pin_visibility import BASELINE_N, PinVisibility
from edge.params import ASTRAY_REL
from edge.types import Array, Features, Mask, Tracks
from tests.support.fields import contact_region, tip

REST = tip(331)
N = len(REST)
XY = REST.xy_img
PITCH = REST.pattern.pitch_px


def frame(lost: Mask, motion_px: Array | float = 0.0) -> Tracks:
    xy = np.where(lost[:, None], np.nan, XY + motion_px)
    return Tracks.of(xy, np.where(lost, np.nan, REST.pins.sigma_px), ~lost)


def block(rng: np.random.Generator, area: float, share: float) -> Mask:
    """Pins lost in a square of that part of the image."""
    radius = REST.pattern.tip_radius_px
    side = 2.0 * radius * np.sqrt(area)
    corner = REST.pattern.centre_img + rng.uniform(-radius, radius - side, 2)
    within = (np.abs(XY - corner - side / 2.0) < side / 2.0).all(axis=1)
    return np.asarray(within & (rng.random(N) < share))


def vanish(lost: Mask, motion_px: Array | float = 0.0) -> str:
    """The problem when these are lost from one frame to the next."""
    pins = PinVisibility(REST)
    assert not pins.problem(frame(np.zeros(N, np.bool_)))
    return pins.problem(frame(lost, motion_px))


@pytest.mark.parametrize("share", [0.01, 0.03, 0.1])
def test_single_pins_that_are_lost_are_no_corrupt_image(share: float) -> None:
    rng = np.random.default_rng(1)
    problems = [vanish(rng.random(N) < share) for _ in range(300)]
    assert sum("side by side" in problem for problem in problems) <= 3


@pytest.mark.parametrize(
    ("area", "share", "least"), [(1 / 16, 0.8, 0.9), (1 / 8, 0.5, 0.75), (1 / 8, 0.8, 0.98)]
)
def test_pins_lost_side_by_side_are_a_corrupt_image(area: float, share: float, least: float) -> None:
    """Unless all pins move: then a touch may hide them."""
    rng = np.random.default_rng(2)
    blocks = [block(rng, area, share) for _ in range(100)]
    assert np.mean([bool(vanish(lost)) for lost in blocks]) >= least
    moving = [vanish(lost, 0.2 * PITCH) for lost in blocks]
    assert not any("side by side" in problem for problem in moving)


def test_four_neighbours_are_enough_and_four_anywhere_are_not() -> None:
    near = np.argsort(np.hypot(*(XY - XY[40]).T))
    together, apart = np.zeros((2, N), np.bool_)
    together[near[:4]] = True
    apart[[3, 100, 200, 300]] = True
    assert "side by side" in vanish(together)
    assert not vanish(apart)


def test_values_return_with_the_pins() -> None:
    pins, everyone = PinVisibility(REST), np.zeros(N, np.bool_)
    lost = np.random.default_rng(3).permutation(N)
    many, some = (np.isin(np.arange(N), lost[:n]) for n in (50, 10))
    assert not pins.problem(frame(everyone))
    assert all("vanished at once" in pins.problem(frame(many)) for _ in range(20))
    assert not pins.problem(frame(some))


def contact_at(pin: int, radius_px: float) -> Features:
    found = contact_region((XY[pin, 0], XY[pin, 1]), 0.3, np.pi * radius_px**2)
    return Features(np.zeros(N), np.zeros((N, 2)), in_contact=True, contacts=(found,))


def test_a_contact_explains_the_pins_that_it_hides_and_no_others() -> None:
    """It says that they are partly seen, and values are sent."""
    hole = np.hypot(*(XY - XY[165]).T) < 2.6 * PITCH
    pins = PinVisibility(REST)
    assert "a contact hides them" in pins.problem(frame(hole), contact_at(165, 2.0 * PITCH))
    assert pins.explained
    for elsewhere in (contact_at(0, 2.0 * PITCH), contact_at(165, 0.1 * PITCH)):
        pins = PinVisibility(REST)
        assert pins.problem(frame(hole), elsewhere)
        assert not pins.explained


def test_a_tip_that_has_lost_pins_for_good_becomes_usable_again() -> None:
    pins = PinVisibility(REST)
    lost = np.random.default_rng(4).random(N) < 0.15
    assert pins.problem(frame(lost))
    frames_n = next(n for n in range(20_000) if not pins.problem(frame(lost)))
    assert BASELINE_N < frames_n * ASTRAY_REL < 10 * BASELINE_N


def test_a_hole_has_no_values() -> None:
    from_one = np.hypot(*(XY - XY[165]).T)
    assert "no pin is seen either" in vanish(from_one < 2.6 * PITCH)
