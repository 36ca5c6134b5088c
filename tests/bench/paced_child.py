"""The process that `paced` measures: the running loop, and as little else as possible.

    python -m tests.bench.paced_child '{"frames": "frames.npy", "seconds": 60, ...}'

Frames come from a file of images through the paced source, samples leave through a CANopen node as CAN FD
frames of the kernel. In place of a CAN interface, which few machines for benchmarks have, a local socket
takes them, and a listener counts them. One JSON object on stdout at the end.
"""

import json
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from edge.runtime.process import limit_resources

limit_resources()

import numpy as np  # noqa: E402

from edge.calibration import Calibration  # noqa: E402
from edge.link.link_sink import SinkCounters  # noqa: E402
from edge.link.node import Node  # noqa: E402
from edge.link.sinks import CanFdSink  # noqa: E402
from edge.link.socketcan import SocketCanMedium  # noqa: E402
from edge.runtime.device import LoopDevice  # noqa: E402
from edge.runtime.loop import Loop  # noqa: E402
from edge.sources.paced import Paced  # noqa: E402
from edge.types import Clock, Frame, Lens, Polarity, Region  # noqa: E402
from edge.worker.client import WorkerClient  # noqa: E402
from edge.worker.params import WorkerConfig  # noqa: E402
from hostlink.web import parse_listen  # noqa: E402
from hostlink.wire import State, unpack_state  # noqa: E402
from tests.support.processes import cpu_s, memory_mb  # noqa: E402

NO_CARRIER = Path("/sys/class/net/paced/carrier")  # looked at when a bus is off; ours never is
LISTEN_S = 0.05


class Images:
    """Images of a file: the first ones until the loop has its rest frame, then the others, again and again.

    tared  whether it has
    """

    live = False
    polarity = Polarity.FOUND
    region: Region | None = None
    lens: Lens | None = None
    dropped_n = 0
    name = "images"

    def __init__(self, images: np.ndarray, rest_n: int, rate_hz: float, frames_max: int) -> None:
        self.size_px = (images.shape[2], images.shape[1])
        self.rate_hz = rate_hz
        self._images = images
        self._rest_n = rest_n
        self._frames_max = frames_max
        self.tared: Callable[[], bool] = lambda: False

    def __iter__(self) -> Iterator[Frame]:
        n = len(self._images) - self._rest_n
        begun = 0
        for k in range(self._frames_max):
            begun = begun or (k if self.tared() else 0)
            at = self._rest_n + (k - begun) % n if begun else k % self._rest_n
            yield Frame(self._images[at], round(k * 1e9 / self.rate_hz), k, Clock.HOST)

    def close(self) -> None:
        """Nothing to close."""


class Meter:
    """A last sink: age of each sample when all others have taken it, from the tare on."""

    name = "meter"
    up = True

    def __init__(self, size: int, loop: Loop) -> None:
        self._loop = loop
        self.age_us = np.zeros(size, dtype=np.float32)
        self.n = self.tare_dropped_n = 0
        self.first_s = self.values_s = self.cpu_s = self.since_s = 0.0

    @property
    def counters(self) -> SinkCounters:
        return SinkCounters(sent=self.n)

    def send(self, state: State) -> bool:
        if self._loop.measurement.last is None:  # no rest frame yet
            self.cpu_s, self.since_s = time.process_time(), time.monotonic()
            self.first_s = self.first_s or self.since_s
            self.tare_dropped_n = self._loop.source.dropped_n
            return True
        self.values_s = self.values_s or time.monotonic()
        if self.n < len(self.age_us):
            self.age_us[self.n] = time.monotonic_ns() / 1e3 - state.capture_time_us
        self.n += 1
        return True

    def drain(self, timeout_s: float) -> bool:
        return True

    def close(self) -> None:
        """Nothing to close."""


class Listener:
    """Counts all that arrives on the bus, and the gaps in it."""

    def __init__(self, bus: socket.socket) -> None:
        self._bus = SocketCanMedium(bus, NO_CARRIER)
        self._done = threading.Event()
        self.samples_n = 0
        self.gaps_n = 0
        self.cpu_s = 0.0
        self._last = -1
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        with suppress(*SocketCanMedium.broken):  # the finger has closed its end
            while not self._done.wait(LISTEN_S):
                self._take()
            self._take()
        self.cpu_s = time.thread_time()

    def _take(self) -> None:
        while (frame := self._bus.read(0.0)) is not None:
            if not frame.fd:
                continue
            number = unpack_state(frame.data).sample
            if self._last >= 0:
                self.gaps_n += (number - self._last - 1) % 65536
            self._last = number
            self.samples_n += 1

    def close(self) -> None:
        self._done.set()
        self._thread.join()
        self._bus.close()


class Weights:
    """Resident memory over time, MB."""

    EVERY_S = 5.0

    def __init__(self) -> None:
        self.mb: list[float] = []
        self.pss_mb = 0.0  # last measured
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._done.wait(self.EVERY_S):
            self.mb.append(memory_mb())
            self.pss_mb = memory_mb(kind="Pss")

    def close(self) -> None:
        self._done.set()
        self._thread.join()


def on_a_bus(loop: Loop, number: int) -> tuple[Node, Listener]:
    """The loop as a node, and who listens to it."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for end in (ours, theirs):
        end.setblocking(False)
    sink = CanFdSink("paced", lambda: SocketCanMedium(ours, NO_CARRIER), number)
    return Node(sink, LoopDevice(loop, "bench")), Listener(theirs)


@contextmanager
def beside(loop: Loop, viewers_n: int, record: str, seconds: float) -> Iterator[WorkerClient | None]:
    """The page's process, viewers that read all that they are sent, and a recording, if they are wanted."""
    if not viewers_n and not record:
        yield None
        return
    worker = WorkerClient(loop, WorkerConfig(parse_listen("127.0.0.1:0"), Path(record) if record else None))
    worker.start()
    page = worker.url.partition("#")[0] + "live"
    look = ["tests.support.viewers", page, str(viewers_n), str(seconds)]
    # Browsers run on another machine: they must not take the loop's processor.
    with subprocess.Popen(["nice", "-n", "19", sys.executable, "-m", *look]) as viewers:
        yield worker
        viewers.terminate()
    worker.close()


def main(options: dict[str, Any]) -> dict[str, Any]:
    """Run, and report the measurements."""
    if options.get("realtime"):  # as in deploy/realtime.conf
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(40))
    rate_hz, seconds = float(options.get("rate_hz", 240.0)), float(options["seconds"])
    images = np.load(options["frames"], mmap_mode="r")  # of all fingers the same memory
    n = round(seconds * rate_hz) + options["rest_n"]
    shown = Images(images, options["rest_n"], rate_hz, n)
    source = Paced(shown, rate_hz)
    loop = Loop(source, [], Calibration.load(options["calibration"]))
    shown.tared = lambda: loop.measurement.last is not None
    node, listener = on_a_bus(loop, options.get("node", 1))
    meter = Meter(n, loop)
    loop.sinks += [node, meter]
    weights = Weights()
    with beside(loop, options.get("viewers", 0), options.get("record", ""), seconds) as worker:
        statistics = loop.run()
        page: dict[str, float] = {}
        if worker is not None and worker.process is not None:
            page["unrecorded"] = worker.recording.dropped_n
            page["page_cpu_share"] = cpu_s(worker.process.pid) / seconds
            page["page_rss_mb"] = memory_mb(worker.process.pid)
    ended_s, used_s = time.monotonic(), time.process_time()
    weights.close()
    rss_mb = memory_mb()
    node.close()
    listener.close()
    age_us = meter.age_us[1 : meter.n]  # the first one was delayed by freeing the tare's memory
    p50, p99, p999 = np.percentile(age_us, (50, 99, 99.9))
    return {
        "frames_offered": source.received_n, "dropped_at_tare": meter.tare_dropped_n,
        "dropped_after": statistics.dropped_n - meter.tare_dropped_n,
        "frames_accepted": statistics.frames_n, "keepalives": statistics.keepalives_n,
        "samples_sent": node.counters.sent, "samples_received": listener.samples_n, "gaps": listener.gaps_n,
        "p50_us": float(p50), "p99_us": float(p99), "p999_us": float(p999), "max_us": float(age_us.max()),
        "cpu_share": (used_s - listener.cpu_s - meter.cpu_s) / (ended_s - meter.since_s),
        "startup_s": meter.first_s - options["started_s"],
        "values_s": meter.values_s - options["started_s"],
        "rss_mb": rss_mb, "rss_first_mb": weights.mb[0] if weights.mb else rss_mb,
        "pss_mb": weights.pss_mb, "frames_mb": images.nbytes / 2**20, **page,
    }  # fmt: skip


if __name__ == "__main__":
    print(json.dumps(main(json.loads(sys.argv[1]))))
