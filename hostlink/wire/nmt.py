"""A node's state as an NMT master sees and sets it (CiA 301, 7.2.8 and 7.3.2).

A node that boots is pre-operational; START and STOP make it operational and stopped, a reset boots it again.
"""

from enum import IntEnum
from typing import Final


class NmtState(IntEnum):
    """A node's state, as its heartbeat has it."""

    BOOT_UP = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


class NmtCommand(IntEnum):
    """A master's orders."""

    START = 1
    STOP = 2
    ENTER_PRE_OPERATIONAL = 128
    RESET_NODE = 129
    RESET_COMMUNICATION = 130


#: The state that each command leads to.
LEADS_TO: Final = {
    NmtCommand.START: NmtState.OPERATIONAL,
    NmtCommand.STOP: NmtState.STOPPED,
    NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
    NmtCommand.RESET_NODE: NmtState.BOOT_UP,
    NmtCommand.RESET_COMMUNICATION: NmtState.BOOT_UP,
}
