"""Facts about the machine for `edge doctor`: network interfaces, processor, clock, disk."""

import json
import os
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any

from edge.runtime.board_monitor import Thermometer


class Machine:
    """root  of its file system"""

    def __init__(self, root: Path = Path("/")) -> None:
        self.root = root

    def interface(self, name: str) -> dict[str, Any] | None:
        """Properties of a network interface, from `ip`; None: there is none."""
        try:
            printed = _printed_by("ip", "-details", "-statistics", "-json", "link", "show", "dev", name)
            found = json.loads(printed or "[]")
        except ValueError:
            return None
        return dict(found[0]) if found else None

    def governors(self) -> set[str]:
        """Frequency governors in use; empty: the processor has none."""
        files = (self.root / "sys/devices/system/cpu").glob("cpu[0-9]*/cpufreq/scaling_governor")
        return {file.read_text().strip() for file in files}

    def temperature_degc(self) -> float:
        """Temperature of the board; NaN: unknown."""
        return Thermometer(self.root / "sys/class/thermal")()

    def clock_synchronised(self) -> bool | None:
        """Whether the wall clock follows a time server; None: unknown."""
        printed = _printed_by("timedatectl", "show", "--property=NTPSynchronized", "--value")
        return {"yes": True, "no": False}.get(printed.strip())

    def free_bytes(self, folder: Path) -> int:
        """Free space for this user in a folder. Raises OSError."""
        return shutil.disk_usage(folder).free

    def write_s(self, folder: Path, n_bytes: int) -> float:
        """Time to write so many bytes to the disk. Raises OSError."""
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


def _printed_by(*command: str) -> str:
    """The output of a program; "": it is not installed, or does not end."""
    try:
        return subprocess.run(command, capture_output=True, text=True, timeout=5.0, check=False).stdout
    except (OSError, subprocess.TimeoutExpired):
        return ""
