"""The last guard of a link, for fingertip and host alike: nothing that is raised ends its threads.

    LinkGuard.run:  step, step, ... until the link is closed
                      \\__ raised: counted, the first of each kind logged, then `recover`

A driver may raise anything (an IndexError for a damaged line, a `termios.error`), and so may a callback
(`sys.exit()`). A thread that ended for it would leave a link that looks open and is deaf.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from hostlink.wire.errors import LinkError

__all__ = ["LinkGuard"]

log = logging.getLogger(__name__)


class LinkGuard:
    """The guard of one link.

    name          the link's, for the log
    unforeseen_n  how many exceptions were raised that nobody foresaw
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.unforeseen_n = 0
        self._known: set[tuple[type[BaseException], int]] = set()
        self._noting = threading.Lock()

    def note(self, error: BaseException) -> None:
        """Count it; log the first of each kind, one of our own in one line."""
        trace = error.__traceback__
        while trace is not None and trace.tb_next is not None:
            trace = trace.tb_next
        kind = (type(error), trace.tb_lineno if trace else 0)
        with self._noting:
            self.unforeseen_n += 1
            if kind in self._known:
                return
            self._known.add(kind)
        if isinstance(error, LinkError):
            log.error("%s: %s", self.name, error)
        else:
            log.error("%s: unforeseen; the link goes on", self.name, exc_info=error)

    def call(self, what: Callable[..., object], *arguments: object) -> bool:
        """Call it; False: it raised, which is noted."""
        try:
            what(*arguments)
        except BaseException as error:  # noqa: BLE001 - whatever it is: the thread must go on
            self.note(error)
            return False
        return True

    def run(
        self,
        step: Callable[[], None],
        closing: Callable[[], bool],
        recover: Callable[[], None],
        finish: Callable[[], None] | None = None,
    ) -> None:
        """The whole life of a link's thread.

        step     called again and again
        closing  whether the link is to be closed
        recover  called after a step that raised: loses the medium, and waits a little
        finish   called at the end
        """
        while not closing():
            if not self.call(step):
                self.call(recover)
        if finish is not None:
            self.call(finish)
