"""Fingers without a camera: nodes whose samples and answers a test sets."""

import socket
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from typing import Any, Self

import pytest

from edge.errors import CalibrationError, RequestRefused
from edge.link.node import Node
from edge.link.settings import SettingsFile
from edge.link.sinks import CanSink, SerialSink, open_sink
from hostlink import RestFrameOutcome, RestFrameState
from hostlink.wire import FaultCode, State
from tests.support.waiting import SOON_S


def free_port(kind: socket.SocketKind = socket.SOCK_DGRAM) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("", 0))
        return int(probe.getsockname()[1])


def need_multicast() -> None:
    """Skip where the machine has no network interface that carries multicast, not even to itself."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            group = socket.inet_aton("239.0.0.7") + socket.inet_aton("0.0.0.0")
            probe.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group)
        except OSError as error:
            # A container without a network has no multicast; nothing of the program can be tried with it.
            pytest.skip(f"UDP multicast does not work on this machine: {error}")


class Application:
    """The application of a node in these tests: it records the node's calls."""

    def __init__(self, serial: str) -> None:
        self.serial, self.touched, self.calibration = serial, False, b""
        self.calibration_id = "c0ffee"
        self.tares: list[bool] = []
        self.no_calibration = ""  # why none is taken
        self.requests_n = 0
        self.outcome = RestFrameOutcome(RestFrameState.ACCEPTED)  # of the next requests
        self.busy_for_n = 0  # number of polls before it is known
        self.features: frozenset[str] = frozenset()
        self.faults: dict[FaultCode, bool] = {}
        self.reboots = 0

    def describe(self) -> Mapping[str, int | float | str | bytes]:
        identity = {"serial_number": self.serial, "calibration_id": self.calibration_id}
        return identity | {"software_version": "0.1", "hardware_version": "test"}

    def rest_frame(self) -> Mapping[str, int | float | str | bytes]:
        busy = self.busy_for_n > 0
        self.busy_for_n -= 1
        return {
            "rest_frame_request_n": self.requests_n,
            "rest_frame_state": RestFrameState.BUSY if busy else self.outcome.state,
            "rest_frame_reason": self.outcome.reason,
            "rest_frame_message": self.outcome.message,
        }

    def clock_us(self) -> int | None:
        return time.monotonic_ns() // 1000

    def tare(self, force: bool) -> None:
        if self.touched and not force:
            raise RequestRefused("something touches the tip; let go, or force the tare")
        self.tares.append(force)
        self.requests_n += 1

    def calibration_bytes(self) -> bytes:
        return self.calibration

    def upload_calibration(self, data: bytes) -> None:
        if self.no_calibration:
            raise CalibrationError(self.no_calibration)
        self.calibration = data
        self.requests_n += 1

    def set_features(self, names: frozenset[str]) -> None:
        self.features = names

    def reboot(self) -> None:
        self.reboots += 1

    def report(self, code: FaultCode, active: bool, message: str = "") -> None:
        self.faults[code] = active


def state(sample: int, age_s: float = 0.0, **values: Any) -> State:
    """Captured 3 ms before it is sent; its displacement is its number, unless `values` say otherwise."""
    now_us = time.monotonic_ns() // 1000 - round(age_s * 1e6)
    given: dict[str, Any] = {"latency_us": 3000.0, "displacement_mm": sample / 100} | values
    return State(sample=sample, capture_time_us=now_us - 3000, **given)


def make_node(address: str) -> tuple[Node, Application]:
    sink = open_sink(address)
    assert isinstance(sink, CanSink | SerialSink)
    application = Application(f"VT-{address[-1]}")
    return Node(sink, application, SettingsFile()), application


@contextmanager
def node_at(address: str) -> Iterator[tuple[Node, Application]]:
    """A finger's node until the block ends."""
    node, application = make_node(address)
    with closing(node):
        yield node, application


class Fingers:
    """Nodes that send, again and again until `close`, so that who comes late sees some samples.

    state    of a finger's number and a count
    running  cleared: they are silent
    """

    def __init__(
        self,
        bus: str,
        numbers: Iterable[int] = (1,),
        state: Callable[[int, int], State] = lambda n, k: state(k),
    ) -> None:
        query = "&" if "?" in bus else "?"
        made = {number: make_node(f"{bus}{query}node={number}") for number in numbers}
        self.nodes = {number: node for number, (node, _) in made.items()}
        self.applications = {number: application for number, (_, application) in made.items()}
        self.running = threading.Event()
        self.running.set()
        self._state = state
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._send, daemon=True)
        self._thread.start()

    def _send(self) -> None:
        k = 0
        while not self._stop.wait(0.005):
            for number, node in self.nodes.items():
                if self.running.is_set():
                    node.send(self._state(number, k))
            k += 1

    def close(self) -> None:
        self._stop.set()
        self._thread.join(SOON_S)
        for node in self.nodes.values():
            node.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
