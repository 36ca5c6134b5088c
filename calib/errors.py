"""What can go wrong while calibrating, and whose fault it is.

edge.errors.UsageError       the user's mistake: one line, exit code 2
├── RigError                     no such rig, out of its travel, or it reports a fault
├── ProtocolError                protocol file: unknown key, wrong type, empty
└── CaptureError                 recording: belongs to another protocol, cannot be resumed or written
"""

from __future__ import annotations

from edge.errors import UsageError


class RigError(UsageError):
    """The rig cannot do this."""


class ProtocolError(UsageError):
    """The protocol cannot be used."""


class CaptureError(UsageError):
    """The capture cannot be used or continued."""
