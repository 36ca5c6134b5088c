"""A short soak: every kind of fault of the schedule, and the promises. The long one is `make soak`."""

from __future__ import annotations

from rich.console import Console

from edge.inject import BOARD, CAMERA, LINK
from tests.bench.soak import soak, tell

SECONDS = 32.0  # each kind of camera fault once or more


def test_the_promises_hold() -> None:
    outcome = soak(SECONDS, seed=11, rate_hz=50.0, endings_every_s=0.0)
    tell(outcome, Console(width=120))
    # How late something was on a machine that does other things too is told, not judged, here.
    broken = [words for words in outcome.violations if "announced after" not in words]
    assert not broken
    assert set(outcome.rows) == {*CAMERA, *LINK, *BOARD}
    assert outcome.counts["samples judged"] > 5 * SECONDS
    assert 0 < outcome.counts["samples flagged"] < outcome.counts["samples judged"]
