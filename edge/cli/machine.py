"""What `edge doctor` asks of the machine: network interfaces, processor, clock, disk."""

from __future__ import annotations

import json
import os
import subprocess
import time
from pathlib import Path
from typing import Any

from edge.runtime.board_monitor import Thermometer

__all__ = ["Machine"]


class Machine:
    """What is asked of the machine.

    root  of its file system
    """

    def __init__(self, root: Path = Path("/")) -> None:
        self.root = root

    def interface(self, name: str) -> dict[str, Any] | None:
        """What `ip` says of a network interface; None: there is none."""
        try:
            run = subprocess.run(
                ["ip", "-details", "-statistics", "-json", "link", "show", "dev", name],
                capture_output=True, text=True, timeout=5.0, check=False,
            )  # fmt: skip
            found = json.loads(run.stdout or "[]")
        except (OSError, ValueError, subprocess.TimeoutExpired):
            return None
        return dict(found[0]) if found else None

    def governors(self) -> set[str]:
        """Frequency governors in use; empty: the processor has none."""
        files = (self.root / "sys/devices/system/cpu").glob("cpu[0-9]*/cpufreq/scaling_governor")
        return {file.read_text().strip() for file in files}

    def temperature_degc(self) -> float:
        """Of the board; NaN: unknown."""
        return Thermometer(self.root / "sys/class/thermal")()

    def clock_synchronised(self) -> bool | None:
        """Whether the wall clock follows a time server; None: unknown."""
        try:
            run = subprocess.run(
                ["timedatectl", "show", "--property=NTPSynchronized", "--value"],
                capture_output=True, text=True, timeout=5.0, check=False,
            )  # fmt: skip
        except (OSError, subprocess.TimeoutExpired):
            return None
        return {"yes": True, "no": False}.get(run.stdout.strip())

    def free_bytes(self, folder: Path) -> int:
        """Room for us in a folder. Raises OSError."""
        stat = os.statvfs(folder)
        return stat.f_bavail * stat.f_frsize

    def write_s(self, folder: Path, n_bytes: int) -> float:
        """How long so many bytes take to the disk. Raises OSError."""
        path = folder / f".doctor-{os.getpid()}"
        block = os.urandom(1 << 20)
        start = time.monotonic()
        try:
            with path.open("wb") as file:
                for _ in range(max(1, n_bytes >> 20)):
                    file.write(block)
                file.flush()
                os.fsync(file.fileno())
            return time.monotonic() - start
        finally:
            path.unlink(missing_ok=True)
