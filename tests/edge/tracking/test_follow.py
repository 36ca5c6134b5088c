"""The kernel of `follow`: the same compiled and uncompiled, and wrong sizes are refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from edge.tracking.follow import Follower
from edge.tracking.outliers import PhotometricFilter
from edge.tracking.tip import TrackedTip
from edge.types import Array, Pins, Rest
from tests.support.fields import CENTRE, hexagon, make_rest
from tests.support.kernels import uncompiled
from tests.support.refusals import refused

pytestmark = pytest.mark.kernels


def small_tip(rings: int = 2) -> Rest:
    return make_rest(hexagon(rings, 19.0) + CENTRE, 19.0)


def follower(rest: Rest) -> Follower:
    tip = TrackedTip.of(rest)
    return Follower(tip.lattice, tip.photometric, tip.params)


def followed() -> Array:
    """(frames, 3 n + 4): what is seen of frames in which pins are missing, displaced, dim, or on one blob."""
    rest = small_tip(3)
    rng = np.random.default_rng(4)
    kernel, n, rows = follower(rest), len(rest), []
    kernel.settle(rest.xy_img, np.zeros((n, 2)), np.ones(n, bool))
    for frame in range(6):
        found = rest.xy_img + 0.8 * frame + rng.normal(0.0, 0.05, (n, 2))
        brightness = rest.pins.brightness * rng.normal(1.0, 0.01, n)
        sigma = rng.uniform(0.04, 0.06, n)
        found[rng.random(n) < 0.1] = np.nan
        dim = rng.choice(n, 5, replace=False)
        brightness[dim] *= 0.6
        found[dim[:4]] += rng.normal(0.0, 1.0, (4, 2))
        blurred, far, near = rng.choice(n, 3, replace=False)
        sigma[blurred] *= 5.0
        found[blurred] += 1.0
        found[far] += 8.0
        found[near] = found[(near + 1) % n]
        xy, _, seen, *result = kernel.follow(found, sigma, brightness)
        assert np.count_nonzero(seen) == result[0]
        rows.append([*np.nan_to_num(xy).ravel(), *seen, *result])
    return np.array(rows, np.float64)


def test_arrays_of_another_layout_are_looked_at_in_each_frame() -> None:
    rest = small_tip()
    found = np.asfortranarray(rest.xy_img)
    brightness: Any = rest.pins.brightness.astype(np.float32)
    kernel = follower(rest)
    kernel.settle(rest.xy_img, np.zeros((len(rest), 2)), np.ones(len(rest), bool))
    for _ in range(2):
        found += 0.3
        xy, _, seen, *_ = kernel.follow(found, rest.pins.sigma_px, brightness)
        assert seen.all()
        np.testing.assert_array_equal(xy, found)
        np.testing.assert_allclose(kernel.last_xy(), found)


@pytest.mark.compiled  # otherwise any type will do
def test_arrays_of_another_type_are_refused_each_time() -> None:
    rest = small_tip()
    kernel = follower(rest)
    kernel.follow(rest.xy_img, rest.pins.sigma_px, rest.pins.brightness)
    single: Any = rest.pins.sigma_px.astype(np.float32)
    for _ in range(2):
        refused("dtype", kernel.follow, rest.xy_img, single, rest.pins.brightness)


def test_no_pin_is_seen_where_nothing_was_found_or_two_are_on_one_blob() -> None:
    rest = small_tip()
    n = len(rest)
    kernel = follower(rest)
    kernel.settle(rest.xy_img, np.zeros((n, 2)), np.ones(n, bool))
    found = rest.xy_img.copy()
    found[3], found[8] = np.nan, found[9]
    _, _, seen, seen_n, _, goes_on, is_held = kernel.follow(found, rest.pins.sigma_px, rest.pins.brightness)
    np.testing.assert_array_equal(np.flatnonzero(~seen), [3, 8])
    assert seen_n == n - 2
    assert goes_on
    assert is_held


def test_of_two_pins_that_approach_slowly_one_is_lost_when_they_are_too_near() -> None:
    rest = small_tip(3)
    n = len(rest)
    kernel = follower(rest)
    kernel.settle(rest.xy_img, np.zeros((n, 2)), np.ones(n, bool))
    towards = 0.5 * (rest.xy_img[1] - rest.xy_img[0])
    for share in np.linspace(0.0, 0.7, 30):
        found = rest.xy_img + 0.3
        found[0] += share * towards
        found[1] -= share * towards
        _, _, seen, *_ = kernel.follow(found, rest.pins.sigma_px, rest.pins.brightness)
        assert seen[2:].all()
        assert np.count_nonzero(seen[:2]) == (2 if share < 0.5 else 1), share


def off_by(pitches: float, step: float) -> int:
    """For how many steps a pin is seen that moves off its neighbours, `step` a frame; pitches."""
    rest = small_tip(4)
    n = len(rest)
    kernel = follower(rest)
    kernel.settle(rest.xy_img, np.zeros((n, 2)), np.ones(n, bool))
    # Towards the middle of two neighbours, where it comes near to none.
    angle = np.deg2rad(30.0)
    away = 19.0 * np.array([np.cos(angle), np.sin(angle)])
    seen_n = 0
    for off in np.arange(step, pitches + 0.5 * step, step):
        found = rest.xy_img + 0.3
        found[0] += off * away
        _, _, seen, *_ = kernel.follow(found, rest.pins.sigma_px, rest.pins.brightness)
        assert seen[1:].all()
        seen_n += int(seen[0])
    return seen_n


def test_a_pin_may_move_more_than_half_a_pitch_off_its_neighbours_if_it_was_never_lost() -> None:
    assert off_by(0.75, 0.05) == 15
    assert off_by(0.75, 0.75) == 0  # at once it may be another one
    assert 15 < off_by(1.3, 0.05) < 20  # a pitch off it is in another one's place


@pytest.mark.parametrize("left", [0.0, 0.5, 1.0])
def test_the_autocorrelation_is_what_is_left_of_the_residuals_and_a_lost_pin_keeps_as_much(
    left: float,
) -> None:
    rest = small_tip(4)
    n, lost = len(rest), 12
    kernel = follower(rest)
    kernel.settle(rest.xy_img, np.zeros((n, 2)), np.ones(n, bool))
    bent = np.random.default_rng(3).normal(0.0, 0.5, (n, 2))
    kernel.follow(rest.xy_img + bent, rest.pins.sigma_px, rest.pins.brightness)
    found = rest.xy_img + left * bent + 2.0
    found[lost] = np.nan
    *_, autocorrelation, _, _ = kernel.follow(found, rest.pins.sigma_px, rest.pins.brightness)
    assert autocorrelation == pytest.approx(left, abs=0.02)
    assert kernel.last_xy()[lost] == pytest.approx(rest.xy_img[lost] + left * bent[lost] + 2.0, abs=0.1)


def test_a_search_tells_what_is_left_of_the_residuals() -> None:
    rest = small_tip()
    n = len(rest)
    kernel = follower(rest)
    bent = np.random.default_rng(3).normal(0.0, 0.5, (n, 2))
    assert kernel.settle(rest.xy_img, bent, np.ones(n, bool)) == 0.0
    assert kernel.settle(rest.xy_img, 0.4 * bent, np.ones(n, bool)) == pytest.approx(0.4)
    assert kernel.settle(rest.xy_img, -bent, np.ones(n, bool)) == 0.0


@pytest.mark.compiled
def test_compiled_and_uncompiled_give_the_same() -> None:
    reference = uncompiled("tests.edge.tracking.test_follow", "followed", "edge.tracking.follow")
    ours = followed()
    rejected = (ours[:, 2 * 37 : 3 * 37] == 0).sum(axis=1)
    assert rejected.min() > 5  # missing, displaced, on one blob, and unlike themselves
    np.testing.assert_array_equal(ours, np.frombuffer(reference).reshape(ours.shape))


@pytest.mark.parametrize(
    "shapes", [((18, 2), 19, 19), ((19, 3), 19, 19), ((19, 2), 20, 19), ((19, 2), 19, 0), ((0, 2), 0, 0)]
)
def test_a_frame_of_another_number_of_pins_is_refused(shapes: tuple[tuple[int, int], int, int]) -> None:
    kernel = follower(small_tip())
    found, sigma, brightness = shapes
    refused(r"found \(19, 2\)", kernel.follow, np.zeros(found), np.ones(sigma), np.ones(brightness))


def test_a_state_of_another_number_of_pins_is_refused() -> None:
    kernel = follower(small_tip())
    for xy, residual, seen in ((18, 19, 19), (19, 18, 19), (19, 19, 18)):
        with pytest.raises(ValueError, match=r"xy \(19, 2\)"):
            kernel.settle(np.zeros((xy, 2)), np.zeros((residual, 2)), np.ones(seen, bool))
    refused(r"xy \(19, 2\)", kernel.strayed, np.zeros((18, 2)))


def test_a_lattice_of_another_tip_is_refused() -> None:
    small, large = TrackedTip.of(small_tip(1)), TrackedTip.of(small_tip(2))
    refused("wanted for 19 pins", Follower, small.lattice, large.photometric, large.params)


def test_more_pins_than_an_index_holds_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    tip = TrackedTip.of(small_tip())
    monkeypatch.setattr("edge.tracking.follow.PINS_MAX", 18)
    refused("19 pins; 18 at most", Follower, tip.lattice, tip.photometric, tip.params)


@pytest.mark.parametrize("name", ["closest", "pairs"])
@pytest.mark.parametrize("pin", [-1, 19, 2**31 - 1])
def test_a_lattice_that_names_no_pin_is_refused(name: str, pin: int) -> None:
    tip = TrackedTip.of(small_tip())
    getattr(tip.lattice, name)[3, 1] = pin
    refused(f"{name}: pins of 0 to 18", Follower, tip.lattice, tip.photometric, tip.params)


def test_the_filter_refuses_other_sizes() -> None:
    tip = TrackedTip.of(small_tip())
    for wrong in range(5):
        sizes = [18 if k == wrong else 19 for k in range(5)]
        pins = Pins(np.zeros((19, 2)), np.ones(sizes[0]), np.ones(19), np.ones(sizes[1]))
        motion, residual, seen = np.zeros((sizes[2], 2)), np.zeros((sizes[3], 2)), np.ones(sizes[4], bool)
        refused("19 pins", tip.photometric.accepted, pins, motion, residual, seen, False)
    for at_rest, local in ((small_tip(1).pins, np.ones(19)), (small_tip().pins, np.ones(18))):
        refused("19 pins", PhotometricFilter, tip.affine, at_rest, local, tip.params)
