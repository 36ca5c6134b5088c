"""What `tests.bench.step` counts: `python -m tests.bench.step_child FRAMES CALIBRATION HOW [MAPS]`.

FRAMES is an .npz of `images`, of which the first show the untouched tip, `first`, the index of the first one
that is repeated, `warm` and `counted`, how many frames are processed before and while it counts, and
`features`, what is computed. HOW is `instructions`, or `calls`: then one JSON object goes to stdout, calls of
all counted frames by function. MAPS as of `Marks`.

Rules
- A frame is `Loop.step`, from an image of a live source to a frame that a CAN FD sink gives to a socket.
- Time is the frames' own, 240 a second: counting makes the program slow, and it must not take that for a
  fault. For the same reason no thread wants the interpreter after a while, and the sink's reader waits long.
- Only what a board has is imported.
"""

import sys
import time
from functools import partial

PERIOD_NS = 4_166_667
AGE_NS = 1_000_000  # of an image, when work on it begins
WAIT_S = 1e3  # much longer than any counting takes
SIZE = 72  # bytes of a frame of the kernel, `canfd_frame`
_now = [1_000_000_000_000, 1e3]  # ns, s; read without a call of Python code
time.monotonic_ns = partial(_now.__getitem__, 0)  # type: ignore[assignment]  # before anything takes it
time.monotonic = partial(_now.__getitem__, 1)

import gc  # noqa: E402
import json  # noqa: E402
import os  # noqa: E402
import socket  # noqa: E402
from collections import Counter  # noqa: E402
from collections.abc import Iterator  # noqa: E402
from contextlib import AbstractContextManager, nullcontext, suppress  # noqa: E402
from dataclasses import replace  # noqa: E402
from itertools import chain, cycle, islice  # noqa: E402
from pathlib import Path  # noqa: E402
from types import FrameType  # noqa: E402
from typing import Any  # noqa: E402

import numpy as np  # noqa: E402

from edge.calibration import Calibration  # noqa: E402
from edge.config import Config, FeaturesTable  # noqa: E402
from edge.link import link_sink  # noqa: E402
from edge.link.params import PARAMS as LINK  # noqa: E402
from edge.link.sinks import CanFdSink  # noqa: E402
from edge.link.socketcan import SocketCanMedium  # noqa: E402
from edge.runtime.loop import Loop  # noqa: E402
from edge.sources.live import ThreadedSource  # noqa: E402
from edge.types import Clock, Feature, Frame  # noqa: E402
from tests.bench.marks import Marks  # noqa: E402

OWN = ("edge", "hostlink")


class Source(ThreadedSource):
    """A camera whose images the program itself gives to the loop."""

    def __init__(self, size_px: tuple[int, int]) -> None:
        super().__init__("images")
        self.size_px, self.rate_hz = size_px, 1e9 / PERIOD_NS
        self.start()

    def _work(self) -> None:
        self._closing.wait()

    def taken(self) -> None:
        """An image comes, and the loop takes it; with it time goes on."""
        _now[0] += PERIOD_NS
        self._last_s = _now[1] = _now[0] / 1e9


class Calls:
    """Counts, within `with`, calls of our Python functions, and from Python those of our compiled ones."""

    def __init__(self) -> None:
        self.python, self.kernel = Counter[str](), Counter[str]()
        compiled = (
            m for m in list(sys.modules.values()) if (getattr(m, "__file__", None) or "").endswith(".so")
        )
        self._kernels = {m.__name__ for m in compiled if m.__name__.startswith("edge.")}

    def __enter__(self) -> None:
        sys.setprofile(self._count)

    def __exit__(self, *_: object) -> None:
        sys.setprofile(None)

    def _count(self, frame: FrameType, event: str, called: Any) -> None:
        if event == "call":
            module = frame.f_globals.get("__name__", "")
            if module.partition(".")[0] in OWN:
                self.python[f"{module}.{frame.f_code.co_qualname}"] += 1
        elif event == "c_call":
            module = getattr(called, "__module__", None) or type(called.__self__).__module__
            if module in self._kernels:
                self.kernel[f"{module}.{called.__qualname__}"] += 1


def frames(images: np.ndarray, first: int) -> Iterator[Frame]:
    """All images, then from `first` on backwards and forwards, without a jump, for ever."""
    again = list(range(first, len(images)))
    begun_ns = int(_now[0]) - AGE_NS
    for n, at in enumerate(chain(range(first), cycle([*again, *again[-2:0:-1]])), start=1):
        yield Frame(images[at], begun_ns + n * PERIOD_NS, n, Clock.HOST)


def opened(source: Source, calibration: str, demand: frozenset[Feature]) -> tuple[Loop, socket.socket]:
    """The loop, and the other end of its bus."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for end in (ours, theirs):
        end.setblocking(False)
    link_sink.PARAMS = replace(LINK, read_s=WAIT_S)  # type: ignore[attr-defined]  # the module's own name
    sink = CanFdSink("can", lambda: SocketCanMedium(ours, Path("/dev/null")))
    config = Config(features=FeaturesTable(demand=tuple(demand)))
    return Loop(source, [sink], Calibration.load(Path(calibration)), config), theirs


def main(path: str, calibration: str, how: str, maps: str = "") -> None:
    with np.load(path) as stored:
        images, first = stored["images"], int(stored["first"])
        warm, counted = int(stored["warm"]), int(stored["counted"])
        demand = frozenset(Feature(str(name)) for name in stored["features"])
    sys.setswitchinterval(WAIT_S)
    source = Source((images.shape[2], images.shape[1]))
    loop, bus = opened(source, calibration, demand)
    gc.disable()
    shown = frames(images, first)

    def steps(n: int, context: AbstractContextManager[object]) -> None:
        some = list(islice(shown, n))
        with context:
            for frame in some:
                source.taken()
                loop.step(frame)
        assert [len(bus.recv(2 * SIZE)) for _ in some] == [SIZE] * n
        with suppress(BlockingIOError):
            bus.recv(2 * SIZE)
            raise AssertionError("more than one message for a frame")

    steps(first, nullcontext())
    how_to = Calls() if how == "calls" else Marks(maps)
    steps(warm, nullcontext())
    steps(counted, how_to)
    if isinstance(how_to, Calls):
        print(json.dumps({"python": how_to.python, "kernel": how_to.kernel}), flush=True)
    statistics = loop.statistics()
    assert not loop.faults.active, loop.faults.active
    assert statistics.full_searches_n == 1, "tracking is to be counted"
    os._exit(0)  # the sink's threads wait


if __name__ == "__main__":
    main(*sys.argv[1:])
