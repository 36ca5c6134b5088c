"""Hazards rendered through the whole chain, short: identities, and no touch on an untouched tip."""

import pytest

from calib.sim import Camera, Tip
from tests.bench.hazards import measure

HOLDS = (
    "30 % blinking",
    "50 false blobs",
    "30 % dark, 50 false blobs",
    "a reflection runs across",
    "dark for a while",
    "a hand over the lens",
)


@pytest.mark.parametrize("hazard", HOLDS)
def test_no_pin_is_swapped_and_no_false_touch(hazard: str) -> None:
    outcome = measure(Camera(tip=Tip(n_pins=127), size_px=(320, 240)), None, hazard, seed=3)
    assert outcome.swapped == 0
    assert outcome.touches == 0
    assert outcome.unsure <= 14  # the dark frames, and the search after them
