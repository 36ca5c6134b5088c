"""The fingertip's own computer: camera frames in, tactile features out on a bus.

    from edge import Fingertip, open_source

    tip = Fingertip(untouched, "tip.json")            # a few images of the untouched tip
    touch = tip.read(image, time_s)                   # a `Result`, see `edge.types`
    touch.reading.values["displacement_mm"]           # calibrated, by name; touch.reading.sigmas too
    touch.features.contacts, touch.tracks.xy_img      # in px, without a calibration

`open_source` gives the frames of a camera, recording, video, folder or simulator. Each error is an EdgeError.
These names stay as they are within a major version, and are imported when they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from edge.calibration import Calibration
    from edge.errors import EdgeError
    from edge.fingertip import Fingertip
    from edge.sources import open_source
    from edge.types import Frame, Result

__all__ = ["Calibration", "EdgeError", "Fingertip", "Frame", "Result", "open_source"]

if not TYPE_CHECKING:  # or a type checker would take any name for one of ours
    _MODULES = ("calibration", "errors", "fingertip", "types", "types", "sources")

    def __getattr__(name: str) -> object:
        """A public name, imported now."""
        if name not in __all__:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(f"edge.{_MODULES[__all__.index(name)]}"), name)
