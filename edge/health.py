"""What is wrong right now: one set of active faults, each with a reason in words; and what the board says.

The fault table itself (codes, status bits, emergency codes, how each clears) is `hostlink.wire.FAULTS`.
Here is only which of them hold. A fault is announced when it appears and when it goes, each once; how
often it appeared is counted.

`Vitals` looks at what no image shows: temperature, storage, and whether camera and links still live. It has a
thread of its own: reading sysfs may take milliseconds that the loop does not have, and a search for lost pins
may take longer than a dead camera may stay unannounced.
"""

from __future__ import annotations

import logging
import os
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from math import isnan, nan
from pathlib import Path

from hostlink.wire import FAULTS, FaultCode, Status

__all__ = ["FaultLog", "Health", "Thermometer", "Vitals", "room_for"]

log = logging.getLogger(__name__)

_STATUS = {fault.code: fault.status for fault in FAULTS}

PERIOD_S = 0.04  # with a reading's own time, within the 0.1 s in which a fault is announced
HOT_DEGC = 80.0  # a Raspberry Pi begins to throttle here (maker's documentation, "frequency management")
COOLER_K = 5.0  # the fault clears this far below
ROOM_BYTES = 8 << 20  # below this a calibration (at most 8 MiB) could not be replaced any more


class Health:
    """The set of active faults. May be told from any thread.

    listeners  called with (code, active, words) at each appearance and clearing, from the thread that
               reported it, one at a time
    """

    def __init__(self) -> None:
        self._active: dict[FaultCode, str] = {}
        self._lock = threading.RLock()  # a listener may ask back
        self.listeners: list[Callable[[FaultCode, bool, str], None]] = []
        self.appeared: Counter[FaultCode] = Counter()
        self.status = Status(0)

    def report(self, code: FaultCode, active: bool, words: str | Callable[[], str] = "") -> None:
        """Say whether a fault holds now; saying it again changes nothing.

        words  what is known of it, or a function that says so, called only when the fault appears
        """
        if active == (code in self._active):  # without the lock: this is asked a dozen times a frame
            return
        with self._lock:
            if active == (code in self._active):
                return
            if active:
                words = self._active[code] = words() if callable(words) else words
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
        with self._lock:
            return dict(self._active)


class FaultLog:
    """A line in the log for each fault that comes, and one when it goes; a listener of `Health`.

    A fault that flickers gets one pair of lines a second, and the next one says how often it came.

    status  told in one line what holds now: for `systemctl status`
    """

    EVERY_S = 1.0

    def __init__(
        self,
        health: Health,
        status: Callable[[str], None],
        clock_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._health = health
        self._status = status
        self._clock_s = clock_s
        self._said_s: dict[FaultCode, float] = {}
        self._untold: Counter[FaultCode] = Counter()
        self._open: set[FaultCode] = set()  # lines of a beginning that still want one of the end

    def __call__(self, code: FaultCode, active: bool, words: str) -> None:
        """Called by `Health`, from any thread, one at a time."""
        now_s = self._clock_s()
        if not active:
            if code in self._open:
                self._open.discard(code)
                log.warning("%s off", code.name)
        elif now_s - self._said_s.get(code, -self.EVERY_S) < self.EVERY_S:
            self._untold[code] += 1
        else:
            more = self._untold.pop(code, 0)
            log.warning("%s on: %s%s", code.name, words, f" (and {more} times before)" if more else "")
            self._said_s[code] = now_s
            self._open.add(code)
        held = self._health.active
        self._status("; ".join(f"{c.name}: {w}" for c, w in held.items()) or "no fault")


class Thermometer:
    """The board's hottest thermal zone.

    root  of the kernel's thermal class
    """

    def __init__(self, root: Path = Path("/sys/class/thermal")) -> None:
        self._zones = sorted(root.glob("thermal_zone*/temp"))

    def __call__(self) -> float:
        """degC; NaN: the board has no sensor, or none that answers."""
        hottest = nan
        for zone in self._zones:
            with suppress(OSError, ValueError):  # zones of sleeping parts answer EAGAIN or nothing
                value = int(zone.read_text()) / 1000.0
                hottest = value if isnan(hottest) else max(hottest, value)
        return hottest


def room_for(directory: Path, least_bytes: int = ROOM_BYTES) -> str:
    """Empty, or why nothing can be stored in this folder."""
    try:
        stat = os.statvfs(directory)
    except OSError as error:
        return f"{directory}: {error.strerror}"
    free = stat.f_bavail * stat.f_frsize
    return "" if free >= least_bytes else f"{directory}: {free >> 10} KiB left, {least_bytes >> 10} wanted"


class Vitals:
    """Looks after temperature and storage, and tells `health`.

    thermometer  gives degC, or NaN
    storage      each gives "" or words of what cannot be written: a folder, a recorder, settings
    watches      called each time; they report by themselves
    """

    def __init__(
        self,
        health: Health,
        thermometer: Callable[[], float] | None = None,
        storage: Sequence[Callable[[], str]] = (),
        hot_degc: float = HOT_DEGC,
        period_s: float = PERIOD_S,
    ) -> None:
        self._health = health
        self._thermometer = thermometer or Thermometer()
        self.storage = list(storage)
        self.watches: list[Callable[[], None]] = []
        self._hot_degc = hot_degc
        self._period_s = period_s
        self._hot = False
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="vitals", daemon=True)
        self.temperature_degc = nan

    def start(self) -> None:
        """Look once, now, and then regularly."""
        self.look()
        self._thread.start()

    def look(self) -> None:
        """Read everything once."""
        now = self.temperature_degc = self._thermometer()
        # NaN compares false: without a sensor nothing is ever hot.
        self._hot = now >= self._hot_degc - (COOLER_K if self._hot else 0.0)
        self._health.report(FaultCode.OVER_TEMPERATURE, self._hot, f"{now:.0f} degC")
        words = "; ".join(filter(None, (ask() for ask in self.storage)))
        self._health.report(FaultCode.DISK_FULL, bool(words), words)
        for watch in self.watches:
            watch()

    def close(self) -> None:
        """End the thread."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join(self._period_s + 0.5)

    def _run(self) -> None:
        while not self._closing.wait(self._period_s):
            self.look()
