"""A flooded bus loses no sample: reading is throttled, and the medium is not reopened."""

import can
import pytest

from edge.link.link_sink import ReadBudget
from edge.link.params import PARAMS
from edge.link.python_can import CanMedium
from hostlink.can_bus import OpenBus


class Bus:
    """Its next `recv` raises."""

    def __init__(self, error: Exception, cause: Exception | None) -> None:
        self._error, self._cause = error, cause

    def recv(self, timeout: float) -> None:
        raise self._error from self._cause


def test_a_datagram_without_a_frame_is_counted_and_dropped() -> None:
    junk = Bus(can.CanOperationError("could not unpack received message"), ValueError("extra data"))
    bus = OpenBus(junk, "udp_multicast")  # type: ignore[arg-type]
    medium = CanMedium(bus, instant=True)
    assert [medium.read(0.0) for _ in range(1000)] == [None] * 1000
    assert bus.junk_n == 1000


@pytest.mark.parametrize(
    ("interface", "cause"),
    [
        ("udp_multicast", OSError("the interface went down")),
        ("udp_multicast", None),
        ("slcan", OSError("the adapter was unplugged")),
        ("slcan", ValueError("the descriptor is closed")),
        ("pcan", ValueError("a driver's own error, which no datagram caused")),
        ("kvaser", IndexError("the same")),
    ],
)
def test_a_failed_bus_is_not_counted_as_junk(interface: str, cause: Exception | None) -> None:
    bus = OpenBus(Bus(can.CanOperationError("failed"), cause), interface)  # type: ignore[arg-type]
    with pytest.raises(CanMedium.broken):
        CanMedium(bus, instant=True).read(0.0)
    assert bus.junk_n == 0


@pytest.mark.parametrize("cost_s", [20e-6, 100e-6, 1e-3])
def test_a_reader_that_never_waits_is_throttled_to_its_share(cost_s: float) -> None:
    """Simulated: endless messages, each with this processor time."""
    now_s = cpu_s = 0.0
    budget = ReadBudget(cpu_s, now_s)
    while now_s < 10.0:
        now_s, cpu_s = now_s + cost_s, cpu_s + cost_s
        now_s += budget.pause_s(cpu_s, now_s)
    assert cpu_s / now_s < 1.2 * PARAMS.read_rel


def test_a_reader_that_mostly_waits_is_not_throttled() -> None:
    budget, now_s, cpu_s = ReadBudget(0.0, 0.0), 0.0, 0.0
    for _ in range(5000):
        now_s, cpu_s = now_s + 400e-6, cpu_s + 80e-6  # an upload: a segment, its answer, and waiting
        assert budget.pause_s(cpu_s, now_s) == 0.0
