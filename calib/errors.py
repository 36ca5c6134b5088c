"""What can go wrong while calibrating, and whose fault it is.

edge.errors.UsageError       the user's mistake: one line, exit code 2
├── RigError                     no such rig, out of its travel, or it reports a fault
├── ProtocolError                protocol file: unknown key, wrong type, empty
├── CaptureError                 recording: belongs to another protocol, cannot be resumed or written
├── TableError                   table of targets: no such file, column or frame, not a number
└── FitError                     too few rows, no spread, not monotone
"""

from __future__ import annotations

from edge.errors import UsageError


class RigError(UsageError):
    """The rig cannot do this."""


class ProtocolError(UsageError):
    """The protocol cannot be used."""


class CaptureError(UsageError):
    """The capture cannot be used or continued."""


class TableError(UsageError):
    """The table of targets cannot be used."""


class FitError(UsageError):
    """The data cannot support a calibration."""
