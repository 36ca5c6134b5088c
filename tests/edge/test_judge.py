"""The judge's arithmetic is NumPy's."""

from __future__ import annotations

import numpy as np
import pytest

from edge import _judge
from edge.judge import level_of, moved_px
from edge.types import Image


@pytest.mark.parametrize(
    ("image", "bits"),
    [
        (np.random.default_rng(1).integers(0, 256, (480, 640)).astype(np.uint8), 8),
        (np.random.default_rng(2).integers(0, 4096, (123, 77)).astype(np.uint16), 12),
        (np.full((33, 17), 255, np.uint8), 8),
        (np.random.default_rng(3).integers(0, 256, (64, 90)).astype(np.uint8)[::-1, 5:70], 8),
        (np.zeros((0, 5), np.uint8), 8),
    ],
)
def test_level_is_the_mean_of_the_samples(image: Image, bits: int) -> None:
    top = (1 << bits) - 1
    samples = image[::16, ::16]
    wanted = (samples.mean() / top, np.mean(samples >= top)) if samples.size else (0.0, 0.0)
    assert level_of(image, bits) == pytest.approx(wanted, rel=1e-12)


def test_levels_takes_images_only() -> None:
    for wrong in (np.zeros(5, np.uint8), np.zeros((5, 5)), np.zeros((5, 5, 3), np.uint8)):
        with pytest.raises(ValueError, match="image"):
            _judge.levels(wrong, 16, 255)  # type: ignore[arg-type]


@pytest.mark.parametrize("n", [1, 2, 7, 330, 331])
@pytest.mark.parametrize("lost", [0, 1, 5])
def test_lengths_are_numpy_s(n: int, lost: int) -> None:
    rng = np.random.default_rng(n + lost)
    before = rng.uniform(0.0, 600.0, (n, 2))
    now = before + rng.normal(0.0, 3.0, (n, 2))
    now[:lost] = np.nan
    length = np.hypot(*(now - before).T)
    assert (
        _judge.far(now, before, 3.0) == _judge.far(now - before, None, 3.0) == np.count_nonzero(length > 3.0)
    )
    wanted = np.nanmedian(length) if lost < n else 0.0
    assert moved_px(now - before) == pytest.approx(wanted, rel=1e-12)
