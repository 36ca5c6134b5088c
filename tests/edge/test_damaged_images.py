"""A damaged image costs its own sample and at most two more, and no value is wrong, at any rate."""

from math import isnan

import numpy as np
import pytest

from edge.calibration import Calibration
from edge.types import Frame, Image
from hostlink.wire import State, Status
from tests.support.finger import Finger

#: How far a pixel is from where each kind of damage is worst; a 1 kB hole in a JPEG is the lower part.
KINDS = {
    "lower": lambda x, y: -y,
    "strip": lambda x, y: abs(y - 150),
    "block": lambda x, y: np.maximum(abs(x - 120), abs(y - 190)),
}
SHARES = (0.05, 0.1, 0.25, 0.5, 0.75, 0.95, 1.0)


def damaged(image: Image, kind: str, share: float, pins: np.ndarray, fill: int) -> Image:
    """An image in which that share of the pins is overwritten."""
    row, column = np.indices(image.shape)
    worst = float(np.quantile(KINDS[kind](*pins.T), share))
    return np.asarray(np.where(KINDS[kind](column, row) <= worst, fill, image), np.uint8)


@pytest.fixture(scope="module")
def whole(frames: list[Frame], calibration: Calibration) -> list[State]:
    """Samples of the same press, undamaged."""
    finger = Finger(frames, calibration)
    return [finger.show(n) for n in range(8, len(frames))]


@pytest.mark.parametrize(("fill", "rate_hz"), [(0, 30), (128, 240)])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("share", SHARES)
def test_values_are_back_with_the_image(
    frames: list[Frame], calibration: Calibration, whole: list[State], kind: str, share: float, fill: int,
    rate_hz: int,
) -> None:  # fmt: skip
    finger = Finger(frames, calibration, period_ns=round(1e9 / rate_hz))
    pipeline = finger.loop.measurement.pipeline
    assert pipeline is not None
    for at, numbers in ((3, [7] * 10), (9, list(range(8, len(frames))))):
        samples = []
        for k, n in enumerate(numbers):
            image = frames[n].image
            spoilt = damaged(image, kind, share, pipeline.rest.xy_img, fill) if k == at else image
            samples.append(finger.see(spoilt))
        assert sum(isnan(sample.displacement_mm) for sample in samples[at + 1 :]) <= 2
        for sample, n in zip(samples, numbers, strict=True):
            truth = whole[n - 8].displacement_mm if n > 7 else 0.0
            assert not isnan(sample.displacement_mm) or not sample.status & Status.TOUCHED
            assert not abs(sample.displacement_mm - truth) >= 3.0 * sample.displacement_sigma_mm
