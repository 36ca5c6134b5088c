"""What is wrong right now: one set of active faults, each with a reason in words.

The fault table itself (codes, status bits, emergency codes, how each clears) is `hostlink.wire.FAULTS`.
Here is only which of them hold. A fault is announced when it appears and when it goes, each once; how
often it appeared is counted.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from hostlink.wire import FAULTS, FaultCode, Status

_STATUS = {fault.code: fault.status for fault in FAULTS}


class Health:
    """The set of active faults.

    listeners  called with (code, active, words) at each appearance and clearing, from the thread that
               reported it
    """

    def __init__(self) -> None:
        self._active: dict[FaultCode, str] = {}
        self.listeners: list[Callable[[FaultCode, bool, str], None]] = []
        self.appeared: Counter[FaultCode] = Counter()
        self.status = Status(0)

    def report(self, code: FaultCode, active: bool, words: str = "") -> None:
        """Say whether a fault holds now; saying it again changes nothing."""
        if active == (code in self._active):
            return
        if active:
            self._active[code] = words
            self.appeared[code] += 1
        else:
            words = self._active.pop(code)
        status = Status(0)
        for held in self._active:
            status |= _STATUS[held]
        self.status = status
        for tell in self.listeners:
            tell(code, active, words)

    @property
    def active(self) -> dict[FaultCode, str]:
        """Faults that hold now, with what is known of each."""
        return dict(self._active)
