"""Vibration: known amplitudes and frequencies at several frame rates, as numbers and as images."""

import math

import numpy as np
import pytest

from calib.sim import Simulator, Tool, ToolPose
from edge.features.slip_and_vibration import Vibration
from edge.frame import Pipeline
from edge.pins import take_rest
from edge.types import Array, Feature

pytestmark = pytest.mark.kernels

N = 100
PINS = np.arange(40, dtype=np.int32)
FROM_HZ = 10.0


def shaken(
    hz: float, amplitude_px: float, rate_hz: float, *, sigma_px: float = 0.0, lost: bool = False
) -> Array:
    """rms of each frame of two seconds: a sine beside a steady motion, captured with some jitter."""
    rng, motion, found = np.random.default_rng(0), np.empty((N, 2)), []
    vibration = Vibration(np.zeros((N, 2)))
    for k in range(int(2 * rate_hz)):
        at_s = k / rate_hz + rng.uniform(0.0, 1e-4)
        motion[:] = rng.normal((0.0, 30.0 * at_s), sigma_px, (N, 2))
        motion[:, 0] += amplitude_px * math.sin(2.0 * math.pi * hz * at_s)
        if lost:
            motion[k % N] = math.nan
        found.append(vibration.update(motion, PINS, len(PINS), sigma_px, round(1e9 * at_s))[0])
    return np.array(found)


@pytest.mark.parametrize("rate_hz", [30, 60, 120, 240])
@pytest.mark.parametrize(
    ("hz_rel", "gain"), [(1.0, math.sqrt(0.5)), (0.1, 0.02), (1.4, 0.88)], ids=["edge", "below", "above"]
)
@pytest.mark.parametrize("lost", [False, True])
def test_a_sine_has_its_rms_at_any_frame_rate(rate_hz: int, hz_rel: float, gain: float, lost: bool) -> None:
    """As far as the filter lets it pass, and without the noise of the centroids."""
    found = shaken(hz_rel * FROM_HZ, 0.5, rate_hz, sigma_px=0.05, lost=lost)
    settled = found[rate_hz:]
    assert np.isfinite(settled).all()
    tolerance = 0.02 if hz_rel < 1.0 else 0.08
    assert settled.mean() / (0.5 * math.sqrt(0.5)) == pytest.approx(gain, abs=tolerance)
    assert np.isnan(found[: int(0.9 * rate_hz / FROM_HZ)]).all(), "not known before a period has passed"


def test_noise_and_steady_motion_are_no_vibration() -> None:
    assert np.nanmean(shaken(0.0, 0.0, 120, sigma_px=0.05)[60:]) < 0.015


@pytest.mark.parametrize("step_ns", [0, -1_000_000, 50_000_000, 10**9], ids=["again", "back", "slow", "gap"])
def test_after_a_gap_it_is_not_known_for_a_period(step_ns: int) -> None:
    motion = np.empty((N, 2))
    vibration, at_ns, found = Vibration(np.zeros((N, 2))), 0, []
    for k in range(100):
        at_ns += step_ns if k == 50 else 10_000_000
        motion[:] = 0.5 * (-1) ** k
        found.append(vibration.update(motion, PINS, len(PINS), 0.0, at_ns))
    rms = np.array([value for value, _ in found], np.float64)
    assert rms[49] == pytest.approx(0.5 * math.sqrt(2.0), rel=0.05)
    assert np.isnan(rms[50:58]).all()
    assert found[50][1] is None
    assert rms[-1] == pytest.approx(rms[49], rel=0.05)
    assert found[-1][1] == pytest.approx(50.0)


@pytest.mark.compiled
def test_a_simulated_contact_that_vibrates() -> None:
    """Images of a flat tool that shakes the skin it holds at 20 Hz, then only holds it, then lets go."""
    rate_hz = 60.0
    simulator = Simulator(rate_hz=rate_hz)
    demand = frozenset({Feature.VIBRATION})
    pipeline = Pipeline(take_rest([simulator.frame().image for _ in range(8)]), demand=demand)
    period_n = round(rate_hz / 20.0)
    shakes_mm = [0.1 * math.sin(2.0 * math.pi * k / period_n) for k in range(round(0.45 * rate_hz))]

    def run(shears_mm: list[float], depth_mm: float = 2.0) -> tuple[float, Array]:
        rms_px, motion = math.nan, np.empty((0, 2))
        for shear_mm in shears_mm:
            pose = ToolPose(Tool("flat"), depth_mm=depth_mm, shear_x_mm=shear_mm)
            frame = simulator.frame((pose,) if depth_mm else ())
            features = pipeline.process(frame).features
            assert features is not None
            assert features.vibration_px is not None
            rms_px, motion = features.vibration_px, features.displacement_px
        return rms_px, motion

    rms_px, _ = run(shakes_mm)
    _, low = run([-0.1])
    _, high = run([0.1])
    amplitude_px = 0.5 * np.sort(np.hypot(*(high - low).T))[-20:].mean()  # under the tool
    slower = math.tan(10 * math.pi / rate_hz) / math.tan(20 * math.pi / rate_hz)
    gain = 1.0 / (1.0 + (math.sqrt(2.0) - 1.0) * slower**2)
    assert rms_px == pytest.approx(gain * amplitude_px * math.sqrt(0.5), rel=0.1)
    assert run([0.0] * round(0.8 * rate_hz))[0] < 0.05 * rms_px
    assert run([0.0], depth_mm=0.0)[0] == 0.0
    pipeline.demand = frozenset({Feature.SHEAR})
    result = pipeline.process(simulator.frame()).features
    assert result is not None
    assert result.vibration_px is None
