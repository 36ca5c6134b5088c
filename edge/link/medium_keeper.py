"""The medium of a link, reported lost by any thread, closed and reopened by one."""

from __future__ import annotations

import time
from collections.abc import Callable

from edge.link.medium import Medium, MediumError

__all__ = ["MediumKeeper"]


class MediumKeeper:
    """Methods are called with the link's lock held.

    current  the open medium; None: lost
    lost     it was lost, and nothing was sent since: one that opens may still not take frames

    open_medium  opens the medium; raises MediumError with a line for the user
    retry_s      least time between two attempts
    """

    def __init__(self, open_medium: Callable[[], Medium], retry_s: float) -> None:
        self._open_medium, self._retry_s = open_medium, retry_s
        self.current: Medium | None = open_medium()
        self.lost = False
        self._failed: Medium | None = None
        self._tried_s = time.monotonic()

    def lose(self, medium: Medium) -> bool:
        """Note that this medium has failed; False: known already."""
        if self.current is not medium:
            return False
        self.current, self._failed, self.lost = None, medium, True
        return True

    def take_failed(self) -> Medium | None:
        """The media to close before another one is opened."""
        failed, self._failed = self._failed, None
        return failed

    @property
    def pause_s(self) -> float:
        """Time to wait before the next attempt.

        SocketCAN opens on an interface that is down, and fails at once: do not retry without a pause.
        """
        return max(0.0, self._tried_s + self._retry_s - time.monotonic())

    def try_open(self) -> Medium | None:
        """Open another medium, not in use yet; None: not possible now. Needs no lock."""
        self._tried_s = time.monotonic()
        try:
            return self._open_medium()
        except MediumError:
            return None
