"""Instructions of a program between its marks on an emulated arm64 processor, the Cortex-A72 of a board.

QEMU runs Debian's Python for arm64 and a plugin counts each block of instructions; `deploy/sbc/counting.sh`
makes what this needs, once. Our kernels are compiled for arm64 from the present source each time; what is up
to date stays as it is. Emulation knows no caches: there are no misses.
"""

import collections
import re
import shutil
import sys
import zipfile
from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from tests.bench.counter import ENVIRONMENT, Counts, NoCounter, name_of, run
from tests.bench.output import ROOT

MADE = ROOT / "deploy" / "sbc" / ".cache" / "count"
TOOLS = ("qemu-aarch64", "aarch64-linux-gnu-gcc", "aarch64-linux-gnu-nm")
EXECUTABLE = 2  # of an ELF file's types: it is loaded where it says


def made() -> bool:
    """Whether there is what emulation needs."""
    return all(map(shutil.which, TOOLS)) and (MADE / "count_blocks.so").exists()


@dataclass(frozen=True)
class Library:
    """A file in the program's memory.

    base  address that its symbols count from
    """

    path: Path
    base: int

    @cached_property
    def symbols(self) -> list[tuple[int, str]]:
        """Its functions by address."""
        found: list[tuple[int, str]] = []
        for which in ((), ("-D",)):  # what a stripped library exports
            printed = run(["aarch64-linux-gnu-nm", *which, "--defined-only", str(self.path)], ENVIRONMENT)
            found += [(int(a, 16), name) for a, name in re.findall(r"^(\w+) [tTwWiu] (\S+)$", printed, re.M)]
        return sorted(found)

    def function(self, address: int) -> str:
        """The function that an address of the program's memory belongs to."""
        at = bisect_right(self.symbols, (address - self.base, "\x7f")) - 1
        return self.symbols[at][1] if at >= 0 else "?"


@dataclass(frozen=True)
class Place:
    """A piece of a library in memory."""

    begin: int
    end: int
    binary: Library


class Board:
    """An emulated board with the present source.

    folder  an empty one, for its packages
    Raises  NoCounter
    """

    def __init__(self, folder: Path) -> None:
        if not made():
            what = f"{', '.join(TOOLS)}, and once deploy/sbc/counting.sh (see its head)"
            raise NoCounter(f"emulation needs {what}")
        wheel = run([sys.executable, "deploy/sbc/cross_wheel.py", str(folder)], ENVIRONMENT).splitlines()[-1]
        self._packages = folder / "packages"
        with zipfile.ZipFile(wheel) as packed:
            packed.extractall(self._packages)

    def counted(self, child: list[str], frames: int, folder: Path) -> Counts:
        """As `counter.counted`; the child gets one more argument, as of `Marks`."""
        blocks, maps = folder / "blocks", folder / "maps"
        path = [self._packages, MADE / "site", ROOT]
        environment = ENVIRONMENT | {
            "PYTHONPATH": ":".join(map(str, path)), "PYTHONPYCACHEPREFIX": str(MADE / "bytecode"),
            "OPENBLAS_CORETYPE": "ARMV8",
        }  # fmt: skip
        plugin = f"{MADE / 'count_blocks.so'},out={blocks}"
        emulator = ["qemu-aarch64", "-cpu", "cortex-a72", "-plugin", plugin]
        python = ["-L", str(MADE / "root"), str(MADE / "root/usr/bin/python3.11")]
        run([*emulator, *python, "-m", *child, str(maps)], environment, self._packages)
        return of_blocks(blocks, places_of(maps), frames)


def of_blocks(blocks: Path, places: list[Place], frames: int) -> Counts:
    """Instructions of each function, from what the plugin wrote and what lies where."""
    functions = collections.Counter[tuple[str, str]]()
    starts = [place.begin for place in places]
    for line in blocks.read_text(encoding="ascii").splitlines():
        address, size, runs = (int(text, base) for text, base in zip(line.split(), (16, 10, 10), strict=True))
        at = bisect_right(starts, address) - 1
        name = ("?", "?")
        if at >= 0 and address < places[at].end:
            library = places[at].binary
            name = name_of(str(library.path), library.function(address))
        functions[name] += size * runs
    return Counts({name: n / frames for name, n in functions.items()})


def places_of(maps: Path) -> list[Place]:
    """What lies where, by address, from a copy of /proc/PID/maps."""
    libraries: dict[str, Library] = {}
    places = []
    for line in maps.read_text(encoding="utf-8").splitlines():
        fields = line.split(maxsplit=5)
        if len(fields) < 6 or not fields[5].startswith("/"):
            continue
        name = fields[5]
        begin, end = (int(text, 16) for text in fields[0].split("-"))
        if name not in libraries:
            with open(name, "rb") as file:
                kind = file.read(18)[16]
            base = 0 if kind == EXECUTABLE else begin - int(fields[2], 16)
            libraries[name] = Library(Path(name), base)
        places.append(Place(begin, end, libraries[name]))
    return sorted(places, key=lambda place: place.begin)
