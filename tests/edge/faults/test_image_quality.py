"""Measurements of images and motions agree with NumPy."""

import numpy as np
import pytest

from edge.faults.detector import Facts, common_step_px
from edge.faults.frame_counts import FocusWindows, level_of
from edge.faults.judge import Judge, fault_checks
from edge.faults.registry import FaultRegistry
from edge.types import Frame, Image
from hostlink.wire import FaultCode

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
    each = np.array([FocusWindows(one, side, 20).measure(image, 2.0) for one in corners[:, None]])
    cut = np.array([image[y : y + side, x : x + side] for x, y in corners]).astype(np.float64)
    cut = cut[:, :: max(1, round(side / 20)), :: max(1, round(side / 20))]
    energy = (np.diff(cut, axis=1) ** 2).mean(axis=(1, 2)) + (np.diff(cut, axis=2) ** 2).mean(axis=(1, 2))
    ordered = np.sort(cut.reshape(32, -1), axis=1)
    k = ordered.shape[1] // 20
    span = np.maximum(ordered[:, -1 - k] - ordered[:, k], 1.0)
    known = np.stack([(energy - 2.0) / span**2, span])
    np.testing.assert_allclose(each.T, known, rtol=1e-12)
    medians = FocusWindows(corners, side, 20).measure(image, 2.0)
    np.testing.assert_allclose(medians, np.median(known, axis=1), rtol=1e-12)
    corners[3, 0] = 160 - side + 1
    with pytest.raises(ValueError, match="within"):
        FocusWindows(corners, side, 20).measure(image)


def test_a_step_that_all_pins_make_is_common() -> None:
    random = np.random.default_rng(3)
    step_px = random.normal((2.0, -1.0), 0.1, (100, 2))
    step_px[::10] = np.nan
    assert common_step_px(step_px) == pytest.approx([2.0, -1.0], abs=0.05)
    step_px[1::5] = 0.0  # a fifth of the skin stays where it is
    assert common_step_px(step_px) is None


@pytest.mark.parametrize(("at_rest", "bright"), [(0.0, 0.6), (0.8, 0.95)])
def test_overexposure_counts_only_pixels_not_saturated_at_rest(at_rest: float, bright: float) -> None:
    def frame(share: float) -> Frame:
        image = np.full((480, 640), 60, np.uint8)
        image[: round(480 * share)] = 255
        return Frame(image, 0, 0)

    registry, facts = FaultRegistry(), Facts()
    facts.rest_level, facts.rest_saturated = level_of(frame(at_rest).image, 8)
    judge = Judge(fault_checks(), registry)
    for share in (at_rest, bright):
        assert not registry.holds(FaultCode.IMAGE_BRIGHT)
        facts.see(frame(share))
        judge.report(facts.reached(judge.limits()), facts)
    assert "full scale" in registry.active[FaultCode.IMAGE_BRIGHT]
