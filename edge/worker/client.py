"""The loop's side of the worker: starts it, sends new results, runs its viewers' commands, survives its end.

What changes the pipeline is posted to the loop. The end of the socket is the end of the process: if we did
not end it, a recording counts as broken, and the page is served again at the same address.
"""

import logging
import pickle
import socket
import subprocess
import sys
import threading
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from edge import errors
from edge.errors import InputError, RequestRefused
from edge.runtime.loop import Loop
from edge.types import Feature
from edge.worker.feeds import RecordingFeed, ViewFeed
from edge.worker.messages import (
    Answer,
    Ask,
    Attach,
    Begin,
    PageReport,
    Ready,
    RecordingReport,
    Stopped,
    Wants,
    WorkerConfig,
)
from edge.worker.params import PARAMS
from edge.worker.shared_memory import Outbox, pair, receive
from hostlink.web import Listen
from hostlink.wire import RestFrameState

log = logging.getLogger(__name__)

#: Features that the page always shows; the surface is computed only for a viewer that requests it.
SHOWN = frozenset({Feature.DISPLACEMENT, Feature.CONTACTS, Feature.SHEAR, Feature.TORSION})


class WorkerClient:
    """Viewers and recorder of a loop.

    page       the worker's last report on the page
    recording  the loop's recorder, while there is one
    process    None: not started
    """

    def __init__(self, loop: Loop, config: WorkerConfig) -> None:
        self._loop = loop
        self._config = config
        self._listen = config.listen
        self.page = PageReport()
        self.view = ViewFeed(loop, self._put)
        self.recording = RecordingFeed(self._put)
        self.process: subprocess.Popen[bytes] | None = None
        self._closing = False
        self._recorded = False  # the process may still have something to write
        self._sending = threading.Lock()  # the channel may be replaced
        self._outbox: Outbox | None = None
        self._thread: threading.Thread | None = None
        self._started_s = 0.0

    @property
    def url(self) -> str:
        """Address for a browser; the token is behind the #, which browsers do not send."""
        assert self._listen is not None
        return f"http://{self._listen}/" + (f"#token={self._listen.token}" if self._listen.token else "")

    @property
    def port(self) -> int:
        assert self._listen is not None
        return self._listen.port

    def start(self) -> None:
        """Start the process, and begin to send to it. Raises InputError."""
        self._start_process(self._config.record)
        self._loop.result_callbacks.append(self.view.on_result)
        self._loop.tick_callbacks.append(self.view.on_tick)
        if self._config.record is not None:
            self._start_recording()

    def close(self) -> None:
        """End page and recording, and wait until everything is written."""
        self._closing = True
        loop = self._loop
        with suppress(ValueError):  # it was never started
            loop.result_callbacks.remove(self.view.on_result)
            loop.tick_callbacks.remove(self.view.on_tick)
        recording = loop.session.recorder is self.recording
        if recording:
            loop.session.recorder = None
        self._close_channel(Stopped())
        if self.process is not None:
            _end(self.process, PARAMS.end_s)
        if self._thread is not None:
            self._thread.join()
        feed = self.recording
        if recording and (feed.fault or feed.dropped_n):
            log.warning("recording: %s", feed.fault or f"{feed.dropped_n} messages lost")

    def _put(self, message: Any) -> bool:
        with self._sending:
            return self._outbox is not None and self._outbox.put(message)

    def _close_channel(self, last: Any = None) -> None:
        with self._sending:
            outbox, self._outbox = self._outbox, None
            if outbox is not None:
                if last is not None:
                    outbox.put(last)
                outbox.close()

    # ---- the loop's thread --------------------------------------------------------------------------

    def _start_recording(self) -> None:
        calibration = self._loop.measurement.calibration
        if calibration is not None:
            self._put(Attach("calibration.json", np.frombuffer(calibration.encoded, np.uint8)))
        self.recording.begin()
        self._recorded = True
        self._loop.session.recorder = self.recording

    def _stop_recording(self) -> None:
        if self._loop.session.recorder is self.recording:
            self._loop.session.recorder = None
        self._put(Stopped())

    # ---- the process ----------------------------------------------------------------------------------

    def _start_process(self, record: Path | None) -> None:
        """Raises InputError: the page or the recording cannot be started."""
        outbox = Outbox(PARAMS.memory_bytes)
        control, far_control = pair()
        fds = (outbox.far_end.fileno(), far_control.fileno(), outbox.fd)
        # In its own session: Ctrl-C at the terminal goes to the loop alone, which ends the worker.
        self.process = subprocess.Popen(
            [sys.executable, "-m", "edge.worker", *map(str, fds)],
            pass_fds=fds,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            start_new_session=True,
        )
        far_control.close()
        outbox.far_end.close()
        source, level = self._loop.source, logging.getLogger().getEffectiveLevel()
        config = replace(self._config, listen=self._listen, record=record, tip=dict(self._config.tip))
        control.send(pickle.dumps(Begin(config, source.name, source.rate_hz, level)))
        early: list[Any] = []  # viewers of an earlier worker may reconnect before this one is ready
        while isinstance(ready := _receive(control), Wants | PageReport):
            early.append(ready)
        if not isinstance(ready, Ready) or ready.refused:
            outbox.close()
            control.close()
            _end(self.process, PARAMS.end_s)
            if isinstance(ready, Ready):
                raise getattr(errors, ready.kind)(ready.refused)
            raise InputError("view, record: the process for it ended at its start; see above for why")
        if self._listen is not None:
            self._listen = Listen(self._listen.host, ready.port, self._listen.token)
        self.view.forget_shown()
        self._started_s = time.monotonic()
        with self._sending:
            self._outbox = outbox
        self._thread = threading.Thread(
            target=self._receive_loop, args=(control, early), name="worker client", daemon=True
        )
        self._thread.start()

    # ---- the thread that receives ---------------------------------------------------------------------

    def _receive_loop(self, control: socket.socket, early: list[Any]) -> None:
        with control:
            while (message := early.pop(0) if early else _receive(control)) is not None:
                match message:
                    case Wants(wants):
                        self._on_wants(wants)
                    case PageReport():
                        self.page = message
                    case RecordingReport():
                        self.recording.report = message
                    case Ask(what="tare"):  # takes seconds, and reports and wishes come meanwhile
                        threading.Thread(target=self._answer, args=(control, message), daemon=True).start()
                    case Ask():
                        self._answer(control, message)
        if not self._closing:
            self._on_worker_exit()

    def _answer(self, control: socket.socket, ask: Ask) -> None:
        answer = Answer(ask.number, self._do(ask))
        with suppress(OSError):  # the worker has ended: the next `_receive` reports it
            control.send(pickle.dumps(answer))

    def _on_wants(self, wants: frozenset[str] | None) -> None:
        """Have only those features computed that are shown."""
        shown = frozenset[Feature]()
        if wants is not None:
            shown = SHOWN | ({Feature.SURFACE} if "surface" in wants else shown)

        def change() -> None:
            self.view.set_watched(wants is not None)
            self._loop.measurement.set_shown(shown)

        self._loop.post(change)

    def _do(self, ask: Ask) -> str:
        """Run a viewer's command; "" or why it was not done."""
        if ask.what == "tare":
            return self._tare(ask.force)
        starts = ask.what == "start_recording"
        future = self._loop.post(self._start_recording if starts else self._stop_recording)
        try:
            future.result(PARAMS.command_s)
        except TimeoutError:
            future.cancel()
            return "the loop does not answer; nothing was done"
        return ""

    def _tare(self, force: bool) -> str:
        """Have a new rest frame taken; "" or why the previous one stays in use."""
        if self._loop.measurement.in_contact and not force:
            return "something touches the tip; let go, or force the tare"
        try:
            outcome = self._loop.measurement.tare.ask(force).done.result(PARAMS.command_s)
        except RequestRefused as error:
            return str(error)
        except TimeoutError:
            return "no rest frame could be taken in time; the one before stays in use until it is"
        return outcome.message if outcome.state is RestFrameState.REFUSED else ""

    def _on_worker_exit(self) -> None:
        """The worker ended unexpectedly: report it, and serve the page again."""
        assert self.process is not None
        code = self.process.wait()
        log.error("the process for viewers and recordings ended (%s)", code)
        self.recording.failure = f"its process ended ({code})"
        self.page = PageReport()
        self._on_wants(None)
        self._close_channel()
        if self._listen is None or time.monotonic() - self._started_s < PARAMS.lived_s or self._closing:
            return
        try:
            self._start_process(None)
        except InputError as error:
            log.error("the live page has ended: %s", error)


def _receive(control: socket.socket) -> Any:
    """The next message; None: the end."""
    packet = receive(control)
    return pickle.loads(packet) if packet else None


def _end(process: subprocess.Popen[bytes], patience_s: float) -> None:
    try:
        process.wait(patience_s)
    except subprocess.TimeoutExpired:
        log.error("the process for viewers and recordings does not end; killed")
        process.kill()
        process.wait()
