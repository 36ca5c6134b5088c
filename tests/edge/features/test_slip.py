"""Slip of motion fields with known truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from calib.sim import Camera, Tip, Tool, ToolPose, deform
from edge.features.pin_motion import PinMotion
from edge.features.slip import Slip
from edge.pipeline import Pipeline
from edge.recording import RecordingSource
from edge.runtime.tare import tare
from edge.types import Array, Feature
from tests.edge.features.test_pin_motion import turned
from tests.support.fields import CENTRE, make_rest, plane, push, tip

pytestmark = [pytest.mark.kernels, pytest.mark.compiled]


class TestSlip:
    """Stick: a load's motion. Slip: parts of the contact against each other."""

    rest = tip(331)
    xy = rest.xy_img
    pins = np.flatnonzero(np.hypot(*(xy - CENTRE).T) < 70.0).astype(np.int32)

    def run(self, motions: list[Array], sigma: float = 0.05, seed: int = 0) -> list[tuple[float, float]]:
        rng = np.random.default_rng(seed)
        slip = Slip(PinMotion(self.rest))
        unknown = np.full(len(self.xy), np.nan)
        states = [
            slip.update(m + rng.normal(0.0, sigma, m.shape), unknown, self.pins, sigma) for m in motions
        ]
        return [(s.slip_px, s.probability) for s in states]

    def test_resting_contact_does_not_slip(self) -> None:
        base = plane(self.rest, 70.0, 0.1, 12.0)
        states = self.run([base] * 300)
        assert max(p for _, p in states) < 0.5
        assert np.mean([p for _, p in states]) < 0.02
        assert np.mean([s for s, _ in states]) < 0.02

    def test_a_rigid_load_that_sticks_is_no_slip(self) -> None:
        base = plane(self.rest, 70.0, 0.1, 12.0)
        drag = [
            base * (1 + 0.01 * k) + [0.5 * k, -0.3 * k] + turned(self.xy, 0.004 * k, CENTRE)
            for k in range(30)
        ]
        assert max(p for _, p in self.run(drag)) < 0.5

    def test_a_probe_that_wanders_over_the_skin_slips(self) -> None:
        walk = [push(self.rest, (2.0 * k, 0.0), 30.0, 0.15) for k in range(10)]
        states = self.run(walk)[1:]
        assert min(p for _, p in states) > 0.9
        # Pins move by the field's slope times the step: sqrt(mean |grad u|^2) of 2 px.
        assert 0.05 < np.mean([s for s, _ in states]) < 0.6

    def test_a_rim_that_lags_behind_the_core_slips(self) -> None:
        far = np.hypot(*(self.xy - CENTRE).T)
        core = np.where(far < 40.0, 1.0, 0.4)[:, None] * np.array([1.0, 0.0])
        states = self.run([core * k for k in range(6)])[1:]
        assert min(p for _, p in states) > 0.9

    def test_first_frame_and_too_few_pins_give_no_slip(self) -> None:
        slip = Slip(PinMotion(self.rest))
        change = np.zeros(len(self.xy))
        assert slip.update(np.zeros_like(self.xy), change, self.pins, 0.05).probability == 0.0
        assert slip.update(np.ones_like(self.xy), change, self.pins[:3], 0.05).slip_px == 0.0
        slip.forget()
        assert slip.update(9.0 * np.ones_like(self.xy), change, self.pins, 0.05).slip_px == 0.0

    @pytest.mark.parametrize("recording", ["press", "two_contacts"])
    def test_pressing_straight_in_is_no_slip(self, data_dir: Path, recording: str) -> None:
        """One ball, and two whose pins' motion no common load explains."""
        frames = list(RecordingSource(data_dir / f"{recording}.mcap"))
        pipeline = Pipeline(tare([f.image for f in frames[:8]], np.inf), demand=frozenset({Feature.SLIP}))
        features = [pipeline.process(f).features for f in frames]
        detected = [f.slip_probability for f in features if f is not None and f.in_contact]
        assert len(detected) > 10
        assert max(p for p in detected if p is not None) < 0.5

    @pytest.mark.parametrize(("friction", "slips"), [(10.0, False), (0.5, True)])
    def test_simulated_drag(self, friction: float, slips: bool) -> None:
        """A tilted flat, dragged: at low friction more than half of it slides, at high none."""
        camera = Camera(tip=Tip(friction=friction))
        moved = [
            deform(camera.tip, (ToolPose(Tool("flat"), depth_mm=2.0, tilt_y_deg=5.0, shear_x_mm=0.1 * k),))
            for k in range(9, 18)
        ]
        rest_xy = camera.project(camera.tip.tips_mm)
        shift = CENTRE - camera.centre_img
        rng = np.random.default_rng(0)
        slip = Slip(PinMotion(make_rest(rest_xy + shift, 18.9)))
        unknown = np.full(len(rest_xy), np.nan)
        pins = np.flatnonzero(np.hypot(*(rest_xy - camera.centre_img).T) < 50.0).astype(np.int32)
        states = []
        for d in moved:
            noise = rng.normal(0.0, 0.05, rest_xy.shape)
            states.append(slip.update(camera.project(d.tips_mm) - rest_xy + noise, unknown, pins, 0.05))
        assert (float(moved[-1].slip.mean()) > 0.5) == slips
        assert (np.mean([s.probability for s in states[4:]]) > 0.5) == slips
