"""`follow` against the same method in plain NumPy, pin for pin."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from edge.pins import Refiner, detect, take_rest
from edge.sources import open_source
from edge.track import Tracker
from edge.types import Pins
from tests.bench.plain.tracker import Tracker as PlainTracker

DATA = Path(__file__).parents[1] / "data"


@pytest.mark.parametrize("name", ["press", "press_shear", "two_contacts"])
@pytest.mark.parametrize("lost_share", [0.0, 0.02, 0.3])
def test_same_tracks(name: str, lost_share: float) -> None:
    frames = iter(open_source(str(DATA / f"{name}.mcap")))
    rest = take_rest([frame.image for frame in islice(frames, 8)])
    refiner, ours, plain = Refiner(rest), Tracker(rest), PlainTracker(rest)
    rng = np.random.default_rng(5)
    followed = thrown_out = 0
    for frame in frames:
        place = ours.predict()
        expected = plain.predict()
        assert (place is None) == (expected is None)
        if place is None:
            found = detect(frame.image, rest.pattern)
            ours.identify(found)
            plain.identify(found)
            continue
        np.testing.assert_allclose(place, expected, rtol=0.0, atol=1e-9)
        pins = refiner.refine(frame.image, place)
        xy = pins.xy_img.copy()
        xy[rng.random(len(xy)) < lost_share] = np.nan
        for pin in rng.choice(len(xy), 3, replace=False):  # taken for another: too far off, or two on one
            xy[pin] = xy[rng.choice(len(xy))] if rng.random() < 0.5 else xy[pin] + rng.normal(0.0, 9.0, 2)
        light = pins.brightness.copy()
        for pin in rng.choice(len(xy), 8, replace=False):  # drawn aside by a light beside it
            light[pin] *= 1.3
            xy[pin] += rng.normal(0.0, 1.0, 2)
        pins = Pins(xy, pins.sigma_px, pins.radius_px, light)
        a, b = ours.follow(pins), plain.follow(pins)
        np.testing.assert_array_equal(a.seen, b.seen)
        np.testing.assert_allclose(a.xy_img, b.xy_img, rtol=0.0, atol=1e-9)
        np.testing.assert_array_equal(a.sigma_px, b.sigma_px)
        assert a.confidence == pytest.approx(b.confidence, abs=1e-9)
        followed += 1
        thrown_out += int(np.count_nonzero(np.isfinite(xy[:, 0]) & ~a.seen))
    assert followed > 3
    assert thrown_out > 0
