"""The second process: `python -m edge.worker DATA CONTROL MEMORY`, with inherited file descriptors.

It ends when the data channel ends, whether the loop has closed it or died; received messages are written
first. Signals are handled by the loop: a service manager sends them to both.
"""

import logging
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Mapping
from datetime import datetime
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from edge.runtime.process import limit_resources

limit_resources()

from edge.errors import EdgeError, InputError  # noqa: E402  (after the number of library threads is set)
from edge.recording.topics import TOPICS  # noqa: E402
from edge.recording.writer import Recorder  # noqa: E402
from edge.runtime.process import run_and_exit  # noqa: E402
from edge.sources.shared_memory import Inbox  # noqa: E402
from edge.worker.params import PARAMS, WorkerConfig  # noqa: E402
from hostlink.interrupt import ENDING  # noqa: E402
from hostlink.web import CommandRefused, WebError  # noqa: E402
from hostlink.wire import RestFrameState  # noqa: E402

log = logging.getLogger("edge.worker")


class Worker:
    """Page and recorder, for a camera of this name and rate. Raises EdgeError: the file cannot be written."""

    def __init__(self, control: Connection, config: WorkerConfig, source: str, rate_hz: float) -> None:
        self._control, self._config, self._rate_hz = control, config, rate_hz
        self._serial = config.tip.get("serial", "")
        self._recording: Recorder | None = None
        self._sending, self._taring = threading.Lock(), threading.Lock()
        self._switching = threading.Lock()  # one worker thread at a time starts or stops a recording
        self._drained = threading.Event()
        self._reported: tuple[int, str | None] = (0, None)
        self._due_s = 0.0
        if config.record is not None:
            self._recording = self._recorder(config.record, config.overwrite)
        self._page: Any = None
        if config.listen is not None:
            from edge.worker.page import LivePage

            commands = {"tare": self._tare, "record": self._record}
            self._page = LivePage(config.listen, source, self._serial, commands, partial(self._send, "want"))

    def start(self) -> None:
        """Serve the page, and tell the loop at which port. Raises WebError."""
        with self._sending:  # what viewers want comes after it
            if self._page is not None:
                self._page.server.start()
            self._control.send(self._page.server.port if self._page is not None else 0)

    def run(self, inbox: Inbox) -> None:
        """Run until the loop's process closes the channel, or dies."""
        while (message := inbox.get()) is not None:
            name, *arguments = message
            if name == "stopped":
                self._drained.set()
            elif name == "show":
                self._page.show(*arguments)
            elif self._recording is not None:
                getattr(self._recording, name)(*arguments)
            now_s = time.monotonic()
            if now_s >= self._due_s:
                self._due_s = now_s + PARAMS.report_s
                self._report()
        if self._page is not None:
            self._page.server.close()
        self._drained.set()
        with self._switching:
            if self._recording is not None:
                self._recording.close()
                self._report()

    # ---- to the loop --------------------------------------------------------------------------------

    def _send(self, *message: object) -> None:
        try:
            with self._sending:
                self._control.send(message)
        except OSError:
            log.debug("the loop's process has ended")  # the data channel ends too

    def _report(self) -> None:
        """Report the state of the recording, if it has changed."""
        recording, shown = self._recording, None
        if recording is not None:
            dropped_n, fault = now = recording.dropped_n, recording.fault
            frames_n = _frames_n(recording)
            shown = {
                "file": recording.path.name, "frames_n": frames_n, "dropped_n": dropped_n, "fault": fault
            }  # fmt: skip
            if now != self._reported:
                self._reported = now
                self._send("recorded", dropped_n, fault)
        if self._page is not None:
            self._page.recording = shown

    # ---- commands of viewers, in worker threads -----------------------------------------------------

    def _tare(self, fields: Mapping[str, Any]) -> str:
        if not self._taring.acquire(blocking=False):
            raise CommandRefused("a rest frame is being taken already; ask again when it is done")
        try:
            self._send("tare", fields.get("force") is True)
            state, said = self._control.recv()  # nothing else comes this way
        except (EOFError, OSError):
            state, said = RestFrameState.REFUSED, "the program ends"
        finally:
            self._taring.release()
        if state is RestFrameState.REFUSED:
            raise CommandRefused(said)
        return f"rest frame forced: {said}" if said else "a new rest frame is in use"

    def _record(self, fields: Mapping[str, Any]) -> str:
        with self._switching:
            recording = self._recording
            return self._begin_recording() if recording is None else self._end_recording(recording)

    def _recorder(self, path: Path, overwrite: bool = False) -> Recorder:
        made = Recorder(path, tip=self._config.tip, rate_hz=self._rate_hz, overwrite=overwrite)
        made.finger = self._config.finger
        return made

    def _begin_recording(self) -> str:
        folder = self._config.recordings
        name = f"{self._serial or 'tip'}-{datetime.now():%Y%m%d-%H%M%S}.mcap"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._recording = self._recorder(folder / name)
        except EdgeError as error:
            raise CommandRefused(str(error)) from None
        except OSError as error:
            raise CommandRefused(f"{folder}: {error.strerror}; give another folder") from None
        self._send("record", True)
        return f"recording {name}"

    def _end_recording(self, recording: Recorder) -> str:
        self._drained.clear()
        self._send("record", False)
        self._drained.wait(PARAMS.end_s)  # everything that the loop has sent has arrived
        self._recording = None
        recording.close()
        name, frames_n = recording.path.name, _frames_n(recording)
        if recording.fault:
            raise CommandRefused(f"{name}: {frames_n} frames, then {recording.fault}")
        lost = f", {recording.dropped_n} messages lost" if recording.dropped_n else ""
        return f"{name}: {frames_n} frames{lost}"


def _frames_n(recorder: Recorder) -> int:
    return recorder.written_n[TOPICS["frame"].name]


def step_back() -> None:
    """Yield to the loop: ordinary scheduling at lower priority, and off the core of a real-time loop."""
    real_time = os.sched_getscheduler(0) in (os.SCHED_FIFO, os.SCHED_RR)
    others = set(range(os.cpu_count() or 1)) - os.sched_getaffinity(0)
    try:
        if real_time:
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        os.setpriority(os.PRIO_PROCESS, 0, max(PARAMS.nice, os.getpriority(os.PRIO_PROCESS, 0)))
        if real_time and others:
            os.sched_setaffinity(0, others)
    except OSError as error:  # a sandbox may forbid it; that of deploy/ does not
        log.warning("viewers and recorder run with the loop's own priority: %s", error.strerror)


def main() -> None:
    """Serve and record until the loop's process ends."""
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)
    data, control, memory = (int(text) for text in sys.argv[1:4])
    inbox = Inbox(socket.socket(fileno=data), memory)
    with Connection(control) as connection:
        level, *about = connection.recv()
        logging.basicConfig(level=level, format="%(levelname)s %(name)s: %(message)s")
        step_back()
        try:
            worker = Worker(connection, *about)
            worker.start()
        except (EdgeError, WebError) as error:
            connection.send(error if isinstance(error, EdgeError) else InputError(str(error)))
        else:
            worker.run(inbox)


if __name__ == "__main__":
    run_and_exit(main)
