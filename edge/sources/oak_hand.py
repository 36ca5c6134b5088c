"""A hand on one module: the process that opens it hands each camera's frames on to the process of its finger.

Frames of one exposure have one number. None waits until its set is complete, which would delay the first by
the transfer of all others. A finger that does not read loses frames, the others lose none.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Sequence
from typing import TYPE_CHECKING

from edge.errors import SourceError
from edge.params import PARAMS as RUNTIME
from edge.sources.shared_memory import Inbox, Outbox
from edge.types import Frame, Lens

if TYPE_CHECKING:
    from edge.sources.oak import OakModule, Opened

#: Names the socket and the memory through which a finger's process gets its frames; it inherits both.
FEED_VARIABLE = "VORONOI_TOUCH_FEED"


def hand_on(module: OakModule, opened: Opened | None, outboxes: Sequence[Outbox]) -> Opened | None:
    """Hand on what comes within a moment: to each finger the lens and frame of its camera.

    opened   None: the module was lost, and is opened if it is back
    Returns  the same for the next time
    """
    try:
        opened = opened or module.open()
    except (SourceError, RuntimeError):  # still away, or booting
        return None
    frames = module.read(opened)
    for place, outbox in enumerate(outboxes):
        if frames is None or place in frames:
            outbox.put((module.lenses[place], frames[place] if frames else None))  # no frame: it is lost
    if frames is None:
        module.shut(opened)
        return None
    return opened


class FedCamera:
    """A camera of a module that another process has open; to `OakSource` as that module would be.

    live  the module, if it is lost, comes back; false: that process has ended
    """

    def __init__(self, connection: socket.socket, fd: int) -> None:
        connection.settimeout(RUNTIME.wait_s)
        self._inbox = Inbox(connection, fd)
        self.lenses: list[Lens | None] = [None]
        self.live = True

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
