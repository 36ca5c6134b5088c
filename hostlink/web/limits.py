"""Limits of a page's server: connections, time, messages, log lines."""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass

__all__ = ["SparseLog", "WebLimits"]


@dataclass(frozen=True, slots=True)
class WebLimits:
    """Limits of a page's server. Evidence: docs/tuning.md, "Live page".

    rate_hz          packets a second to each viewer
    packets_n        packets sent ahead of a viewer's acknowledgement
    patience_s       a viewer that acknowledges nothing for this long is disconnected
    viewers_n        viewers at once
    connections_n    connections at once that are not (yet) a viewer's; beyond it the oldest is closed
    request_s        such a connection is closed after this time, in any case
    header_bytes     of a line of a request
    headers_n        lines of a request
    message_bytes    of a viewer's message
    messages_per_s   of one viewer: 30 acknowledgements, and a person's clicks
    commands_n       commands of one viewer that are not answered yet
    wrong_token_s    delay of the answer to a wrong token, so that guessing takes too long
    log_s            least time between log lines of the same kind
    """

    rate_hz: float = 30.0
    packets_n: int = 2
    patience_s: float = 5.0
    viewers_n: int = 16
    connections_n: int = 64
    request_s: float = 20.0
    header_bytes: int = 4096
    headers_n: int = 64
    message_bytes: int = 4096
    messages_per_s: int = 200
    commands_n: int = 4
    wrong_token_s: float = 0.5
    log_s: float = 10.0


class SparseLog:
    """Writes at most one line in `every_s` seconds, with the number of those that were skipped.

    For events that remote clients can cause: they cannot fill the disk with them.
    """

    def __init__(self, log: logging.Logger, every_s: float) -> None:
        self._log, self._every_s = log, every_s
        self._next_s = 0.0
        self._left_out_n = 0

    def write(self, text: str, error: BaseException | None = None, level: int = logging.WARNING) -> None:
        """A line; with `error` also its traceback."""
        now_s = time.monotonic()
        if now_s < self._next_s:
            self._left_out_n += 1
            return
        more = f" ({self._left_out_n} more like this were not logged)" if self._left_out_n else ""
        self._next_s, self._left_out_n = now_s + self._every_s, 0
        self._log.log(level, "%s%s", text, more, exc_info=error)
