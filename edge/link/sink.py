"""The interface of a sink, and a sink without a link."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Protocol

from hostlink.wire import State

__all__ = ["MemorySink", "Sink", "SinkCounters"]


@dataclass(frozen=True, slots=True)
class SinkCounters:
    """Counts of samples since the opening.

    sent        samples given to the medium
    dropped     samples that could not be sent
    reconnects  times the medium was lost and came back
    detail_sent, detail_skipped   groups of detail segments sent, and skipped in favour of samples
    """

    sent: int = 0
    dropped: int = 0
    reconnects: int = 0
    detail_sent: int = 0
    detail_skipped: int = 0


class Sink(Protocol):
    """Where samples go."""

    name: str

    @property
    def up(self) -> bool: ...

    @property
    def counters(self) -> SinkCounters: ...

    def send(self, state: State) -> bool:
        """Send a sample; False: dropped and counted. Never blocks, never raises."""
        ...

    def drain(self, timeout_s: float) -> bool:
        """Wait until nothing waits to be sent: for recordings, which are sent as fast as possible."""
        ...

    def close(self) -> None: ...


class MemorySink:
    """Keeps the newest samples: for tests and for measuring without a bus."""

    def __init__(self, name: str = "memory:", keep: int = 100_000) -> None:
        self.name = name
        self.states: deque[State] = deque(maxlen=keep)
        self._sent = 0

    up = True

    @property
    def counters(self) -> SinkCounters:
        return SinkCounters(sent=self._sent)

    def send(self, state: State) -> bool:
        self.states.append(state)
        self._sent += 1
        return True

    def drain(self, timeout_s: float) -> bool:
        return True

    def close(self) -> None:
        """Nothing to close."""
