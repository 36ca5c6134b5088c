"""Which faults hold now, each with its reason.

The fault table (codes, status bits, emergency codes, how each clears) is `hostlink.wire.FAULTS`; here is
only which of them hold. A fault is announced once when it appears and once when it clears; how often it
appeared is counted.
"""

import logging
import threading
import time
from collections import Counter
from collections.abc import Callable

from edge.params import PARAMS
from hostlink.wire import FAULTS, FaultCode

log = logging.getLogger(__name__)

_STATUS = {fault.code: int(fault.status) for fault in FAULTS}


class FaultRegistry:
    """The set of active faults. `report` may be called from any thread.

    listeners  called with (code, active, message) at each appearance and clearing, from the thread that
               reported it, one at a time
    appeared   how often each fault has appeared
    status     status bits of the active faults: a plain integer, as operations on flags take long
    changes_n  how often the set has changed
    """

    def __init__(self) -> None:
        self._active: dict[FaultCode, str] = {}
        self._lock = threading.RLock()  # a listener may ask what is active
        self.listeners: list[Callable[[FaultCode, bool, str], None]] = []
        self.appeared: Counter[FaultCode] = Counter()
        self.status = 0
        self.changes_n = 0

    def report(self, code: FaultCode, active: bool, message: str | Callable[[], str] = "") -> None:
        """Report whether a fault holds now; repeating it changes nothing.

        message  the reason, or a function that gives it, called only when the fault appears
        """
        if active == (code in self._active):  # without the lock: this is called a dozen times a frame
            return
        with self._lock:
            if active == (code in self._active):
                return
            if active:
                message = self._active[code] = message() if callable(message) else message
                self.appeared[code] += 1
            else:
                message = self._active.pop(code)
            status = 0
            for held in self._active:
                status |= _STATUS[held]
            self.status = status
            self.changes_n += 1
            for notify in self.listeners:
                notify(code, active, message)

    def holds(self, code: FaultCode) -> bool:
        return code in self._active

    @property
    def active(self) -> dict[FaultCode, str]:
        """Faults that hold now, each with its reason."""
        with self._lock:
            return dict(self._active)


class FaultLog:
    """A log line for each fault that appears, and one when it clears; a listener of `FaultRegistry`.

    A fault that flickers gets at most one pair of lines every `rarely_s`; the next line says how often it
    appeared meanwhile.

    set_status  gets the active faults in one line: for `systemctl status`
    """

    def __init__(
        self,
        registry: FaultRegistry,
        set_status: Callable[[str], None],
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._registry, self._set_status, self._clock_s = registry, set_status, clock_s
        self._logged_s: dict[FaultCode, float] = {}
        self._suppressed: Counter[FaultCode] = Counter()
        self._open: set[FaultCode] = set()  # logged as on, not yet as off

    def __call__(self, code: FaultCode, active: bool, message: str) -> None:
        """Called by `FaultRegistry`, from any thread, one at a time."""
        now_s = self._clock_s()
        if not active:
            if code in self._open:
                self._open.discard(code)
                log.warning("%s cleared", code.name)
        elif now_s - self._logged_s.get(code, -PARAMS.rarely_s) < PARAMS.rarely_s:
            self._suppressed[code] += 1
        else:
            n = self._suppressed.pop(code, 0)
            repeated = f" (and {n} times since the last such line)" if n else ""
            log.warning("%s: %s%s", code.name, message, repeated)
            self._logged_s[code] = now_s
            self._open.add(code)
        self._set_status("; ".join(f"{c.name}: {m}" for c, m in self._registry.active.items()) or "no fault")
