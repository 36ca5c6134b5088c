"""A simulated finger that another program moves: `sim-remote:PORT?simulation=FILE.toml`.

Each datagram to the UDP port of this computer is a JSON list of `calib.sim.ToolPose`, the tools that touch
the skin now: `[{"depth_mm": 1.5, "shear_x_mm": 0.2}]`, or `[]`. It is rendered at once, as an image of that
moment. Of poses that come while one is rendered the newest is taken.
"""

import logging
import socket
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import msgspec

from calib.errors import RigError
from calib.rig.simulated import Simulation, load_simulation
from calib.sim import ToolPose
from edge.errors import SourceError
from edge.sources.live import ThreadedSource
from edge.sources.options import Options
from edge.types import Clock

log = logging.getLogger(__name__)

_LARGEST = 65535  # bytes of a datagram


class RemoteKeys(msgspec.Struct):
    """The scheme's own keys."""

    simulation: str = ""


class RemoteSource(ThreadedSource):
    """Images of the poses that come to a port.

    Raises  OSError: the port cannot be had
    """

    def __init__(self, port: int, simulation: Simulation) -> None:
        super().__init__(f"sim-remote:{port}")
        self._simulator = simulation.simulator()
        self.size_px = self._simulator.camera.size_px
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(("127.0.0.1", port))
        except OSError:
            self._socket.close()
            raise

    def _newest(self) -> bytes:
        """The newest message; waits for one."""
        message = self._socket.recv(_LARGEST)
        with suppress(BlockingIOError):
            while True:
                message = self._socket.recv(_LARGEST, socket.MSG_DONTWAIT)
        return message

    def _work(self) -> None:
        with self._socket:
            while not self._closing.is_set():
                message = self._newest()
                if self._closing.is_set():
                    return
                capture_ns = time.monotonic_ns()
                try:
                    frame = self._simulator.frame(msgspec.json.decode(message, type=tuple[ToolPose, ...]))
                except (msgspec.DecodeError, ValueError) as error:
                    if not self.faults["bad pose"]:
                        log.warning("%s: no list of tool poses: %s", self.name, error)
                    self.faults["bad pose"] += 1
                else:
                    self._offer(replace(frame, capture_ns=capture_ns, clock=Clock.HOST))

    def close(self) -> None:
        self._closing.set()
        with suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as waker:
            waker.sendto(b"", self._socket.getsockname())
        super().close()
        self._socket.close()


def open_remote(where: str, options: Options) -> RemoteSource:
    """Open `sim-remote:where?...`; an entry point of sources. Raises SourceError."""
    keys = options.own(f"sim-remote:{where}", RemoteKeys)
    try:
        port = int(where)
        if not (where.isdecimal() and 1 <= port <= 65535):
            raise ValueError
    except ValueError:
        raise SourceError(f"source sim-remote:{where}: {where!r} is no port; give 1 to 65535") from None
    try:
        return RemoteSource(port, load_simulation(Path(keys.simulation) if keys.simulation else None))
    except (RigError, OSError) as error:
        raise SourceError(f"source sim-remote:{where}: {error}") from None
