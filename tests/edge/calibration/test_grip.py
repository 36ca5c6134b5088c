"""Friction and slip margin from a sequence of forces."""

import math

import pytest

from edge.calibration import Grip

SURE = dict.fromkeys(("force_n", "force_x_n", "force_y_n", "torque_z_nmm"), 0.0)


def forces(x: float, normal: float = 2.0, y: float = 0.0, torque: float = 0.0) -> dict[str, float]:
    return {"force_n": normal, "force_x_n": x, "force_y_n": y, "torque_z_nmm": torque}


def test_the_largest_load_held_is_the_friction_and_less_leaves_a_margin() -> None:
    grip = Grip()
    assert grip.update(forces(1.0), SURE, None) == {"friction": 0.5, "slip_margin": 0.0}
    harder = grip.update(forces(0.6, normal=4.0, y=-0.8), SURE, None)  # in any direction
    assert harder == {"friction": 0.5, "slip_margin": pytest.approx(0.5)}
    grip.forget()
    assert grip.update(forces(0.0), SURE, None) == {}  # a new touch knows nothing


def test_a_sliding_contact_has_the_coefficient_of_friction_and_no_margin() -> None:
    """The load grows until it slides, and no further."""
    grip, mu = Grip(), 0.6
    for x in (0.4, 0.8, 1.2, 1.2, 1.2):
        sliding = grip.update(forces(x), SURE, None)
    assert sliding == {"friction": pytest.approx(mu), "slip_margin": 0.0}


def test_an_uncertain_load_has_not_been_held() -> None:
    """0.6 +- 0.1 N over 1 N held at least 0.5; a normal force of 1 +- 0.3 N takes 0.18 more. 0.4 is noise."""
    sigmas, pressed = {**SURE, "force_x_n": 0.1}, Grip()
    assert pressed.update(forces(0.4, normal=1.0), sigmas, None) == {}
    assert pressed.update(forces(0.6, normal=1.0), sigmas, None)["friction"] == pytest.approx(0.5)
    assert pressed.update(forces(0.0, normal=1.0), sigmas, None)["slip_margin"] == 1.0
    both = {**sigmas, "force_n": 0.3}
    expected = 0.6 - math.hypot(0.1, 0.18)
    assert Grip().update(forces(0.6, normal=1.0), both, None)["friction"] == pytest.approx(expected)


def test_a_pure_twist_slides_at_hertzs_torque() -> None:
    """On a contact 5 mm in radius, 3 pi / 16 mu N a is the torque at the coefficient mu."""
    area, mu = math.pi * 25.0, 0.7
    torque = 3 * math.pi / 16 * mu * 2.0 * 5.0
    assert Grip().update(forces(0.0, torque=torque), SURE, area)["friction"] == pytest.approx(mu)
    assert "friction" not in Grip().update(forces(0.0, torque=torque), SURE, None)


def test_without_forces_nothing_is_reported() -> None:
    for lacking in ("force_n", "force_x_n"):
        known = {name: value for name, value in forces(1.0).items() if name != lacking}
        assert Grip().update(known, SURE, 1.0) == {}
    assert Grip().update(forces(math.nan), SURE, 1.0) == {}
    assert Grip().update(forces(1.0, normal=-0.1), SURE, 1.0) == {}
