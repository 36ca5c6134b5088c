"""Bad media, seeded: disturbances of frames between the sensor and the decoder.

`Ledger` records what was sent, checks each delivered sample against it, and counts at the end:
every sample sent between the first and the last delivered is delivered, lost or out of order.
"""

from dataclasses import dataclass, field
from random import Random

from hostlink.decoder import Event, LinkStatistics, Sample
from hostlink.wire import State
from tests.support.states import same


@dataclass
class Ledger:
    """Samples sent, by number of sending; sample number = that modulo 65536."""

    sent: dict[int, State] = field(default_factory=dict)
    delivered: list[int] = field(default_factory=list)

    def send(self, state: State) -> int:
        """Note a sample as decoded at the other end."""
        self.sent[len(self.sent)] = state
        return len(self.sent) - 1

    def take(self, events: list[Event]) -> None:
        """Each sample must be one that was sent, whole, and newer than the one before."""
        for event in events:
            if not isinstance(event, Sample):
                continue
            last = self.delivered[-1] if self.delivered else -1
            number = last + 1 + (event.state.sample - last - 1 & 0xFFFF)
            assert number in self.sent, "a sample that was never sent"
            assert same(event.state, self.sent[number]), "a wrong sample"
            self.delivered.append(number)

    def balance(self, statistics: LinkStatistics) -> None:
        """Every loss is counted, exactly."""
        span = self.delivered[-1] - self.delivered[0] + 1
        assert statistics.received_n == len(self.delivered)
        assert statistics.restart_n == 0
        assert statistics.received_n + statistics.lost_n + statistics.out_of_order_n == span


def flip(data: bytes, positions: list[int]) -> bytes:
    """The data with these bits flipped."""
    whole = int.from_bytes(data, "little")
    for position in positions:
        whole ^= 1 << position
    return whole.to_bytes(len(data), "little")


def spots(rng: Random, size: int) -> list[int]:
    """1..8 different bit positions in this many bytes."""
    return rng.sample(range(8 * size), rng.randint(1, 8))
