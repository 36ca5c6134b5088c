"""The kernel of `follow`: the same compiled and uncompiled, and wrong sizes are refused."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace
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


#: Of a tip of two rings.
ARRAYS = (small_tip().pins, np.empty((19, 2)))


class Frames:
    """A kernel at rest, and the frames that it is given."""

    def __init__(self, rest: Rest) -> None:
        tip, n = TrackedTip.of(rest), len(rest)
        self.found = deepcopy(rest.pins)
        self.kernel = Follower(tip.lattice, tip.photometric, tip.params, self.found, np.empty((n, 2)))
        self.kernel.settle(rest.xy_img, np.zeros((n, 2)), np.ones(n, bool))

    def follow(self, found: Array) -> tuple[Any, ...]:
        self.found.xy_img[:] = found
        return self.kernel.follow()


def followed() -> Array:
    """(frames, 3 n + 4): what is seen of frames in which pins are missing, displaced, dim, or on one blob."""
    rest = small_tip(3)
    rng = np.random.default_rng(4)
    frames, n, rows = Frames(rest), len(rest), []
    for frame in range(6):
        found = rest.xy_img + 0.8 * frame + rng.normal(0.0, 0.05, (n, 2))
        frames.found.brightness[:] = rest.pins.brightness * rng.normal(1.0, 0.01, n)
        frames.found.sigma_px[:] = rng.uniform(0.04, 0.06, n)
        found[rng.random(n) < 0.1] = np.nan
        dim = rng.choice(n, 5, replace=False)
        frames.found.brightness[dim] *= 0.6
        found[dim[:4]] += rng.normal(0.0, 1.0, (4, 2))
        blurred, far, near = rng.choice(n, 3, replace=False)
        frames.found.sigma_px[blurred] *= 5.0
        found[blurred] += 1.0
        found[far] += 8.0
        found[near] = found[(near + 1) % n]
        xy, _, seen, *result = frames.follow(found)
        assert np.count_nonzero(seen) == result[0]
        rows.append([*np.nan_to_num(xy).ravel(), *seen, *result])
    return np.array(rows, np.float64)


def test_no_pin_is_seen_where_nothing_was_found_or_two_are_on_one_blob() -> None:
    rest = small_tip()
    n = len(rest)
    frames = Frames(rest)
    found = rest.xy_img.copy()
    found[3], found[8] = np.nan, found[9]
    _, _, seen, seen_n, _, goes_on, is_held = frames.follow(found)
    np.testing.assert_array_equal(np.flatnonzero(~seen), [3, 8])
    assert seen_n == n - 2
    assert goes_on
    assert is_held


def test_of_two_pins_that_approach_slowly_one_is_lost_when_they_are_too_near() -> None:
    rest = small_tip(3)
    frames = Frames(rest)
    towards = 0.5 * (rest.xy_img[1] - rest.xy_img[0])
    for share in np.linspace(0.0, 0.7, 30):
        found = rest.xy_img + 0.3
        found[0] += share * towards
        found[1] -= share * towards
        _, _, seen, *_ = frames.follow(found)
        assert seen[2:].all()
        assert np.count_nonzero(seen[:2]) == (2 if share < 0.5 else 1), share


def off_by(pitches: float, step: float) -> int:
    """For how many steps a pin is seen that moves off its neighbours, `step` a frame; pitches."""
    rest = small_tip(4)
    frames = Frames(rest)
    # Towards the middle of two neighbours, where it comes near to none.
    angle = np.deg2rad(30.0)
    away = 19.0 * np.array([np.cos(angle), np.sin(angle)])
    seen_n = 0
    for off in np.arange(step, pitches + 0.5 * step, step):
        found = rest.xy_img + 0.3
        found[0] += off * away
        _, _, seen, *_ = frames.follow(found)
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
    frames = Frames(rest)
    bent = np.random.default_rng(3).normal(0.0, 0.5, (n, 2))
    frames.follow(rest.xy_img + bent)
    found = rest.xy_img + left * bent + 2.0
    found[lost] = np.nan
    *_, autocorrelation, _, _ = frames.follow(found)
    assert autocorrelation == pytest.approx(left, abs=0.02)
    assert frames.kernel.last_xy()[lost] == pytest.approx(
        rest.xy_img[lost] + left * bent[lost] + 2.0, abs=0.1
    )


def test_a_search_tells_what_is_left_of_the_residuals() -> None:
    rest = small_tip()
    n = len(rest)
    kernel = Frames(rest).kernel
    kernel.reset()
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


@pytest.mark.parametrize("field", ["xy_img", "sigma_px", "brightness"])
def test_a_frame_of_another_number_of_pins_is_refused(field: str) -> None:
    tip, pins = TrackedTip.of(small_tip()), small_tip().pins
    short = replace(pins, **{field: getattr(pins, field)[:-1]})
    refused(
        "found and expected of 19", Follower, tip.lattice, tip.photometric, tip.params, short, pins.xy_img
    )


def test_a_state_of_another_number_of_pins_is_refused() -> None:
    kernel = Frames(small_tip()).kernel
    for xy, residual, seen in ((18, 19, 19), (19, 18, 19), (19, 19, 18)):
        with pytest.raises(ValueError, match=r"xy \(19, 2\)"):
            kernel.settle(np.zeros((xy, 2)), np.zeros((residual, 2)), np.ones(seen, bool))
    refused(r"xy \(19, 2\)", kernel.strayed, np.zeros((18, 2)))


def test_a_lattice_of_another_tip_is_refused() -> None:
    small, large = TrackedTip.of(small_tip(1)), TrackedTip.of(small_tip(2))
    refused("wanted for 19 pins", Follower, small.lattice, large.photometric, large.params, *ARRAYS)


def test_more_pins_than_an_index_holds_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    tip = TrackedTip.of(small_tip())
    monkeypatch.setattr("edge.tracking.follow.PINS_MAX", 18)
    refused("19 pins; 18 at most", Follower, tip.lattice, tip.photometric, tip.params, *ARRAYS)


@pytest.mark.parametrize("name", ["closest", "pairs"])
@pytest.mark.parametrize("pin", [-1, 19, 2**31 - 1])
def test_a_lattice_that_names_no_pin_is_refused(name: str, pin: int) -> None:
    tip = TrackedTip.of(small_tip())
    getattr(tip.lattice, name)[3, 1] = pin
    refused(f"{name}: pins of 0 to 18", Follower, tip.lattice, tip.photometric, tip.params, *ARRAYS)


def test_the_filter_refuses_other_sizes() -> None:
    tip = TrackedTip.of(small_tip())
    for wrong in range(5):
        sizes = [18 if k == wrong else 19 for k in range(5)]
        pins = Pins(np.zeros((19, 2)), np.ones(sizes[0]), np.ones(19), np.ones(sizes[1]))
        motion, residual, seen = np.zeros((sizes[2], 2)), np.zeros((sizes[3], 2)), np.ones(sizes[4], bool)
        refused("19 pins", tip.photometric.accepted, pins, motion, residual, seen, False)
    for at_rest, local in ((small_tip(1).pins, np.ones(19)), (small_tip().pins, np.ones(18))):
        refused("19 pins", PhotometricFilter, tip.affine, at_rest, local, tip.params)
