"""A hand whose fingers send what a test says, and a bridge that carries it."""

import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack

import hostlink
from hostlink.bridge.run import Bridge, Outlet
from hostlink.hand_file import HandFile
from hostlink.wire import State
from tests.support.fingers import Fingers
from tests.support.waiting import SOON_S, until


class Hand(Fingers):
    """Nodes on a virtual bus, a connection to it, and a bridge."""

    def __init__(
        self,
        bus: str,
        fingers: Sequence[int],
        state: Callable[[int, int], State],
        hand: HandFile | None = None,
    ) -> None:
        super().__init__(f"virtual:{bus}", fingers, state)
        self.connection = hostlink.connect(f"virtual:{bus}", hand=hand)
        self._end = ExitStack()

    def bridge(self, outlet: Outlet) -> None:
        bridge = Bridge(self.connection, (outlet,))
        thread = threading.Thread(target=bridge.run)
        thread.start()
        self._end.callback(outlet.close)
        self._end.callback(thread.join, SOON_S)
        self._end.callback(bridge.stop)
        until(lambda: len(self.connection.fingers) == len(self.nodes), "all fingers heard")

    def close(self) -> None:
        self._end.close()
        super().close()
        self.connection.close()
