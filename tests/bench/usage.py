"""What a process takes of the machine, from /proc."""

import os
from pathlib import Path


def memory_mb(pid: int | str = "self", kind: str = "VmRSS") -> float:
    """Resident memory, or with `Pss` what is shared by its share; MB of 2**20 bytes."""
    file = "smaps_rollup" if kind == "Pss" else "status"
    lines = Path(f"/proc/{pid}/{file}").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(f"{kind}:")) / 1024


def cpu_s(pid: int) -> float:
    """Processor time that a process has used, all its threads."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
