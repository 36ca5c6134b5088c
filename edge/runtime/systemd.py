"""Reports to the service manager, if there is one: a datagram to $NOTIFY_SOCKET a message (sd_notify(3)).

WATCHDOG is sent only while images arrive: a service whose camera hangs is restarted, which reopens the
camera.
"""

import logging
import os
import socket
import time
from collections.abc import Mapping

log = logging.getLogger(__name__)

#: Share of the watchdog's time after which sd_watchdog_enabled(3) asks for the next message.
_WATCHDOG_SHARE = 0.5


class Notifier:
    """The connection to the service manager, if there is one."""

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        address = environment.get("NOTIFY_SOCKET", "")
        self._address = "\0" + address[1:] if address.startswith("@") else address  # @: abstract name
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) if address else None
        if self._socket is not None:
            self._socket.setblocking(False)  # a manager that does not read must not stop a finger
        mine = environment.get("WATCHDOG_PID", "") in ("", str(os.getpid()))
        usec = environment.get("WATCHDOG_USEC", "") if mine else ""
        self._every_s = int(usec) * 1e-6 * _WATCHDOG_SHARE if usec.isdecimal() and self._socket else 0.0
        self._due_s = 0.0
        self._ready = False

    def frame(self) -> None:
        """An image was processed: READY once, then WATCHDOG as often as it is due."""
        if self._socket is None:
            return
        if not self._ready:
            self._ready = True
            self.send("READY=1")
        now = time.monotonic()
        if self._every_s and now >= self._due_s:
            self._due_s = now + self._every_s
            self.send("WATCHDOG=1")

    def status(self, text: str) -> None:
        """One line for `systemctl status`."""
        self.send("STATUS=" + " ".join(text.split()))

    def stopping(self) -> None:
        self.send("STOPPING=1")

    def send(self, message: str) -> None:
        if self._socket is None:
            return
        try:
            self._socket.sendto(message.encode(), self._address)
        except OSError as error:
            log.warning("service manager at %s: %s", self._address, error.strerror)

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None
