"""The errors of the edge, and who can correct them.

    EdgeError
    ├── InputError           the user's mistake: one line, exit code 2
    │   ├── ConfigError          edge.toml: unknown key, wrong type, out of range
    │   ├── CalibrationError     calibration file: unreadable, wrong version, another sensor's
    │   ├── SourceError          no such camera, recording or image
    │   └── SinkError            no such bus or serial port
    ├── NoPins               the image shows no pin pattern (black, white, out of focus, not a tip)
    ├── RequestRefused       a host's or viewer's request that cannot be met now
    └── DegenerateLayout     fewer than 3 visible pins, or all on a line

Every message says what is wrong, where (file and key, argument, device) and what would be right.
Faults of a running system (camera stalled, bus off, pins lost) are not exceptions: they are status
bits and counters, and the loop goes on.
"""


class EdgeError(Exception):
    """Root of this package's own errors."""


class InputError(EdgeError):
    """Input that the user can correct."""


class ConfigError(InputError):
    """The configuration file cannot be used."""


class CalibrationError(InputError):
    """The calibration file cannot be used."""


class SourceError(InputError):
    """The camera, recording or image cannot be used."""


class SinkError(InputError):
    """The bus or serial port cannot be used."""


class RequestRefused(EdgeError):
    """A request is refused now: a rest frame while something touches the tip, or while one is being taken."""


class NoPins(EdgeError):
    """The image shows no pattern of pins."""


class DegenerateLayout(EdgeError):
    """The pins do not span a plane: fewer than three, or all on a line."""
