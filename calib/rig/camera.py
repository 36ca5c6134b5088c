"""Frames that were taken after a move, from a camera that is not synchronised with the rig.

Rules
- No fixed waiting times: frames that began before the rig stood still, or before the skin had time
  to settle, are read and discarded.
- A camera with its own clock cannot be compared with ours; STALE_FRAMES of it are discarded
  after the settling time has passed on our clock.
"""

import time
from collections.abc import Callable

from calib.errors import RigError
from edge.types import Clock, Frame, FrameSource

STALE_FRAMES = 3  # in the driver's queue, on the wire, and the one being exposed


class SettledCamera:
    """source    live
    settle_s  the skin creeps: most of a rubber's relaxation is over after this time
    """

    def __init__(
        self, source: FrameSource, settle_s: float = 0.3, now_ns: Callable[[], int] = time.monotonic_ns
    ) -> None:
        if not source.live:
            source.close()
            raise RigError(f"{source.name}: is a recording; a rig needs a live camera, e.g. --camera v4l2:0")
        self.source = source
        self._settle_ns = round(settle_s * 1e9)
        self._now_ns = now_ns
        self._frames = iter(source)
        self._still_ns = 0
        self._stale = 0

    def moved(self) -> None:
        """Note that the rig has just stopped."""
        self._still_ns = self._now_ns() + self._settle_ns
        self._stale = STALE_FRAMES

    def frame(self) -> Frame:
        """The next frame of the settled tip. Raises RigError: the camera has ended."""
        for frame in self._frames:
            if frame.clock in (Clock.HOST, Clock.DRIVER):
                if frame.capture_ns >= self._still_ns:
                    return frame
            elif self._now_ns() >= self._still_ns:
                if self._stale == 0:
                    return frame
                self._stale -= 1
        raise RigError(f"{self.source.name}: no further frames; check the camera, then go on with --resume")

    def close(self) -> None:
        self.source.close()
