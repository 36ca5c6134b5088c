"""The second contact simulator: its closed forms against sums of point forces, its pictures, a few scenes."""

from dataclasses import replace

import numpy as np
import pytest

from edge.types import Array
from tests.bench import bonded_layer
from tests.bench.contacts import KINDS, SCENES, SecondTip, measure
from tests.bench.half_space import FRICTION, POISSON, Ball, displace, twist_rad

SEED = 3
BALL = Ball(0.3, -0.2, 1.2, (0.5, 0.8))


@pytest.fixture(scope="module")
def tip() -> SecondTip:
    return SecondTip.made(KINDS[0], SEED, presses=60)


def by_point_forces(x: float, y: float, ball: Ball) -> tuple[Array, float]:
    """Boussinesq's and Cerruti's displacements under Hertz's pressure and partial slip; shear modulus 1."""
    a = np.sqrt(ball.radius_mm * ball.depth_mm)
    r = (np.arange(300) + 0.5)[:, None] / 300 * a
    angle = np.arange(200) / 200 * 2.0 * np.pi
    area = r * (a / 300) * (2.0 * np.pi / 200)
    dx, dy = x - ball.x_mm - r * np.cos(angle), y - ball.y_mm - r * np.sin(angle)
    top = 4.0 * a / ((1.0 - POISSON) * np.pi * ball.radius_mm)
    shear_mm = np.hypot(*ball.shear_mm)
    sticks = 1.0 - shear_mm * 2.0 * (1.0 - POISSON) / (FRICTION * (2.0 - POISSON) * ball.depth_mm)
    c = a * np.sqrt(sticks)
    load = top * np.sqrt(1.0 - (r / a) ** 2) * area
    drag = FRICTION * (load - top * c / a * np.sqrt(np.maximum(1.0 - (r / c) ** 2, 0.0)) * area)
    along, far = np.array(ball.shear_mm) / shear_mm, np.hypot(dx, dy)
    ahead = dx * along[0] + dy * along[1]
    pushed = (1.0 - 2.0 * POISSON) / (4.0 * np.pi) * load / far**2
    dragged = drag / (2.0 * np.pi)
    u = [
        (-pushed * d + dragged * ((1.0 - POISSON) / far * w + POISSON * ahead * d / far**3)).sum()
        for d, w in ((dx, along[0]), (dy, along[1]))
    ]
    return np.array(u), float(((1.0 - POISSON) / (2.0 * np.pi) * load / far).sum())


@pytest.mark.parametrize("place", [(2.5, 1.0), (-3.0, 0.4), (5.0, -6.0)])
def test_outside_of_a_ball_the_surface_moves_as_under_its_point_forces(place: tuple[float, float]) -> None:
    found = displace(np.array([place]), [BALL])
    along, w = by_point_forces(*place, BALL)
    assert found.along_mm[0] == pytest.approx(along, rel=1e-3)
    assert found.w_mm[0] == pytest.approx(w, rel=1e-3)


def test_a_twisted_ball_turns_its_core_and_far_off_is_a_torque() -> None:
    """Sticking in the middle, then sliding all over with the torque of Hertz's pressure."""
    ball = Ball(0.0, 0.0, 1.2, sticks=0.3)
    a = np.sqrt(ball.radius_mm * ball.depth_mm)
    turned = (
        displace(np.array([(0.29 * a, 0.0)]), [ball]).along_mm
        - displace(np.array([(0.29 * a, 0.0)]), [replace(ball, sticks=1.0)]).along_mm
    )
    assert turned[0] == pytest.approx([0.0, 0.29 * a * twist_rad(ball, 1.2, np.array(0.3))], rel=1e-3)
    far = displace(np.array([(40.0 * a, 0.0)]), [replace(ball, sticks=1e-6)]).along_mm[0, 1]
    top = 4.0 * a / ((1.0 - POISSON) * np.pi * ball.radius_mm)  # shear modulus 1
    torque = FRICTION * np.pi**2 / 8.0 * top * a**3
    assert far == pytest.approx(torque / (4.0 * np.pi * (40.0 * a) ** 2), rel=0.02)


@pytest.mark.parametrize("name", ["two, 6 pitches apart", "sheared by 2 mm", "bar", "untouched"])
def test_scenes_are_compared_with_their_tools(tip: SecondTip, name: str) -> None:
    scene = next(scene for scene in SCENES if scene.name == name)
    found = measure(tip, scene, 2, SEED)
    compared = {"two": "place_mm", "sheared": "bias_mm", "bar": "direction_deg", "untouched": "right"}
    assert found.right == 1.0
    assert np.isfinite(getattr(found, compared[name.split()[0].rstrip(",")]))
    if name.startswith("two"):
        assert found.place_mm < 1.0  # half a pitch would be 1.4


def test_a_layer_yields_as_a_half_space_to_short_waves_and_as_a_clamped_sheet_to_long_ones() -> None:
    compliance = bonded_layer._compliance(np.array([1e-3, 8.0]))
    short = np.array([[1.0 - POISSON, POISSON - 0.5], [POISSON - 0.5, 1.0 - POISSON]])
    assert 8.0 * compliance[1] == pytest.approx(short, abs=1e-6)
    squeezed = bonded_layer.THICKNESS_MM * (1.0 - 2.0 * POISSON) / (2.0 * (1.0 - POISSON))
    assert np.diag(compliance[0]) == pytest.approx([bonded_layer.THICKNESS_MM, squeezed], rel=1e-3)


def test_a_layer_lies_at_the_tools_depths_and_bulges_round_them() -> None:
    tools = [Ball(-4.0, 0.0, 1.0), Ball(4.0, 1.0, 0.5, (0.2, 0.1))]
    found = bonded_layer.displace(np.array([(-4.0, 0.0), (-7.5, 0.0)]), tools)
    assert found.w_mm[0] == pytest.approx(1.0, abs=0.02)
    assert found.along_mm[1, 0] < -0.01
    assert found.w_mm[1] < 0.0


def test_a_layers_slope_is_that_of_its_indentation() -> None:
    step = 0.1
    offsets = np.array([(0.0, 0.0), (step, 0.0), (-step, 0.0), (0.0, step), (0.0, -step)])
    places = np.array([1.3, 0.4]) + offsets
    found = bonded_layer.displace(places, [Ball(0.0, 0.0, 1.5, radius_mm=4.0)])
    w = found.w_mm
    by_steps = (w[1] - w[2]) / (2.0 * step), (w[3] - w[4]) / (2.0 * step)
    assert found.slope[0] == pytest.approx(by_steps, rel=0.02)
