"""A finger's loop with a camera controlled by the test: frame by frame, on the test's clock."""

import threading
from typing import Any

from edge.calibration import Calibration
from edge.config import Config
from edge.faults.registry import FaultRegistry
from edge.link.sinks import MemorySink
from edge.runtime.loop import Loop
from edge.sources.live import ThreadedSource
from edge.types import Clock, Frame, FrameSource, Image
from hostlink.wire import FaultCode, State

PERIOD_NS = 10_000_000


class Camera(ThreadedSource):
    """A live camera whose state the test sets."""

    condition = ""
    ended = False

    def __init__(self) -> None:
        super().__init__("test camera")
        self.size_px, self.rate_hz = (320, 320), 100.0
        self.waiting = threading.Semaphore(0)
        self.waiting_frame: Frame | None = None

    def _work(self) -> None:
        raise AssertionError("the test gives the frames")

    def read(self, timeout_s: float | None = None) -> None:
        """No image; does not wait, so that a test takes no longer than it must."""
        self.waiting.release()

    def peek(self) -> Frame | None:
        """The image that waits."""
        return self.waiting_frame

    def close(self) -> None:
        self.ended = True


class Finger:
    """A loop with a camera, fed frame by frame on a clock of the test's."""

    def __init__(
        self,
        frames: list[Frame],
        calibration: Calibration | None,
        source: FrameSource | None = None,
        **options: Any,
    ) -> None:
        self.camera, self.sink = Camera(), MemorySink()
        self.registry = FaultRegistry()
        self.now_ns = self.jumped_ns = self.n = 0
        self.period_ns: int = options.pop("period_ns", PERIOD_NS)
        self.camera.rate_hz = 1e9 / self.period_ns
        clock_ns = options.pop("clock_ns", lambda: self.now_ns)
        self.clock = options.pop("clock", Clock.DEVICE)
        config = Config(**options)
        self.loop = Loop(
            source or self.camera, [self.sink], calibration, config, faults=self.registry, clock_ns=clock_ns
        )
        self.frames = frames
        for frame in frames[:8]:
            self.see(frame.image)

    def see(self, image: Image, skip: int = 0, jump_ns: int = 0, late_n: int = 0) -> State:
        """Give it an image. Before it, `skip` are lost; work on it begins `late_n` periods late."""
        self.n += 1 + skip
        self.jumped_ns += jump_ns
        captured_ns = self.n * self.period_ns
        self.now_ns = captured_ns + late_n * self.period_ns
        return self.loop.step(Frame(image, captured_ns + self.jumped_ns, self.n, self.clock))

    def show(self, *numbers: int) -> State:
        """Give it these of its frames; returns the last sample."""
        return [self.see(self.frames[number].image) for number in numbers][-1]

    @property
    def faults(self) -> set[FaultCode]:
        return set(self.registry.active)
