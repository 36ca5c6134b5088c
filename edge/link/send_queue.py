"""The queue of a link: answers and emergencies first, then samples, blocks and detail, one item at a time.

The items of a block (a long answer) and of the detail keep a distance: a sample cannot overtake what is in
the driver's queue.
"""

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

Spaced = Literal["block", "detail"]
Kind = Literal["control", "sample", Spaced]


@dataclass(slots=True)
class _Spaced:
    items: deque[Any] = field(default_factory=deque)
    spacing_s: float = 0.0
    due_s: float = 0.0


class SendQueue:
    """The items that wait, so many at most. Methods are called with the link's lock held.

    sample_ahead  a sample waits or is being written, which another one must not overtake. Needs no lock
    """

    def __init__(self, samples_n: int, control_n: int) -> None:
        self._samples_n = samples_n
        self._control: deque[Any] = deque(maxlen=control_n)
        self._samples: deque[Sequence[Any]] = deque()
        self._spaced: dict[Spaced, _Spaced] = {"block": _Spaced(), "detail": _Spaced()}
        self._make: Callable[[], Any] | None = None  # what is sent periodically
        self._period_s = self._due_s = 0.0
        self._in_hand: Kind | None = None
        self.sample_ahead = False

    @property
    def waiting(self) -> bool:
        return bool(self._samples or self._control or any(group.items for group in self._spaced.values()))

    @property
    def empty(self) -> bool:
        """Whether nothing waits and nothing is being written."""
        return not self.waiting and self._in_hand is None

    def put_sample(self, items: Sequence[Any]) -> bool:
        """Add the items of a sample; False: an older sample was dropped."""
        self.sample_ahead = True
        self._samples.append(items)
        kept = len(self._samples) <= self._samples_n
        if not kept:
            self._samples.popleft()
        return kept

    def put_control(self, item: Any) -> None:
        self._control.append(item)

    def put_spaced(self, kind: Spaced, items: Sequence[Any], spacing_s: float) -> None:
        """Put a group in the place of the one before, to be sent with this least time between two items."""
        group = self._spaced[kind]
        group.items, group.spacing_s = deque(items), spacing_s

    def every(
        self, period_s: float, make: Callable[[], Any] | None, now_s: float, phase: float = 0.0
    ) -> None:
        """Add `make()` as control each period from now on, at this phase of the clock; None: nothing."""
        self._make, self._period_s = make, period_s
        if make is not None:
            self._due_s = (math.floor(now_s / period_s - phase) + 1.0 + phase) * period_s

    def wait_s(self, now_s: float) -> float | None:
        """Time until there is an item to take; None: until one is put."""
        if self._samples or self._control:
            return 0.0
        due = [] if self._make is None else [self._due_s]
        due += [group.due_s for group in self._spaced.values() if group.items]
        return max(0.0, min(due) - now_s) if due else None

    def take(self, now_s: float) -> Sequence[Any] | None:
        """The most urgent items, to be written now; None: nothing is due. `done` follows."""
        if self._make is not None and now_s >= self._due_s:
            passed_n = math.floor((now_s - self._due_s) / self._period_s) + 1  # a stall keeps the phase
            self._due_s += passed_n * self._period_s
            self._control.append(self._make())
        if self._control:
            self._in_hand = "control"
            return (self._control.popleft(),)
        if self._samples:
            self._in_hand = "sample"
            return self._samples.popleft()
        for kind, group in self._spaced.items():
            if group.items and now_s >= group.due_s:
                self._in_hand = kind
                group.due_s = now_s + group.spacing_s
                return (group.items.popleft(),)
        return None

    def done(self, written: bool) -> str:
        """Note that the items taken were written, or not; returns what that counts as in `SinkCounters`."""
        kind, self._in_hand = self._in_hand, None
        self.sample_ahead = bool(self._samples)
        if kind == "sample":
            return "sent" if written else "dropped"
        detail = self._spaced["detail"].items
        if kind == "detail" and not written:
            detail.clear()  # an incomplete group is useless
            return "detail_skipped"
        return "detail_sent" if kind == "detail" and not detail else ""

    def clear(self) -> int:
        """Drop all that waits; returns the number of samples."""
        samples_n = len(self._samples)
        for items in (self._samples, self._control, *(group.items for group in self._spaced.values())):
            items.clear()
        self.sample_ahead = self._in_hand == "sample"
        return samples_n
