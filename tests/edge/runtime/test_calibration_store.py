"""Files in a finger's state folder, and the removal of leftovers."""

import signal
from pathlib import Path

from edge.runtime.calibration_store import CalibrationStore
from tests.support.processes import python

#: Killed, like by a loss of power, when the new content is on the disk and the name does not point to it yet.
CUT_OFF = """
import os, signal, sys
from hostlink.output_file import writing
os.fsync = lambda number: os.kill(os.getpid(), signal.SIGKILL)
with writing(sys.argv[1], overwrite=True) as unfinished:
    unfinished.write_bytes(b"new")
"""


def test_only_leftovers_of_interrupted_uploads_are_removed(tmp_path: Path) -> None:
    calibration = tmp_path / "calibration.json"
    calibration.write_bytes(b"old")
    other = "x.calibration.abcdefgh.part.json"
    for name in (".calibration.part.json", ".calibration.json.bak", other, "settings.json"):
        (tmp_path / name).write_text("theirs")
    (tmp_path / ".calibration.afolder_.part.json").mkdir()
    (tmp_path / ".calibration.linked__.part.json").symlink_to(calibration)
    kept = sorted(tmp_path.iterdir())
    assert python("-c", CUT_OFF, calibration).returncode == -signal.SIGKILL
    assert len(list(tmp_path.iterdir())) == len(kept) + 1
    CalibrationStore(tmp_path).clear_leftovers()
    assert sorted(tmp_path.iterdir()) == kept
    assert calibration.read_bytes() == b"old"
