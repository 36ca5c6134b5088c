"""The calibration that a host has uploaded, on disk: the one in use, and the last good one beside it.

A file is stored only after it was tried on the tip. If it cannot be used at a start, the previous one is.
"""

import logging
from contextlib import suppress
from pathlib import Path

from edge.calibration import Calibration
from edge.errors import CalibrationError
from hostlink.output_file import find_unfinished

log = logging.getLogger(__name__)


class CalibrationStore:
    """Uploaded calibrations in the state folder: the one in use, and the one before."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.path = directory / "calibration.json"
        self.previous = directory / "calibration.previous.json"

    def load(self) -> list[Calibration]:
        """The files that can be read, the newest first: what a start tries in turn."""
        found = []
        for path in (self.path, self.previous):
            try:
                if path.is_file():
                    found.append(Calibration.load(path))
            except OSError as error:
                log.error("stored calibration: %s: %s; check whose folder it is", path, error.strerror)
            except CalibrationError as error:
                log.error("stored calibration: %s; upload the calibration of this tip again", error)
        return found

    def replace(self, calibration: Calibration) -> None:
        """Store a calibration that was tried; the one before is kept, also on OSError and OutputError."""
        with suppress(CalibrationError):  # there is none, or one that must not replace the last good one
            Calibration.load(self.path).save(self.previous, through_link=False)
        calibration.save(self.path, through_link=False)

    def clear_leftovers(self) -> None:
        """Remove the temporary files of interrupted writes; at the start, before another write."""
        for name in ("calibration.json", "calibration.previous.json", "settings.json"):
            for path in find_unfinished(self.directory / name):
                try:
                    if path.is_file() and not path.is_symlink():
                        path.unlink()
                except OSError as error:  # harmless but for the space it takes
                    log.warning("%s: %s", path, error.strerror)
