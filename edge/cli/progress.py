"""Progress of work that takes longer than two seconds; on stderr, and only on a terminal.

The bar of a replay is drawn by the loop itself, after the sample has left; a spinner ends before frames are
read.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress


@contextmanager
def waiting(what: str, shown: bool) -> Iterator[None]:
    """A spinner with a text, while the context lasts."""
    if not (shown and sys.stderr.isatty()):
        yield
        return
    from rich.console import Console

    with Console(stderr=True).status(what):
        yield


def bar(shown: bool, auto_refresh: bool = True) -> Progress:
    """A progress bar with counts and the remaining time."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
        auto_refresh=auto_refresh,
        disable=not (shown and console.is_terminal),
    )


@contextmanager
def counting(what: str, total_n: int, shown: bool) -> Iterator[Callable[[int], None]]:
    """A bar that is drawn by calls of the returned function.

    total_n  0: not known
    Returns  function to be called with the number done, at any rate
    """
    if not (shown and sys.stderr.isatty()):
        yield lambda done_n: None
        return
    with bar(True, auto_refresh=False) as drawn:
        task = drawn.add_task(what, total=total_n or None)
        due_s = 0.0

        def count(done_n: int) -> None:
            nonlocal due_s
            now_s = time.monotonic()
            if now_s >= due_s:
                due_s = now_s + 1 / drawn.live.refresh_per_second
                drawn.update(task, completed=done_n, refresh=True)

        yield count
