"""Slip of motion fields with known truth."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from edge.features.pin_motion import PinMotion
from edge.features.slip_and_vibration import Slip
from edge.frame import Pipeline
from edge.pins import take_rest
from edge.recording.reader import RecordingSource
from edge.types import Array, Feature, Index, Rest
from tests.support.fields import CENTRE, plane, tip

pytestmark = [pytest.mark.kernels, pytest.mark.compiled]


class State(NamedTuple):
    slip_px: float
    probability: float
    of_twist: float


class Touch:
    """A touch of given pins, frame by frame."""

    def __init__(self, rest: Rest, pins: Index) -> None:
        self.rest, self.motion = rest, PinMotion(rest)
        self.slip = Slip(rest, self.motion)
        self.motion.n_pins = len(pins)
        np.asarray(self.motion.pins)[: len(pins)] = pins

    def update(self, motion_px: Array, area_change: Array, sigma_px: float, at_ns: int = 0) -> State:
        self.motion.since_rest(self.rest.xy_img + motion_px, np.full(len(self.rest), sigma_px))
        self.slip.update(np.array(self.motion.motion), area_change, sigma_px, at_ns)
        return State(self.slip.slip_px, self.slip.probability, self.slip.of_twist)


class TestSlip:
    """Stick: the skin around the contact moves in proportion to its core. Slip: it lags more and more."""

    rest = tip(331)
    xy = rest.xy_img
    far = np.hypot(*(xy - CENTRE).T)
    shares = np.linspace(0.0, 0.95, 40)  # of the area that slides, frame by frame
    pins = np.flatnonzero(far < 70.0).astype(np.int32)

    def run(self, motions: list[Array], sigma: float = 0.05, seed: int = 0) -> list[State]:
        rng = np.random.default_rng(seed)
        touch, unknown = Touch(self.rest, self.pins), np.full(len(self.xy), np.nan)
        return [touch.update(m + rng.normal(0.0, sigma, m.shape), unknown, sigma) for m in motions]

    def dragged(self, core_px: float, share: float) -> Array:
        """The core moves; the skin around it by a fifth, lagging as Mindlin has it where a share slides."""
        stiff = 1.0 if share == 0.0 else (1.0 - (1.0 - share) ** 1.5) / (1.5 * share)
        share_of_core = np.where(self.far < 40.0, 1.0, 0.2 * stiff)
        return np.outer(share_of_core, [core_px, 0.5 * core_px])

    def twisted(self, core_rad: float, around_rad: float) -> Array:
        """The core turns as one; the skin around it by the second angle at 40 px, falling off by the cube."""
        turn = np.where(self.far < 40.0, core_rad, around_rad * (40.0 / np.maximum(self.far, 1.0)) ** 3)
        moved: Array = turn[:, None] * np.column_stack([CENTRE[1] - self.xy[:, 1], self.xy[:, 0] - CENTRE[0]])
        return moved

    @pytest.mark.parametrize("sense", [1.0, -1.0])
    def test_a_twist_slips_as_lubkin_has_it_and_not_while_it_sticks(self, sense: float) -> None:
        shares = np.linspace(0.0, 0.95, 60)
        core, around = -0.05 * np.log(1.0 - shares), 0.02 * (1.0 - (1.0 - shares) ** 1.7)
        slips = self.run([self.twisted(sense * s, sense * q) for s, q in zip(core, around, strict=True)])
        probability = np.array([state.of_twist for state in slips])
        assert probability[shares < 0.25].max() < 0.5
        assert probability[shares > 0.9].min() > 0.9
        sticks = self.run([self.twisted(sense * s, sense * 0.4 * s) for s in core])
        assert max(state.probability for state in sticks) < 0.1

    def test_noise_alone_neither_slips_nor_presses(self) -> None:
        """A long hold of a small contact whose areas are as noisy as the pins make them; then a drag."""
        motions = [np.zeros_like(self.xy)] * 600 + [self.dragged(10.0 * x, x) for x in self.shares]
        rng, pins = np.random.default_rng(3), np.flatnonzero(self.far < 40.0).astype(np.int32)
        touch, noise = Touch(self.rest, pins), 0.05 / self.rest.pattern.pitch_px
        states = [
            touch.update(m + rng.normal(0.0, 0.05, m.shape), rng.normal(0.0, noise, len(m)), 0.05)
            for m in motions
        ]
        assert max(state.probability for state in states[:600]) < 0.2
        assert min(state.probability for state in states[-4:]) > 0.9

    def test_a_load_that_sticks_is_no_slip_however_far(self) -> None:
        base = plane(self.rest, 70.0, 0.1, 12.0)
        rigid = [base * (1 + 0.01 * k) + [0.5 * k, -0.3 * k] for k in range(30)]
        stuck = [self.dragged(0.4 * k, 0.0) for k in range(60)]
        for motions in (rigid, stuck):
            assert max(s.probability for s in self.run(motions)) < 0.1

    @pytest.mark.parametrize(("way_px", "frames"), [(3.0, 40), (10.0, 40), (30.0, 40), (30.0, 5)])
    def test_slip_becomes_probable_as_half_of_the_contact_slides(self, way_px: float, frames: int) -> None:
        shares = np.linspace(0.0, 0.95, frames)
        states = self.run([self.dragged(way_px * x, x) for x in shares])
        probability = np.array([s.probability for s in states])
        assert probability[shares < 0.3].max() < 0.5
        assert probability[shares > 0.75].min() > 0.5
        assert probability[shares > 0.85].min() > 0.9

    def test_a_whole_contact_that_slides_stays_slipping_until_it_turns_back(self) -> None:
        there = [self.dragged(10.0 * x, x) for x in self.shares]
        held, back = [there[-1]] * 20, [0.7 * there[-1]] * 5
        states = self.run(there + held + back)
        assert min(s.probability for s in states[40:60]) > 0.9 > 0.1 > max(s.of_twist for s in states)
        assert max(s.probability for s in states[60:]) < 0.5

    def test_pressing_begins_the_path_anew(self) -> None:
        (touch, other), still = (Touch(self.rest, self.pins) for _ in "ab"), np.zeros(len(self.xy))
        for k, x in enumerate(self.shares, 1):
            state = touch.update(self.dragged(10.0 * x, x), still, 0.05, k)
            late = other.update(self.dragged(10.0 * x, x), still, 0.05, k + (k == len(self.shares)))
        assert 0.0 < late.slip_px == pytest.approx(1.6 * state.slip_px)  # 2 of 5 periods, not 1 of 4
        one, two = (touch.update(self.dragged(9.5, 0.95), still + 0.1 * k, 0.05) for k in (1, 2))
        assert state.probability == one.probability > 0.9 > two.probability == 0.0

    def test_speed_is_that_of_the_contact_s_parts_against_each_other_once_it_slips(self) -> None:
        """The rim at 0.3 px a frame against the core; stuck to the same object, none."""
        states = self.run([self.dragged(20.0 * x, x) for x in self.shares])
        moved = self.dragged(20.0 / 39, 0.95)[self.pins]
        rms = float(np.hypot(*moved.std(axis=0)))  # a common translation is a load's
        assert states[-1].slip_px == pytest.approx(rms, rel=0.3)
        assert states[5].slip_px < 0.1 * rms

    def test_first_frame_and_too_few_pins_give_no_slip(self) -> None:
        touch, change = Touch(self.rest, self.pins[:2]), np.zeros(len(self.xy))
        assert touch.update(np.zeros_like(self.xy), change, 0.05).probability == 0.0
        for k in range(20):
            assert touch.update(float(k) * np.ones_like(self.xy), change, 0.05) == State(0.0, 0.0, 0.0)
        touch.slip.forget()
        assert touch.update(9.0 * np.ones_like(self.xy), change, 0.05).slip_px == 0.0

    @pytest.mark.parametrize("recording", ["press", "two_contacts"])
    def test_pressing_straight_in_is_no_slip(self, data_dir: Path, recording: str) -> None:
        """One ball, and two whose pins' motion no common load explains."""
        frames = list(RecordingSource(data_dir / f"{recording}.mcap"))
        pipeline = Pipeline(take_rest([f.image for f in frames[:8]]), demand=frozenset({Feature.SLIP}))
        features = [pipeline.process(f).features for f in frames]
        detected = [f.slip_probability for f in features if f is not None and f.in_contact]
        assert len(detected) > 10
        assert max(p for p in detected if p is not None) < 0.5
