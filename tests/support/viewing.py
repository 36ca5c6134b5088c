"""A running loop with its live page; the test chooses the frame that is shown.

with Live(data_dir / "press.mcap") as live:
    live.show(0); live.show(-1)      # untouched, pressed; shown again and again, 60 times a second
    live.hold(); live.go_on()        # the camera stalls, and recovers
    live.url, live.loop, live.worker
"""

import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

from edge.calibration import Calibration
from edge.recording.reader import RecordingSource
from edge.runtime.loop import Loop
from edge.sources.live import ThreadedSource
from edge.types import Clock, Frame
from edge.worker.client import WorkerClient
from edge.worker.params import WorkerConfig
from hostlink.web import parse_listen
from tests.support.waiting import SOON_S

TOKEN = "a-token-for-tests"
RATE_HZ = 60.0


class Stepper(ThreadedSource):
    """One frame of a recording, again and again, until another one is chosen; intermediate frames are not
    skipped.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path.name)
        recording = RecordingSource(path)
        self.frames = list(recording)
        self.size_px, self.rate_hz = recording.size_px, RATE_HZ
        self.at = self.aim = 0
        self.going = threading.Event()
        self.going.set()

    def _work(self) -> None:
        n = 0
        while not self._closing.wait(1 / self.rate_hz):
            if self.going.is_set():
                if self._slot is None:  # the last one was taken
                    self.at += (self.aim > self.at) - (self.aim < self.at)
                self._offer(self._frame(n))
                n += 1

    def _frame(self, n: int) -> Frame:
        frame = self.frames[self.at]
        image = frame.image.copy()
        image[0, 0] = n % 256  # a sensor never gives the same image twice, even if one between is skipped
        return replace(frame, image=image, sequence=n, capture_ns=time.monotonic_ns(), clock=Clock.HOST)


class Live:
    """The loop in its own thread, and its page."""

    def __init__(
        self,
        recording: Path,
        calibration: Path | None = None,
        recordings: Path = Path("."),
        record: Path | None = None,
    ) -> None:
        self.recordings = recordings
        self.source = Stepper(recording)
        self.loop = Loop(self.source, [], None if calibration is None else Calibration.load(calibration))
        listen = parse_listen("127.0.0.1:0", TOKEN)
        self.worker = WorkerClient(
            self.loop, WorkerConfig(listen, record, recordings=recordings, tip={"serial": "T-1"})
        )
        self._changed = threading.Condition()
        self.loop.tick_callbacks.append(self._on_tick)
        self._thread = threading.Thread(target=self.loop.run)

    @property
    def url(self) -> str:
        return self.worker.url

    def _on_tick(self) -> None:
        with self._changed:
            self._changed.notify_all()

    def until(self, condition: Any, what: str) -> None:
        """Wait until something holds, tested with every turn of the loop."""
        with self._changed:
            assert self._changed.wait_for(condition, SOON_S), f"never: {what}"

    def show(self, frame: int) -> None:
        """Show this frame of the recording from now on; returns when it was measured."""
        self.source.aim = frame % len(self.source.frames)
        wanted, before = self.source.frames[frame].truth, self.loop.measurement.last

        def measured() -> bool:
            last = self.loop.measurement.last
            return last is not None and last is not before and last.frame.truth is wanted

        self.until(measured, f"frame {frame} measured")

    def hold(self) -> None:
        self.source.going.clear()

    def go_on(self) -> None:
        self.source.going.set()

    def __enter__(self) -> Self:
        self.worker.start()
        self._thread.start()
        self.until(lambda: self.loop.measurement.last is not None, "a first result")
        return self

    def __exit__(self, *_: object) -> None:
        self.worker.close()
        self.loop.stop()
        self.source.close()
        self._thread.join(SOON_S)
