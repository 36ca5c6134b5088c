"""The errors of the wire. Noise on the wire is counted by the decoder, not raised.

    LinkError                root of hostlink's own errors (see hostlink.errors)
    ├── WireError
    │   ├── CorruptFrame         length, CRC or content of one frame is wrong
    │   ├── VersionMismatch      the two ends were built from different tables; names both
    │   └── ObjectAborted        the node refused an object access; carries the CiA 301 abort code
    └── ...                      hostlink.errors

Misuse of this API (a value of the wrong type, 5 contacts, node id 200) raises ValueError or TypeError.
"""

from __future__ import annotations

__all__ = ["CorruptFrame", "LinkError", "ObjectAborted", "VersionMismatch", "WireError"]


class LinkError(Exception):
    """Root of hostlink's own errors."""


class WireError(LinkError):
    """Received data cannot be used."""


class CorruptFrame(WireError):
    """One frame is damaged. The decoder catches and counts it."""


class VersionMismatch(WireError):
    """The sender's frame layout is not ours.

    ours, theirs  layout versions; equal when only the tables differ (a development build)
    our_id, their_id  ids of the two schemas: 16 bits, 8 on classic CAN; 32 in the identity object
    node          number of the sensor
    """

    def __init__(self, ours: int, theirs: int, our_id: int, their_id: int, node: int) -> None:
        super().__init__(
            f"finger {node} speaks wire version {theirs} (schema 0x{their_id:04x}), this host speaks "
            f"version {ours} (schema 0x{our_id:04x}): install the same voronoi-touch release on both ends"
        )
        self.ours = ours
        self.theirs = theirs
        self.our_id = our_id
        self.their_id = their_id
        self.node = node


class ObjectAborted(WireError):
    """The node refused to read or write an object.

    name    of the object, "" if it is in none of our tables
    code    CiA 301 SDO abort code, see `objects.ABORTS`
    reason  as text: the node's own if it gave one
    """

    def __init__(self, index: int, sub: int, code: int, reason: str, name: str = "") -> None:
        place = f"object 0x{index:04X}:{sub}"
        super().__init__(f"{name or place}: {reason} ({place}, abort code 0x{code:08X})")
        self.index = index
        self.sub = sub
        self.code = code
        self.reason = reason
        self.name = name
