"""A short soak: every kind of fault of the schedule, and the promises. The long one is `make soak`."""

from random import Random

import pytest
from rich.console import Console

from tests.bench.soak import Outcome, soak, tell
from tests.support.fault_injection import BOARD, CAMERA, LINK

SECONDS = 14.0  # each kind of camera fault once or more


def test_the_promises_hold() -> None:
    outcome = soak(SECONDS, seed=11, rate_hz=50.0, brisk=True)
    tell(outcome, Console(width=120))
    # Delays depend on the machine's load: they are printed here, not asserted.
    late = ("announced after", "still announced", "link back after")
    broken = [words for words in outcome.violations if not any(part in words for part in late)]
    assert not broken
    assert set(outcome.rows) == {*CAMERA, *LINK, *BOARD}
    assert outcome.counts["samples judged"] > 5 * SECONDS
    assert 0 < outcome.counts["samples flagged"] < outcome.counts["samples judged"]


@pytest.mark.parametrize(("leak_bytes", "fails"), [(0, False), (160, True)])
def test_memory_that_grows_with_the_samples_is_no_step_and_no_noise(leak_bytes: int, fails: bool) -> None:
    outcome, random, rate_hz, seconds = Outcome(0.0, 1), Random(5), 60, 900
    outcome.memory_mb = [
        95.0 + random.uniform(0.0, 0.5) + 3.0 * (second > 450) + leak_bytes * rate_hz * second / 2**20
        for second in range(seconds)
    ]
    outcome.check_memory(rate_hz * seconds)
    assert bool(outcome.violations) == fails
    assert outcome.slope_bytes == pytest.approx(leak_bytes, abs=32.0)
