"""A camera of a hand on one module, as the process of its finger has it: `edge hand` has the module."""

from __future__ import annotations

import os
import socket

from edge.params import PARAMS as RUNTIME
from edge.sources.shared_memory import Inbox
from edge.types import Frame, Lens

#: Names the socket and the memory through which a finger's process gets its frames; it inherits both.
FEED_VARIABLE = "VORONOI_TOUCH_FEED"


class FedCamera:
    """A camera of a module that another process has open; to `OakSource` as that module would be."""

    def __init__(self, connection: socket.socket, fd: int) -> None:
        connection.settimeout(RUNTIME.wait_s)
        self._inbox = Inbox(connection, fd)
        self.lenses: list[Lens | None] = [None]
        self.live = True  # a lost module comes back; false: the process that has it has ended

    def open(self) -> Inbox:
        """Where frames come out."""
        return self._inbox

    def read(self, inbox: Inbox) -> dict[int, Frame] | None:
        """The next frame, or none within a moment; None: the module is lost, or the process has ended."""
        try:
            message = inbox.get()
        except TimeoutError:
            return {}
        if message is None:
            self.live = False
            return None
        self.lenses[0], frame = message
        return None if frame is None else {0: frame}

    def shut(self, inbox: Inbox) -> None:
        """Nothing: the module is not ours to close."""


def fed_camera() -> FedCamera | None:
    """That of this process, if it is a finger of a hand."""
    inherited = os.environ.pop(FEED_VARIABLE, "")
    if not inherited:
        return None
    connection, memory = map(int, inherited.split(","))
    return FedCamera(socket.socket(fileno=connection), memory)
