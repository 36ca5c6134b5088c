"""The fingertip's own computer: camera frames in, tactile features out on a bus.

    from edge import Fingertip, open_source

    tip = Fingertip(untouched, "tip.json")            # a few images of the untouched tip
    touch = tip.read(image, time_s)
    touch.reading.values["displacement_mm"]           # calibrated, by name; touch.reading.sigmas too
    touch.features.contacts, touch.tracks.xy_img      # in px, without a calibration

    Fingertip         image in, features out, without a bus (`edge.fingertip`)
    open_source       frames of a camera, recording, video, folder or simulator, by its address
    Calibration       a calibration file; `Calibration.load(path)`
    Result and parts  what `read` gives: Tracks, Features, ContactRegion, Reading (`edge.types`)
    EdgeError         all errors of this package; TareRefused, SourceError and CalibrationError are some

These names stay as they are within a major version. They are imported when they are first used, so that the
running finger loads nothing that it does not need.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from edge.calibration import Calibration
    from edge.errors import CalibrationError, EdgeError, SourceError
    from edge.fingertip import Fingertip
    from edge.rest.tare import TareRefused
    from edge.sources import open_source
    from edge.types import ContactRegion, Features, Frame, Reading, Result, Tracks

_MODULES = {
    "Calibration": "calibration",
    "CalibrationError": "errors",
    "ContactRegion": "types",
    "EdgeError": "errors",
    "Features": "types",
    "Fingertip": "fingertip",
    "Frame": "types",
    "Reading": "types",
    "Result": "types",
    "SourceError": "errors",
    "TareRefused": "rest.tare",
    "Tracks": "types",
    "open_source": "sources",
}

__all__ = [
    "Calibration",
    "CalibrationError",
    "ContactRegion",
    "EdgeError",
    "Features",
    "Fingertip",
    "Frame",
    "Reading",
    "Result",
    "SourceError",
    "TareRefused",
    "Tracks",
    "open_source",
]

if not TYPE_CHECKING:  # or a type checker would take any name for one of ours

    def __getattr__(name: str) -> object:
        """A public name, imported now."""
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = globals()[name] = getattr(import_module(f"edge.{_MODULES[name]}"), name)
        return value
