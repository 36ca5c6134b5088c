"""The loop's side of the worker: starts it, sends new results, runs its viewers' commands, survives its end.

What changes the pipeline is posted to the loop. The end of the socket is the end of the process: if we did
not end it, a recording counts as broken, and the page is served again at the same address.
"""

import logging
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from pickle import PickleBuffer
from typing import Any

from edge.errors import InputError, RequestRefused
from edge.runtime.loop import Loop
from edge.sources.shared_memory import Outbox
from edge.types import Feature
from edge.worker.feeds import ViewFeed
from edge.worker.params import PARAMS, WorkerConfig
from hostlink.web import Listen
from hostlink.wire import RestFrameState

log = logging.getLogger(__name__)

#: Features that the page always shows; the surface is computed only for a viewer that requests it.
SHOWN = frozenset({Feature.DISPLACEMENT, Feature.CONTACTS, Feature.SHEAR, Feature.TORSION})


class WorkerClient:
    """Viewers and recorder of a loop; `process` is None before it is started."""

    def __init__(self, loop: Loop, config: WorkerConfig) -> None:
        self._loop, self._config = loop, config
        self._listen = config.listen
        self.view = ViewFeed(loop, self._put)
        self.recording = loop.session
        self.process: subprocess.Popen[bytes] | None = None
        self._closing = False
        self._sending = threading.Lock()  # the channel may be replaced
        self._outbox: Outbox | None = None
        self._thread: threading.Thread | None = None
        self._started_s = 0.0

    @property
    def url(self) -> str:
        """Address for a browser; the token is behind the #, which browsers do not send."""
        assert self._listen is not None
        return f"http://{self._listen}/" + (f"#token={self._listen.token}" if self._listen.token else "")

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
        recording = self.recording.put is not None
        self._stop_recording()
        self._close_channel()
        if self.process is not None:
            _end(self.process)
        if self._thread is not None:
            self._thread.join()
        feed = self.recording
        if recording and (feed.fault or feed.dropped_n):
            log.warning("recording: %s", feed.fault or f"{feed.dropped_n} messages lost")

    def _put(self, *message: Any) -> bool:
        with self._sending:
            return self._outbox is not None and self._outbox.put(message)

    def _close_channel(self) -> None:
        with self._sending:
            outbox, self._outbox = self._outbox, None
            if outbox is not None:
                outbox.close()

    # ---- the loop's thread --------------------------------------------------------------------------

    def _start_recording(self) -> None:
        calibration = self._loop.measurement.calibration
        if calibration is not None:
            self._put("attach", "calibration.json", PickleBuffer(calibration.encoded))
        self._loop.measurement.watch("recorder")
        self.recording.begin(self._put)

    def _stop_recording(self) -> None:
        self.recording.put = None
        self._loop.measurement.watch("recorder", False)
        self._put("stopped")

    # ---- the process ----------------------------------------------------------------------------------

    def _start_process(self, record: Path | None) -> None:
        """Raises InputError: the page or the recording cannot be started."""
        outbox = Outbox(PARAMS.memory_bytes)
        control, far_control = Pipe()
        fds = (outbox.far_end.fileno(), far_control.fileno(), outbox.fd)
        # It has its own session: Ctrl-C at the terminal goes to the loop alone, which ends the worker.
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
        control.send((level, config, source.name, source.rate_hz))
        port = next(_messages(control), None)
        if not isinstance(port, int):
            outbox.close()
            control.close()
            _end(self.process)
            raise port or InputError("view, record: the process for it ended at its start; see above for why")
        if self._listen is not None:
            self._listen = Listen(self._listen.host, port, self._listen.token)
        self.view.forget_shown()
        self._started_s = time.monotonic()
        with self._sending:
            self._outbox = outbox
        self._thread = threading.Thread(
            target=self._receive_loop, args=(control,), name="worker client", daemon=True
        )
        self._thread.start()

    # ---- the thread that receives ---------------------------------------------------------------------

    def _receive_loop(self, control: Connection) -> None:
        def record(wanted: bool) -> None:
            self._loop.post(self._start_recording if wanted else self._stop_recording)

        def answer(force: bool) -> None:
            with suppress(OSError):  # the worker has ended
                control.send(self._tare(force))

        def tare(force: bool) -> None:  # takes seconds, and other messages come meanwhile
            threading.Thread(target=answer, args=(force,), daemon=True).start()

        table: dict[str, Callable[..., None]] = {
            "want": self._on_wants,
            "record": record,
            "recorded": self.recording.on_report,
            "tare": tare,
        }
        with control:
            for name, *arguments in _messages(control):
                table[name](*arguments)
        if not self._closing:
            self._on_worker_exit()

    def _on_wants(self, wants: frozenset[str] | None) -> None:
        """Have only those features computed that all viewers want together; None: nobody watches."""
        shown = frozenset[Feature]()
        if wants is not None:
            shown = SHOWN | ({Feature.SURFACE} if "surface" in wants else shown)

        def change() -> None:
            self.view.set_watched(wants is not None)
            self._loop.measurement.set_demand(shown=shown)
            self._loop.measurement.watch("viewers", wants is not None)

        self._loop.post(change)

    def _tare(self, force: bool) -> tuple[RestFrameState, str]:
        """Have a new rest frame taken; what became of it, and why."""
        try:
            outcome = self._loop.measurement.ask_tare(force).done.result()
        except RequestRefused as error:
            return RestFrameState.REFUSED, str(error)
        return outcome.state, outcome.message

    def _on_worker_exit(self) -> None:
        """The worker ended unexpectedly: report it, and serve the page again."""
        assert self.process is not None
        code = self.process.wait()
        log.error("the process for viewers and recordings ended (%s)", code)
        self.recording.fault = f"its process ended ({code})"
        self._on_wants(None)
        self._close_channel()
        if self._listen is None or time.monotonic() - self._started_s < PARAMS.lived_s or self._closing:
            return
        try:
            self._start_process(None)
        except InputError as error:
            log.error("the live page has ended: %s", error)


def _messages(control: Connection) -> Iterator[Any]:
    """The messages that the worker sends, until its end."""
    with suppress(EOFError, OSError):
        while True:
            yield control.recv()


def _end(process: subprocess.Popen[bytes]) -> None:
    try:
        process.wait(PARAMS.end_s)
    except subprocess.TimeoutExpired:
        log.error("the process for viewers and recordings does not end; killed")
        process.kill()
        process.wait()
