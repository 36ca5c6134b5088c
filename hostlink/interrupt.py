"""Signals that end a program: Ctrl-C, the end of a session or of a service, a lost terminal.

All of them do what Ctrl-C does: they raise KeyboardInterrupt in the main thread, so that files are completed
or removed. Its argument is the signal's number; Python's own for Ctrl-C has none.

    while a program starts      it ends at once, without a traceback: `exit_on_interrupt`
    while a command runs        KeyboardInterrupt: `interrupting`, in `hostlink.cli_exit`
    while a file gets its name  the signal waits until that is done: `interrupts_held`
    in a loop of its own        a function is called instead: `calling_on_signals`, `call_on_signals`

Where a signal is ignored (SIGINT in a background job, SIGHUP under `nohup`) or handled by the program itself,
it stays so.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from types import FrameType
from typing import Any

__all__ = [
    "ENDING",
    "call_on_signals",
    "calling_on_signals",
    "exit_code",
    "exit_on_interrupt",
    "interrupting",
    "interrupts_held",
]

_SHELL = 128  # a shell adds the number of the signal
_AGAIN_S = 0.01  # a callback is over by then, or the signal comes once more
#: `timeout` and service managers send SIGTERM; SIGHUP: the terminal has gone; SIGQUIT: Ctrl-\\.
ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)

_came: list[int] = []  # those of the command that runs


def _interrupt(number: int, frame: FrameType | None) -> None:
    _came.append(number)
    while frame is not None:
        if frame.f_code is _report_ignored.__code__:  # what is raised here is ignored, too
            _send_again(number)
            return
        frame = frame.f_back
    if number in (signal.SIGHUP, signal.SIGTERM):  # the shell and the kernel both report a lost terminal
        signal.signal(number, signal.SIG_IGN)
    raise KeyboardInterrupt(number)


def _report_ignored(otherwise: Callable[[Any], Any], ignored: sys.UnraisableHookArgs) -> None:
    """Called for an exception that Python ignores: a signal comes again, all else is reported as usual."""
    if isinstance(ignored.exc_value, KeyboardInterrupt):
        number = exit_code(ignored.exc_value) - _SHELL
        signal.signal(number, _interrupt)
        _send_again(number)
    else:
        otherwise(ignored)


def _send_again(number: int) -> None:
    again = threading.Timer(_AGAIN_S, os.kill, (os.getpid(), number))
    again.daemon = True
    again.start()


def _end(number: int, _frame: FrameType | None) -> None:
    os._exit(_SHELL + number)


def exit_code(interrupt: BaseException | None) -> int:
    """Exit code of a program that ends by this KeyboardInterrupt."""
    number = interrupt.args[0] if interrupt is not None and interrupt.args else signal.SIGINT
    return _SHELL + int(number)


@contextmanager
def _handling(numbers: list[signal.Signals], handler: Any) -> Iterator[None]:
    """Handle these signals so until the block ends; Python allows it in the main thread alone."""
    here = threading.current_thread() is threading.main_thread()
    before = {number: signal.signal(number, handler) for number in numbers if here}
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)


def _of_ours() -> list[signal.Signals]:
    """The signals that raise KeyboardInterrupt now."""
    return [n for n in ENDING if signal.getsignal(n) in (signal.default_int_handler, _interrupt)]


@contextmanager
def exit_on_interrupt() -> Iterator[None]:
    """Until the block ends, or `interrupting` begins, these signals end the process. For imports: no file is
    open that must be closed.

    In the middle of an import, KeyboardInterrupt is a traceback, or another error: compiled modules turn it
    into an ImportError.
    """
    with _handling(_of_ours(), _end):
        yield


@contextmanager
def interrupting() -> Iterator[None]:
    """All ending signals raise KeyboardInterrupt, until the block ends.

    Python ignores what is raised in a finalizer or in a weak reference's callback, such as those of imports.
    A signal that comes there comes again when it is over. Libraries make another error of it, as NumPy does
    where it reads a format: that is KeyboardInterrupt, too.
    """
    _came.clear()
    report = sys.unraisablehook
    sys.unraisablehook = partial(_report_ignored, report)
    ours = (signal.SIG_DFL, signal.default_int_handler, _end)
    try:
        with _handling([n for n in ENDING if signal.getsignal(n) in ours], _interrupt):
            yield
    except Exception as error:
        if _came:
            raise KeyboardInterrupt(_came[0]) from error
        raise
    finally:
        sys.unraisablehook = report


@contextmanager
def interrupts_held() -> Iterator[None]:
    """A signal that comes within the block raises KeyboardInterrupt at its end. For what takes no time."""
    held: list[int] = []
    with _handling(_of_ours(), lambda number, _: held.append(number)):
        yield
    if held:
        raise KeyboardInterrupt(*(number for number in held[:1] if number != signal.SIGINT))


@contextmanager
def calling_on_signals(end: Callable[[], object]) -> Iterator[None]:
    """Ending signals call `end` until the block ends: an exception would cut off what is being written."""
    with _handling([n for n in ENDING if signal.getsignal(n) != signal.SIG_IGN], lambda *_: end()):
        yield


def call_on_signals(end: Callable[[], object]) -> None:
    """The same until the program ends. SIGINT and SIGTERM are heard by a background job, too."""
    for number in ENDING:
        if number in (signal.SIGINT, signal.SIGTERM) or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, lambda *_: end())
