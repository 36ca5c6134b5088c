"""What one visitor of a page may cost: connections, time, messages, lines of the log."""

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
    patience_s       a viewer that acknowledges nothing for this long is cut off
    viewers_n        viewers at once
    connections_n    connections at once that are not (yet) a viewer's; beyond it the oldest is closed
    request_s        such a connection is closed after this time, whatever it did
    header_bytes     of a line of a request
    headers_n        lines of a request
    message_bytes    of a viewer's message
    messages_per_s   of one viewer: 30 acknowledgements, and what a person can click
    commands_n       commands of one viewer that are not answered yet
    wrong_token_s    delay of the answer to a wrong token, so that guessing takes for ever
    log_s            one line of the log in this time, for each kind of complaint
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
    """Writes at most one line in `every_s` seconds, and says how many it left out.

    For what strangers can cause: nobody fills the disk with it.
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
