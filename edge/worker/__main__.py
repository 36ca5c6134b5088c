"""The second process: `python -m edge.worker DATA CONTROL MEMORY`, with inherited file descriptors.

It ends when the data channel ends, whether the loop has closed it or died; received messages are written
first. Signals are handled by the loop: a service manager sends them to both.
"""

import logging
import os
import pickle
import signal
import socket
import sys
import threading
import time
from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import asdict
from datetime import datetime
from itertools import count
from pathlib import Path
from typing import Any

from edge.runtime.process import limit_resources

limit_resources()

from edge.errors import EdgeError  # noqa: E402  (after the number of library threads is set)
from edge.params import PARAMS as RUNTIME  # noqa: E402
from edge.recording.topics import TOPICS  # noqa: E402
from edge.recording.writer import Recorder  # noqa: E402
from edge.runtime.process import run_and_exit  # noqa: E402
from edge.worker.messages import (  # noqa: E402
    Answer,
    Ask,
    Attach,
    Begin,
    Event,
    PageReport,
    Ready,
    RecordingReport,
    Show,
    Stopped,
    Take,
    Wants,
)
from edge.worker.params import PARAMS  # noqa: E402
from edge.worker.shared_memory import Inbox, receive  # noqa: E402
from hostlink.interrupt import ENDING  # noqa: E402
from hostlink.web import CommandRefused  # noqa: E402

log = logging.getLogger("edge.worker")


class Worker:
    """control, inbox  to and from the loop's process"""

    def __init__(self, control: socket.socket, inbox: Inbox, begin: Begin) -> None:
        self._control, self._inbox, self._begin = control, inbox, begin
        self._config = config = begin.config
        self._serial = config.tip.get("serial", "")
        self._recording: Recorder | None = None
        self._switching = threading.Lock()  # one worker thread at a time starts or stops a recording
        self._drained = threading.Event()
        self._pending: dict[int, Future[str]] = {}
        self._numbers = count()
        self._reported: dict[type, object] = {PageReport: PageReport(), RecordingReport: RecordingReport()}
        self._due_s = 0.0
        if config.record is not None:
            self._recording = self._recorder(config.record, config.overwrite)
        self._page: Any = None
        if config.listen is not None:
            from edge.worker.page import LivePage

            commands = {"tare": self._tare, "record": self._record}
            self._page = LivePage(config.listen, begin.source, self._serial, commands, self._on_wants)
            self._page.start()

    @property
    def port(self) -> int:
        return self._page.server.port if self._page is not None else 0

    def run(self) -> None:
        """Run until the loop's process closes the channel, or dies."""
        threading.Thread(target=self._receive_loop, name="control", daemon=True).start()
        while (message := self._inbox.get()) is not None:
            recording = self._recording
            match message:
                case Show():
                    self._page.show(message)
                case Take(frame, result, state, lost_n) if recording is not None:
                    recording.count_lost(lost_n)
                    recording.take(frame, result, state)
                case Event(level, text) if recording is not None:
                    recording.event(level, text)
                case Attach(name, data) if recording is not None:
                    recording.attach(name, data.tobytes())
                case Stopped():
                    self._drained.set()
            now_s = time.monotonic()
            if now_s >= self._due_s:
                self._due_s = now_s + PARAMS.report_s
                self._report()
        if self._page is not None:
            self._page.close()
        with self._switching:
            if self._recording is not None:
                self._recording.close()
                self._report()

    # ---- to and from the loop -----------------------------------------------------------------------

    def _send(self, message: object) -> None:
        try:
            self._control.send(pickle.dumps(message))
        except OSError:
            log.debug("the loop's process has ended")  # the data channel ends too

    def _report(self) -> None:
        """Report the state of page and recording, if it has changed."""
        now: list[object] = []
        if self._page is not None:
            server = self._page.server
            now.append(PageReport(server.viewers_n, server.sent_n, server.cut_off_n))
        recording, shown = self._recording, None
        if recording is not None:
            report = RecordingReport(_frames_n(recording), recording.dropped_n, recording.fault)
            now.append(report)
            shown = {"file": recording.path.name, **asdict(report)}
        if self._page is not None:
            self._page.recording = shown
        for message in now:
            if message != self._reported[type(message)]:
                self._reported[type(message)] = message
                self._send(message)

    def _on_wants(self, wants: frozenset[str] | None) -> None:
        self._send(Wants(wants))
        self._report()  # after the last viewer left, no later message would trigger the report

    def _receive_loop(self) -> None:
        while packet := receive(self._control):
            answer: Answer = pickle.loads(packet)
            future = self._pending.pop(answer.number, None)
            if future is not None:
                future.set_result(answer.refused)

    def _ask(self, what: str, force: bool = False) -> None:
        """Send a command to the loop and wait for its answer. Raises CommandRefused."""
        number, future = next(self._numbers), Future[str]()
        self._pending[number] = future
        self._send(Ask(number, what, force))
        try:
            # Longer than the loop waits, so that a late answer is not lost.
            refused = future.result(PARAMS.command_s + RUNTIME.patience_s)
        except TimeoutError:
            refused = "the loop does not answer"
        if refused:
            raise CommandRefused(refused)

    # ---- commands of viewers, in worker threads -----------------------------------------------------

    def _tare(self, fields: Mapping[str, Any]) -> str:
        self._ask("tare", bool(fields.get("force")))
        return "a new rest frame is in use"

    def _record(self, fields: Mapping[str, Any]) -> str:
        with self._switching:
            recording = self._recording
            return self._begin_recording() if recording is None else self._end_recording(recording)

    def _recorder(self, path: Path, overwrite: bool = False) -> Recorder:
        made = Recorder(path, tip=self._config.tip, rate_hz=self._begin.rate_hz, overwrite=overwrite)
        made.finger = self._config.finger
        return made

    def _begin_recording(self) -> str:
        folder = self._config.recordings
        name = f"{self._serial or 'tip'}-{datetime.now():%Y%m%d-%H%M%S}.mcap"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            recorder = self._recorder(folder / name)
        except EdgeError as error:
            raise CommandRefused(str(error)) from None
        except OSError as error:
            raise CommandRefused(f"{folder}: {error.strerror}; give another folder") from None
        self._recording = recorder
        try:
            self._ask("start_recording")
        except CommandRefused:
            self._recording = None
            recorder.close()
            raise
        return f"recording {name}"

    def _end_recording(self, recording: Recorder) -> str:
        self._drained.clear()
        self._ask("stop_recording")
        self._drained.wait(PARAMS.command_s)  # everything that the loop has sent has arrived
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
    with socket.socket(fileno=control) as connection:
        begin: Begin = pickle.loads(receive(connection))
        logging.basicConfig(level=begin.log_level, format="%(levelname)s %(name)s: %(message)s")
        step_back()
        try:
            worker = Worker(connection, inbox, begin)
        except EdgeError as error:
            connection.send(pickle.dumps(Ready(refused=str(error), kind=type(error).__name__)))
        else:
            connection.send(pickle.dumps(Ready(worker.port)))
            worker.run()


if __name__ == "__main__":
    run_and_exit(main)
