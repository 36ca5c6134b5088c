"""What no image shows: the board's temperature, free space, and whether camera and links still respond.

`BoardMonitor` has its own thread: reading sysfs may take milliseconds, which the loop cannot spare, and a
dead camera must be announced even while a search for lost pins runs.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from math import isnan, nan
from pathlib import Path

from edge.runtime.fault_registry import FaultRegistry
from hostlink.wire import FaultCode

__all__ = ["FREE_SPACE_BYTES", "HOT_DEGC", "BoardMonitor", "Thermometer", "free_space_problem"]

PERIOD_S = 0.04  # with a check's own time, within the 0.1 s in which a fault is announced
HOT_DEGC = 80.0  # a Raspberry Pi begins to throttle here (maker's documentation, "frequency management")
COOLER_K = 5.0  # the fault clears at so much below
FREE_SPACE_BYTES = 8 << 20  # below this a calibration (at most 8 MiB) could not be replaced any more


class Thermometer:
    """The board's hottest thermal zone.

    root  of the kernel's thermal class
    """

    def __init__(self, root: Path = Path("/sys/class/thermal")) -> None:
        self._zones = sorted(root.glob("thermal_zone*/temp"))

    def __call__(self) -> float:
        """degC; NaN: the board has no sensor that can be read."""
        hottest = nan
        for zone in self._zones:
            with suppress(OSError, ValueError):  # zones of powered-down parts give EAGAIN or nothing
                value = int(zone.read_text()) / 1000.0
                hottest = value if isnan(hottest) else max(hottest, value)
        return hottest


def free_space_problem(directory: Path, least_bytes: int = FREE_SPACE_BYTES) -> str:
    """Empty, or why nothing can be stored in this folder."""
    try:
        stat = os.statvfs(directory)
    except OSError as error:
        return f"{directory}: {error.strerror}"
    free = stat.f_bavail * stat.f_frsize
    if free >= least_bytes:
        return ""
    return f"{directory}: {free >> 10} KiB free, {least_bytes >> 10} KiB needed; delete something there"


class BoardMonitor:
    """Checks temperature and storage regularly, and reports to `registry`.

    thermometer  gives degC, or NaN
    storage      each gives "" or why something cannot be written: a folder, a recorder, settings
    checks       called each time; each reports on its own
    """

    def __init__(
        self,
        registry: FaultRegistry,
        thermometer: Callable[[], float] | None = None,
        storage: Sequence[Callable[[], str]] = (),
        hot_degc: float = HOT_DEGC,
        period_s: float = PERIOD_S,
    ) -> None:
        self._registry = registry
        self._thermometer = thermometer or Thermometer()
        self.storage = list(storage)
        self.checks: list[Callable[[], None]] = []
        self._hot_degc = hot_degc
        self._period_s = period_s
        self._hot = False
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="board monitor", daemon=True)
        self.temperature_degc = nan

    def start(self) -> None:
        """Check once now, then regularly."""
        self.check()
        self._thread.start()

    def check(self) -> None:
        """Check everything once."""
        now = self.temperature_degc = self._thermometer()
        # Comparison with NaN is false: without a sensor nothing is reported as hot.
        self._hot = now >= self._hot_degc - (COOLER_K if self._hot else 0.0)
        self._registry.report(FaultCode.OVER_TEMPERATURE, self._hot, f"{now:.0f} degC")
        problems = "; ".join(filter(None, (problem() for problem in self.storage)))
        self._registry.report(FaultCode.DISK_FULL, bool(problems), problems)
        for check in self.checks:
            check()

    def close(self) -> None:
        """End the thread."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join(self._period_s + 0.5)

    def _run(self) -> None:
        while not self._closing.wait(self._period_s):
            self.check()
