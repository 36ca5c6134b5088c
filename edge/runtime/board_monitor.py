"""Watches what no image shows: temperature, free space, and whether camera and links still respond.

It has a thread of its own: sysfs takes milliseconds, and a dead camera must be announced during a search,
too.
"""

import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from math import isnan, nan
from pathlib import Path

from edge.faults.registry import FaultRegistry
from edge.limits import FILE_BYTES
from edge.params import PARAMS as RUNTIME
from hostlink.wire import FaultCode

#: A Raspberry Pi begins to throttle at this (maker's documentation, "frequency management").
HOT_DEGC = 80.0

#: A calibration and the settings are written beside the old ones before they replace them.
STORED_BYTES = FILE_BYTES + FILE_BYTES  # calibration and settings


class Thermometer:
    """The board's hottest thermal zone, of the kernel's thermal class in `root`."""

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


def free_space_problem(directory: Path, least_bytes: int = STORED_BYTES) -> str:
    """Empty, or why nothing can be stored in this folder."""
    import shutil  # loads decompressors, which a finger that stores nothing does not need

    try:
        free = shutil.disk_usage(directory).free
    except OSError as error:
        return f"{directory}: {error.strerror}"
    if free >= least_bytes:
        return ""
    return f"{directory}: {free >> 10} KiB free, {least_bytes >> 10} KiB needed; delete something there"


class BoardMonitor:
    """Checks temperature and storage regularly, and reports to `registry`.

    storage  each gives "" or why something cannot be written: a folder, a recorder, settings
    checks   called each time; each reports on its own
    """

    def __init__(
        self,
        registry: FaultRegistry,
        thermometer: Callable[[], float] | None = None,
        storage: Sequence[Callable[[], str]] = (),
        hot_degc: float = HOT_DEGC,
        period_s: float = RUNTIME.check_s,
    ) -> None:
        self._registry = registry
        self._thermometer = thermometer or Thermometer()
        self.storage = list(storage)
        self.checks: list[Callable[[], None]] = []
        self._period_s, self._hot_degc = period_s, hot_degc
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="board monitor", daemon=True)
        self.temperature_degc = nan

    def start(self) -> None:
        self.check()
        self._thread.start()

    def check(self) -> None:
        self.temperature_degc = self._thermometer()
        away = RUNTIME.hysteresis_rel if self._registry.holds(FaultCode.OVER_TEMPERATURE) else 0.0
        hot = self.temperature_degc >= (1.0 - away) * self._hot_degc
        self._registry.report(FaultCode.OVER_TEMPERATURE, hot, f"{self.temperature_degc:.0f} degC")
        problems = "; ".join(filter(None, (problem() for problem in self.storage)))
        self._registry.report(FaultCode.DISK_FULL, bool(problems), problems)
        for check in self.checks:
            check()

    def close(self) -> None:
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join(RUNTIME.close_s)

    def _run(self) -> None:
        while not self._closing.wait(self._period_s):
            self.check()
