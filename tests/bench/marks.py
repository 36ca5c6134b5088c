"""Marks, within a program that `tests.bench.counter` runs, of what is counted.

Nothing is imported here that a board lacks: the same program runs on an emulated arm64 processor.
"""

import ctypes
import os
import shutil
import subprocess
import sysconfig
import tempfile
from contextlib import suppress
from pathlib import Path

#: A number that the emulator's plugin knows (`deploy/sbc/count_blocks.c`): off; one more is on.
SWITCH = 0x7700000


class Marks:
    """`with marks: ...` around what counts, as often as wanted; all threads count.

    maps  where the places of libraries in memory are written, on an emulated processor; "": valgrind counts

    From its creation on caches are simulated, so that what comes before a mark warms them.
    """

    def __init__(self, maps: str = "") -> None:
        self._maps = maps
        if not maps:
            self._library = _compiled_counter()
            self._library.begin()

    def __enter__(self) -> None:
        self._switch(1)

    def __exit__(self, *_: object) -> None:
        self._switch(0)

    def _switch(self, on: int) -> None:
        if not self._maps:
            self._library.mark()
            return
        shutil.copyfile("/proc/self/maps", self._maps)
        with suppress(OSError):  # there is no such process
            os.getpriority(os.PRIO_PROCESS, SWITCH + on)


def _compiled_counter() -> ctypes.CDLL:
    """counter.c, beside this file, as a loaded library."""
    compiler = (sysconfig.get_config_var("CC") or "cc").split()[0]
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "counter.so"
        command = [shutil.which(compiler) or "cc", "-O3", "-shared", "-fPIC"]
        subprocess.run([*command, str(Path(__file__).with_name("counter.c")), "-o", str(library)], check=True)
        return ctypes.CDLL(str(library))
