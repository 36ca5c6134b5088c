"""The node's state, as an NMT master sees and sets it (CiA 301, 7.2.8 and 7.3.2), and its heartbeat.

A node that boots is pre-operational; START and STOP make it operational and stopped, a reset boots it again.
"""

from collections.abc import Callable
from enum import IntEnum


class NmtState(IntEnum):
    """A node's state, as its heartbeat has it."""

    INITIALISING = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


class NmtCommand(IntEnum):
    """What a master may order."""

    START = 1
    STOP = 2
    ENTER_PRE_OPERATIONAL = 128
    RESET_NODE = 129
    RESET_COMMUNICATION = 130


_LEADS_TO = {
    NmtCommand.START: NmtState.OPERATIONAL,
    NmtCommand.STOP: NmtState.STOPPED,
    NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
    NmtCommand.RESET_NODE: NmtState.INITIALISING,
    NmtCommand.RESET_COMMUNICATION: NmtState.INITIALISING,
}


class Nmt:
    """State and heartbeat of one node.

    state   may be set
    send    sends the data of a boot-up message
    every   sends what a function makes each period, s, from now on; None ends it
    """

    def __init__(
        self, send: Callable[[bytes], None], every: Callable[[float, Callable[[], bytes] | None], None]
    ) -> None:
        self.state = NmtState.INITIALISING
        self._send, self._every = send, every

    def boot(self, heartbeat_ms: int) -> None:
        """Send the boot-up message, and be pre-operational, with heartbeat."""
        self.set_heartbeat(0)
        self.state = NmtState.INITIALISING
        self._send(self._data())
        self.state = NmtState.PRE_OPERATIONAL
        self.set_heartbeat(heartbeat_ms)

    def set_heartbeat(self, period_ms: int) -> None:
        """Send the state each period from now on; 0: not."""
        self._every(period_ms / 1000.0, self._data if period_ms else None)

    def command(self, number: int) -> NmtCommand | None:
        """Take a master's command; None: there is no such one."""
        try:
            command = NmtCommand(number)
        except ValueError:
            return None
        self.state = _LEADS_TO[command]
        return command

    def _data(self) -> bytes:
        return bytes((self.state,))
