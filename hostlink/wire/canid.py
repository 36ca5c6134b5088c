"""CAN identifiers: CiA 301's predefined connection set, with bases that can be moved.

11-bit identifiers, base + node id (1..127). On an FD bus the 64-byte state frame uses TPDO1's identifier,
because the classic parts are not sent there; the detail stream uses TPDO4's, the lowest priority of the
four. A receiver distinguishes them by length: 8 bytes are a classic part, 64 a state or detail frame.

Why bases that can be moved: other devices claim fixed identifiers (a force sensor in wide use sits on
CiA's TIME 0x100), and hands often number their joints from 0x180.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from enum import Enum
from functools import cached_property
from types import MappingProxyType

__all__ = ["CanIds", "Kind"]

NODES_MAX = 127


class Kind(Enum):
    """The kind of message of an identifier."""

    TPDO1 = "tpdo1"  # 8 bytes: classic part; otherwise: the state frame
    TPDO2 = "tpdo2"
    TPDO3 = "tpdo3"
    TPDO4 = "tpdo4"  # 8 bytes: classic part; otherwise: a segment of the detail stream
    EMERGENCY = "emergency"
    SDO_RESPONSE = "sdo_response"  # node to host
    SDO_REQUEST = "sdo_request"  # host to node
    HEARTBEAT = "heartbeat"


@dataclass(frozen=True)
class CanIds:
    """Bases of the identifiers, and the complete identifiers of NMT and SYNC. Defaults: CiA 301.

    Raises ValueError: a base out of range, or ranges of two kinds that overlap
    """

    tpdo1: int = 0x180
    tpdo2: int = 0x280
    tpdo3: int = 0x380
    tpdo4: int = 0x480
    emergency: int = 0x080
    sdo_response: int = 0x580
    sdo_request: int = 0x600
    heartbeat: int = 0x700
    nmt: int = 0x000
    sync: int = 0x080

    def __post_init__(self) -> None:
        taken: dict[int, str] = {self.nmt: "nmt"}
        if self.sync in taken:
            raise ValueError(f"CAN ids: sync and nmt are both 0x{self.sync:03X}")
        taken[self.sync] = "sync"
        for field in fields(self):
            base = getattr(self, field.name)
            if not 0 <= base <= 0x7FF - (0 if field.name in ("nmt", "sync") else NODES_MAX):
                raise ValueError(f"CAN ids: {field.name} 0x{base:X} leaves the 11-bit range for some node")
            if field.name in ("nmt", "sync"):
                continue
            for can_id in range(base + 1, base + 1 + NODES_MAX):
                if can_id in taken:
                    raise ValueError(
                        f"CAN ids: {field.name} and {taken[can_id]} both claim 0x{can_id:03X}; "
                        "move one base by a multiple of 0x80"
                    )
                taken[can_id] = field.name

    @cached_property
    def table(self) -> Mapping[int, tuple[Kind, int]]:
        """Every identifier of every node: identifier -> (kind, node id)."""
        nodes = range(1, NODES_MAX + 1)
        return MappingProxyType({self.of(kind, node): (kind, node) for kind in Kind for node in nodes})

    def of(self, kind: Kind, node: int) -> int:
        """The identifier. Raises ValueError: node outside 1..127."""
        if not 1 <= node <= NODES_MAX:
            raise ValueError(f"node id {node}: 1..{NODES_MAX} is possible")
        return int(getattr(self, kind.value)) + node

    def tpdo(self, number: int, node: int) -> int:
        """Identifier of TPDO 1..4: `tpdo(1, n)` is the state frame's and the first classic part's."""
        return self.of(Kind(f"tpdo{number}"), node)

    def state(self, node: int) -> int:
        """Identifier of the 64-byte state frame on CAN FD."""
        return self.of(Kind.TPDO1, node)

    def detail(self, node: int) -> int:
        """Identifier of the detail stream's segments on CAN FD."""
        return self.of(Kind.TPDO4, node)

    def kind_of(self, can_id: int) -> tuple[Kind, int] | None:
        """(kind, node id) of an identifier, or None if it is not ours."""
        return self.table.get(can_id)
