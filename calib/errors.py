"""The errors of calibration.

edge.errors.InputError       the user's mistake: one line, exit code 2
├── RigError                     no such rig, out of its travel, or it reports a fault
├── ProtocolError                protocol file: unknown key, wrong type, empty
├── CaptureError                 recording: belongs to another protocol, cannot be resumed or written
├── TableError                   table of targets: no such file, column or frame, not a number
└── FitError                     too few rows, no spread, not monotone
"""

from edge.errors import InputError


class RigError(InputError):
    """The rig cannot do this."""


class ProtocolError(InputError):
    """The protocol cannot be used."""


class CaptureError(InputError):
    """The capture cannot be used or continued."""


class TableError(InputError):
    """The table of targets cannot be used."""


class FitError(InputError):
    """The data cannot support a calibration."""
