"""Two serial ports that are one line."""

import os
import select
import termios
import threading
import tty
from pathlib import Path

from tests.support.waiting import SOON_S


class Ptys:
    """Ports at `edge` and `host` of a folder; a thread carries what is written to one to the other.

    They can be closed, as if the line were unplugged, and opened again at the same paths.
    """

    def __init__(self, directory: Path) -> None:
        self.paths = (directory / "edge", directory / "host")
        self.open()

    def open(self) -> None:
        self.masters: list[int] = []
        self._slaves: list[int] = []
        for path in self.paths:
            master, slave = os.openpty()
            tty.setraw(slave)
            path.unlink(missing_ok=True)
            path.symlink_to(os.ttyname(slave))
            self.masters.append(master)
            self._slaves.append(slave)  # held open: a master without any slave cannot be read
        self._wake, self._stop = os.pipe()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while True:
            ready, _, _ = select.select([*self.masters, self._wake], [], [])
            if self._wake in ready:
                break
            for k, master in enumerate(self.masters):
                if master in ready:
                    self.carry(k, os.read(master, 65536))
        for number in (*self.masters, *self._slaves, self._wake):
            os.close(number)

    def carry(self, k: int, data: bytes) -> None:
        """Port k was given these bytes."""
        os.write(self.masters[1 - k], data)

    def close(self) -> None:
        for path in self.paths:
            path.unlink()
        for slave in self._slaves:  # the thread may wait until somebody reads what it has written
            termios.tcflush(slave, termios.TCIFLUSH)
        os.close(self._stop)
        self._thread.join(SOON_S)
