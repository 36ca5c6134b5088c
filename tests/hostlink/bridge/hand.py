"""A hand whose fingers send what a test says, and a bridge that carries it."""

import threading
from collections.abc import Callable, Sequence

import hostlink
from hostlink.bridge.run import Bridge, Outlet
from hostlink.wire import State
from tests.hostlink.test_client import Application, make_node
from tests.support.waiting import SOON_S, until


class Hand:
    """Nodes on a virtual bus; their samples repeat until `close`, so that who comes late sees some."""

    def __init__(self, bus: str, fingers: Sequence[int], state: Callable[[int, int], State]) -> None:
        self.applications: dict[int, Application] = {}
        self._nodes = {}
        for number in fingers:
            self._nodes[number], self.applications[number] = make_node(f"virtual:{bus}?node={number}")
        self._state = state
        self._stop = threading.Event()
        self.connection = hostlink.connect(f"virtual:{bus}")
        self._thread = threading.Thread(target=self._send)
        self._thread.start()
        self._bridge: tuple[Bridge, threading.Thread, Sequence[Outlet]] | None = None

    def _send(self) -> None:
        k = 0
        while not self._stop.wait(0.004):
            for number, node in self._nodes.items():
                node.send(self._state(number, k))
            k += 1

    def bridge(self, *outlets: Outlet) -> Bridge:
        bridge = Bridge(self.connection, outlets)
        thread = threading.Thread(target=bridge.run)
        thread.start()
        self._bridge = bridge, thread, outlets
        until(lambda: len(self.connection.fingers) == len(self._nodes), "all fingers heard")
        return bridge

    def close(self) -> None:
        if self._bridge is not None:
            bridge, thread, outlets = self._bridge
            bridge.stop()
            thread.join(SOON_S)
            for outlet in outlets:
                outlet.close()
        self._stop.set()
        self._thread.join(SOON_S)
        self.connection.close()
        for node in self._nodes.values():
            node.close()
