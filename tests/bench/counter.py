"""Instructions of a program between its marks, by library and function: see `tests.bench.marks`.

Time depends on the machine and its load; the number of instructions does not. On this machine valgrind's
callgrind counts (Debian package valgrind), with the caches of a small board.

Rules
- The program gets a short environment, always the same: places in memory, and so misses, depend on it.
- BLAS, which only a start uses, computes without fused multiply-add, for which valgrind takes long.
- A function belongs to the library that holds it: C that is inlined into a kernel has no name of ours.
"""

import collections
import os
import platform
import re
import shutil
import subprocess
import sys
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from edge.errors import EdgeError
from tests.bench.output import ROOT

#: First-level instruction and data caches and the last level of a small board: bytes, ways, bytes of a line.
CACHES = ("--cache-sim=yes", "--I1=49152,12,64", "--D1=32768,8,64", "--LL=1048576,16,64")
ENVIRONMENT = {
    "PATH": os.environ.get("PATH", os.defpath),
    "PYTHONPATH": str(ROOT),
    "PYTHONHASHSEED": "0",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
}
if platform.machine() == "x86_64":
    ENVIRONMENT["OPENBLAS_CORETYPE"] = "Nehalem"
Functions = collections.Counter[tuple[str, str]]


class NoCounter(EdgeError):
    """What counts is not installed."""


@dataclass(frozen=True)
class Counts:
    """The cost of one frame.

    functions  (part, function) -> instructions; a part is a folder of kernels, as edge/cells, or a library
    ll_misses  of everything; 0: not counted
    """

    functions: dict[tuple[str, str], float]
    ll_misses: float = 0.0

    @property
    def instructions(self) -> int:
        """All of them."""
        return round(sum(self.functions.values()))

    @property
    def libraries(self) -> int:
        """Those outside of our kernels: the interpreter's and the libraries'."""
        return round(sum(n for (part, _), n in self.functions.items() if not part.startswith("edge")))

    def parts(self) -> dict[str, float]:
        """Instructions of each part, the most first."""
        total: defaultdict[str, float] = defaultdict(float)
        for (part, _), n in self.functions.items():
            total[part] += n
        return dict(sorted(total.items(), key=lambda item: -item[1]))


def counted(
    child: list[str], frames: int, folder: Path, *, environment: Mapping[str, str] = ENVIRONMENT
) -> Counts:
    """Count what a module does between its marks, on this machine.

    child   the module, and its arguments
    frames  that it processes between them
    folder  where callgrind's files go; it is made
    Raises  NoCounter
    """
    if shutil.which("valgrind") is None:
        raise NoCounter("valgrind counts instructions, and is not installed (Debian package valgrind)")
    folder.mkdir(exist_ok=True)
    plain = ("--compress-strings=no", "--compress-pos=no", "--instr-atstart=no")
    out = folder / "callgrind"
    command = ["valgrind", "--tool=callgrind", *plain, *CACHES, f"--callgrind-out-file={out}"]
    run([*command, sys.executable, "-m", *child], environment)
    functions, misses = Functions(), 0
    # Each first one was written where a mark begins.
    for n in range(2, 1 + len(list(folder.glob("callgrind.*"))), 2):
        found, missed = of_callgrind(Path(f"{out}.{n}"))
        functions += found
        misses += missed
    return Counts({name: n / frames for name, n in functions.items()}, misses / frames)


def run(command: list[str], environment: Mapping[str, str], where: Path = ROOT) -> str:
    """What a command prints. Raises RuntimeError with the end of its messages."""
    done = subprocess.run(command, cwd=where, env=environment, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr[-2000:]}")
    return done.stdout


def of_callgrind(path: Path) -> tuple[Functions, int]:
    """Instructions of each function, by part and name, and all last-level misses, of callgrind's output."""
    functions = Functions()
    events: list[str] = []
    misses = 0
    library = function = ""
    with path.open() as lines:
        for line in lines:
            if line.startswith("ob="):
                library = line[3:].strip()
            elif line.startswith("fn="):
                function = line[3:].strip()
            elif line.startswith("events:"):
                events = line.split()[1:]
            elif line.startswith("calls="):
                next(lines)  # the cost of what is called, which that function has itself
            elif line[0].isdigit():
                counts = dict(zip(events, map(int, line.split()[1:]), strict=False))
                functions[name_of(library, function)] += counts.get("Ir", 0)
                misses += sum(counts.get(kind, 0) for kind in ("ILmr", "DLmr", "DLmw"))
    return functions, misses


def name_of(library: str, symbol: str) -> tuple[str, str]:
    """Part and name of a symbol of a library: in edge/cells/mesh.so __pyx_f_4edge_5cells_4mesh_4Mesh__sweep
    is edge/cells, mesh.Mesh._sweep.
    """
    of = re.search(r"/(edge(?:/[a-z_]+)*)/([a-z_]+)\.[^/]*so$", library)
    if not of:
        return library.rpartition("/")[2] or "?", symbol
    part, module = of[1], of[2]
    rest, names = re.sub(r"^__pyx_[a-z]+_(?=\d)", "", symbol), list[str]()
    depth = part.count("/") + 2  # of the names before those within the module
    while (piece := re.match(r"(\d+)", rest)) and len(names) <= depth:
        end = piece.end() + int(piece[1])
        names.append(rest[piece.end() : end])
        rest = rest[end:].removeprefix("_")
    rest = rest.lstrip("0123456789")  # Cython's number of a method
    within = [*names[depth:], rest] if names[:1] == ["edge"] else [symbol]
    return part, ".".join(name for name in [module, *within] if name)
