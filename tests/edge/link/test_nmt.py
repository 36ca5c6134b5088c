"""The node's state and its heartbeat, without a link."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from edge.link.nmt import Nmt, NmtCommand, NmtState


class Wire:
    """Keeps what is sent, and the series under way."""

    def __init__(self) -> None:
        self.sent: list[bytes] = []
        self.series: tuple[float, Callable[[], bytes] | None] = (0.0, None)

    def every(self, period_s: float, make: Callable[[], bytes] | None) -> None:
        self.series = (period_s, make)


@pytest.fixture
def wire() -> Wire:
    return Wire()


@pytest.fixture
def nmt(wire: Wire) -> Nmt:
    return Nmt(wire.sent.append, wire.every)


def test_booting_sends_one_message_and_starts_the_heartbeat(wire: Wire, nmt: Nmt) -> None:
    nmt.boot(heartbeat_ms=20)
    assert wire.sent == [b"\0"]
    assert nmt.state is NmtState.PRE_OPERATIONAL
    period_s, make = wire.series
    assert period_s == pytest.approx(0.02)
    assert make is not None
    assert make() == b"\x7f"
    nmt.state = NmtState.OPERATIONAL
    assert make() == b"\5"


def test_without_a_period_there_is_no_heartbeat(wire: Wire, nmt: Nmt) -> None:
    nmt.boot(heartbeat_ms=20)
    nmt.set_heartbeat(0)
    assert wire.series[1] is None
    nmt.boot(heartbeat_ms=0)
    assert wire.series[1] is None


@pytest.mark.parametrize(
    ("number", "state"),
    [
        (1, NmtState.OPERATIONAL),
        (2, NmtState.STOPPED),
        (128, NmtState.PRE_OPERATIONAL),
        (129, NmtState.INITIALISING),
        (130, NmtState.INITIALISING),
    ],
)
def test_commands_of_cia_301(nmt: Nmt, number: int, state: NmtState) -> None:
    assert nmt.command(number) is NmtCommand(number)
    assert nmt.state is state


@pytest.mark.parametrize("number", [0, 3, 80, 96, 127, 255])
def test_an_unknown_command_changes_nothing(nmt: Nmt, number: int) -> None:
    nmt.boot(0)
    assert nmt.command(number) is None
    assert nmt.state is NmtState.PRE_OPERATIONAL
