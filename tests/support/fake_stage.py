"""A stage on a pty that answers like GRBL 1.1 or Marlin, as far as tests need it.

Behaviour taken from GRBL v1.1 (interface, alarm and error codes): Ctrl-X resets and prints the banner,
with homing enabled it starts locked (ALARM state, G-code answers `error:9`), `$H` homes, a target beyond
the soft limits raises `ALARM:2` without an `ok`, an unknown letter `error:20`; and from Marlin: `start`,
`echo:busy: processing` while a move lasts, `ok`.
"""

import fcntl
import os
import pty
import re
import select
import struct
import termios
import threading
import tty

from tests.support.waiting import SOON_S

WORD = re.compile(r"([A-Z])([-+]?[0-9.]+)")


class FakeStage:
    """travel  (lowest, highest) of X, Y and Z, mm: the soft limits
    boots   opening the port resets the board, as on most; else it has booted already

    The pty runs in packet mode, which reports the flush at the opening of a port.
    """

    def __init__(
        self, dialect: str = "grbl", travel: tuple[float, float] = (-200.0, 200.0), boots: bool = True
    ) -> None:
        self.dialect = dialect
        self.travel = travel
        self.boots = boots
        self.mute = ""  # lines that start so get no answer
        self.reset_on = ""  # a line that starts so resets the board
        self.homing_fails = False
        self.lines: list[str] = []
        self.moves: list[dict[str, float]] = []
        self.locked = True
        self._at: dict[str, float] = {}
        self._mine, theirs = pty.openpty()
        tty.setraw(theirs)
        tty.setraw(self._mine)
        fcntl.ioctl(self._mine, termios.TIOCPKT, struct.pack("i", 1))
        self.port = os.ttyname(theirs)
        self._theirs = theirs
        self._ended, self._end = os.pipe()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _send_lines(self, *lines: str) -> None:
        os.write(self._mine, "".join(f"{line}\r\n" for line in lines).encode())

    def _banner(self) -> None:
        if self.dialect == "marlin":
            self._send_lines("start", "echo:Marlin 2.1.2")
            return
        self.locked = True
        self._send_lines("", "Grbl 1.1h ['$' for help]", "[MSG:'$H'|'$X' to unlock]")

    def _run(self) -> None:
        pending = b""
        while True:
            ready, _, _ = select.select([self._mine, self._ended], [], [])
            if self._ended in ready:
                return
            try:
                data = os.read(self._mine, 256)
            except OSError:  # the other side was closed
                return
            if not data:
                return
            kind, data = data[0], data[1:]
            if kind & termios.TIOCPKT_FLUSHREAD and self.boots:
                self.boots = False
                self._banner()
            if b"\x18" in data and self.dialect == "grbl":
                data = data.rpartition(b"\x18")[2]
                pending = b""
                self._banner()
            pending += data
            while b"\n" in pending:
                line, _, pending = pending.partition(b"\n")
                self._answer(line.decode().strip())

    def _answer(self, line: str) -> None:
        self.lines.append(line)
        if self.mute and line.startswith(self.mute):
            return
        if self.reset_on and line.startswith(self.reset_on):
            self._banner()
            return
        if line in ("$H", "G28"):
            if self.homing_fails:
                self._send_lines("ALARM:9")
                return
            self.locked = False
            self._send_lines("ok")
        elif self.locked and self.dialect == "grbl":
            self._send_lines("error:9")
        elif line.startswith("G1"):
            self._move({k: float(v) for k, v in WORD.findall(line) if k in "XYZA"})
        elif re.match(r"G21|G90|G4 P", line) or (line == "M400" and self.dialect == "marlin"):
            self._send_lines("ok")
        elif line == "M115" and self.dialect == "marlin":
            self._send_lines(
                "FIRMWARE_NAME:Marlin 2.1.2 SOURCE_CODE_URL:github.com/MarlinFirmware/Marlin", "ok"
            )
        elif self.dialect == "marlin":
            self._send_lines(f'echo:Unknown command: "{line}"', "ok")
        else:
            self._send_lines("error:20")

    def _move(self, target: dict[str, float]) -> None:
        low, high = self.travel
        if self.dialect == "grbl" and any(not low <= v <= high for k, v in target.items() if k != "A"):
            self.locked = True
            self._send_lines("ALARM:2", "[MSG:Reset to continue]")
            return
        self._at |= target
        self.moves.append(dict(self._at))
        self._send_lines(*["echo:busy: processing"] * (self.dialect == "marlin"), "ok")

    def close(self) -> None:
        """The thread ends first: a descriptor closed under it may be reused before it reads."""
        os.close(self._end)
        self._thread.join(SOON_S)
        for descriptor in (self._ended, self._theirs, self._mine):
            os.close(descriptor)
