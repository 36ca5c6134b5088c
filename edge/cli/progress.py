"""Progress of work that takes longer than two seconds; on stderr, and only on a terminal.

The bar is drawn by the work itself: a replay's by the loop, after the sample has left; a spinner ends before
frames are read.
"""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def waiting(what: str, shown: bool) -> Iterator[None]:
    """A spinner with a text, while the context lasts."""
    if not (shown and sys.stderr.isatty()):
        yield
        return
    from rich.console import Console

    with Console(stderr=True).status(what):
        yield


@contextmanager
def counting(what: str, total_n: int, shown: bool) -> Iterator[Callable[[int], None]]:
    """A bar with counts and the remaining time; the returned function draws it, given the number done.

    total_n  0: not known
    """
    if not (shown and sys.stderr.isatty()):
        yield lambda done_n: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), auto_refresh=False) as drawn:
        task = drawn.add_task(what, total=total_n or None)
        due_s = 0.0

        def count(done_n: int) -> None:
            nonlocal due_s
            now_s = time.monotonic()
            if now_s >= due_s:
                due_s = now_s + 1 / drawn.live.refresh_per_second
                drawn.update(task, completed=done_n, refresh=True)

        yield count
