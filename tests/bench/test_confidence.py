"""The reliability diagram tells an honest confidence from another, and the fit finds the weights."""

from __future__ import annotations

import numpy as np
import pytest

from tests.bench.confidence import Jump, fitted, reliability

WEIGHTS = np.array([0.5, 2.0, -1.0])


def jumps(temperature: float) -> list[Jump]:
    """Right with the probability that the weights give; the confidence has its log odds times this."""
    rng = np.random.default_rng(1)
    evidence = np.column_stack([np.ones(4000), np.abs(rng.normal(size=4000)), rng.normal(size=4000)])
    odds = evidence @ WEIGHTS
    right = rng.random(len(odds)) < 1 / (1 + np.exp(-odds))
    confidence = 1 / (1 + np.exp(-odds * temperature))
    return [
        Jump("made up", 0.0, tuple(e), float(c), 100, 0 if r else 100)
        for e, c, r in zip(evidence.tolist(), confidence, right.tolist(), strict=True)
    ]


@pytest.mark.parametrize(("temperature", "off"), [(1.0, False), (2.5, True), (0.4, True)])
def test_a_confidence_off_the_diagonal_is_found(temperature: float, off: bool) -> None:
    bins = reliability(jumps(temperature))
    assert sum(b.jumps for b in bins) > 3900  # but for bins with too few
    assert any(b.off for b in bins) == off


def test_the_fit_finds_the_weights() -> None:
    np.testing.assert_allclose(fitted(jumps(1.0)), WEIGHTS, atol=0.3)


def test_a_frame_is_wrong_if_more_than_a_tenth_of_its_pins_are() -> None:
    assert Jump("", 0.0, (), 1.0, 100, 10).right
    assert not Jump("", 0.0, (), 1.0, 100, 11).right
    assert not Jump("", 0.0, (), 1.0, 0, 0).right
