"""Measurements of images and motions agree with NumPy."""

import numpy as np
import pytest

from edge.faults.detector import common_step_px, fault_checks
from edge.faults.frame_counts import FocusWindows
from edge.faults.image_quality import ImageQuality
from edge.faults.judge import Facts, Judge
from edge.faults.registry import FaultRegistry
from edge.types import Frame, Image
from hostlink.wire import FaultCode
from tests.support.layouts import rest_of

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize(("kind", "top"), [(np.uint8, 256), (np.uint16, 4096)])
@pytest.mark.parametrize("side", [7, 20, 21, 39])
def test_windows_are_numpy_s(kind: type, top: int, side: int) -> None:
    rng = np.random.default_rng(side)
    image: Image = rng.integers(0, top, (120, 160)).astype(kind)
    image[40:80, 40:90] = 7  # flat
    corners = rng.integers(0, 120 - side, (32, 2)).astype(np.int32)
    corners[0] = (160 - side, 120 - side)
    corners[1] = (45, 45)
    out = np.empty((32, 2))
    level = FocusWindows(corners, side, 20).measure(image, out)
    cut = np.array([image[y : y + side, x : x + side] for x, y in corners]).astype(np.float64)
    cut = cut[:, :: max(1, round(side / 20)), :: max(1, round(side / 20))]
    energy = (np.diff(cut, axis=1) ** 2).mean(axis=(1, 2)) + (np.diff(cut, axis=2) ** 2).mean(axis=(1, 2))
    ordered = np.sort(cut.reshape(32, -1), axis=1)
    k = ordered.shape[1] // 20
    np.testing.assert_allclose(out[:, 0], energy, rtol=1e-12)
    np.testing.assert_array_equal(out[:, 1], ordered[:, -1 - k] - ordered[:, k])
    assert level == pytest.approx(cut.mean(), rel=1e-12)
    corners[3, 0] = 160 - side + 1
    with pytest.raises(ValueError, match="within"):
        FocusWindows(corners, side, 20).measure(image, out)


def test_a_step_that_all_pins_make_is_common() -> None:
    random = np.random.default_rng(3)
    step_px = random.normal((2.0, -1.0), 0.1, (100, 2))
    step_px[::10] = np.nan
    common_px = common_step_px(step_px)
    assert common_px is not None
    assert common_px == pytest.approx([2.0, -1.0], abs=0.05)
    step_px[1::5] = 0.0  # a fifth of the skin stays where it is
    assert common_step_px(step_px) is None


@pytest.mark.parametrize(("at_rest", "bright"), [(0.0, 0.6), (0.8, 0.95)])
def test_overexposure_counts_only_pixels_not_saturated_at_rest(at_rest: float, bright: float) -> None:
    def frame(share: float) -> Frame:
        image = np.full((480, 640), 60, np.uint8)
        image[: round(480 * share)] = 255
        return Frame(image, 0, 0)

    quality, registry, facts = ImageQuality(), FaultRegistry(), Facts()
    judge = Judge(fault_checks(), registry)
    quality.learn(rest_of(np.array([[320.0, 200.0], [340.0, 200.0], [330.0, 220.0]])), frame(at_rest))
    quality.brightness(frame(at_rest), facts)
    judge.judge(facts)
    assert not registry.holds(FaultCode.IMAGE_BRIGHT)
    quality.brightness(frame(bright), facts)
    judge.judge(facts)
    assert "full scale" in registry.active[FaultCode.IMAGE_BRIGHT]
