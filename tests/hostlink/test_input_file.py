"""No command waits for a file that does not end, or reads one that fills the memory."""

import os
import socket
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calib.capture import read_rows
from calib.errors import ProtocolError, RigError, TableError
from calib.protocols import load_protocol
from calib.rig.simulated import load_simulation
from calib.rig.stage import load_stage
from calib.targets import read_targets
from edge.calibration import Calibration
from edge.config import load_config
from edge.errors import CalibrationError, ConfigError, InputError, SourceError
from edge.link.settings import NodeSettings, SettingsFile
from edge.recording.reader import RecordingSource
from edge.runtime.calibration_store import CalibrationStore
from edge.sensors import load_sensor
from edge.sources import open_source
from edge.sources.files import read_image
from edge.sources.lens_file import load_lens
from hostlink.commands.plot import read_series
from hostlink.errors import LogError, UsageError
from hostlink.finger import read_upload
from hostlink.input_file import InputFileError, open_input, read_bounded
from hostlink.recording import decode_recording
from hostlink.web import WebError, find_token
from tests.support.processes import program
from tests.support.refusals import one_line


def all_of(read: Callable[[Path], Any]) -> Callable[[Path], Any]:
    return lambda path: list(read(path))


READERS: dict[str, tuple[Callable[[Path], Any], type[Exception]]] = {
    "config.toml": (load_config, ConfigError),
    "lens.toml": (load_lens, SourceError),
    "sensor.toml": (lambda path: load_sensor(str(path)), ConfigError),
    "simulation.toml": (load_simulation, RigError),
    "stage.toml": (lambda path: load_stage(str(path)), RigError),
    "protocol.toml": (lambda path: load_protocol(str(path)), ProtocolError),
    "image.png": (read_image, SourceError),
    "images.png": (lambda path: open_source(str(path)), SourceError),
    "video.avi": (lambda path: open_source(str(path)), SourceError),
    "touch.mcap": (all_of(RecordingSource), SourceError),
    "series.mcap": (read_series, LogError),
    "bus.log": (all_of(decode_recording), LogError),
    "bus.blf": (all_of(decode_recording), LogError),
    "line.serial": (all_of(decode_recording), LogError),
    "tip.json": (Calibration.load, CalibrationError),
    "upload.json": (read_upload, UsageError),
    "targets.csv": (lambda path: read_targets(path, path.parent), TableError),
    "press.csv": (lambda path: read_rows(path.with_suffix(".mcap")), InputError),
    "token.txt": (lambda path: find_token(None, path, "--token-file"), WebError),
}


def make_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as listener:
        os.chdir(path.parent)  # the name of a socket may have 108 bytes
        listener.bind(path.name)


def make_sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(30 << 30)


KINDS: dict[str, Callable[[Path], None]] = {
    "a pipe": os.mkfifo,
    "a socket": make_socket,
    "a link to a device": lambda path: path.symlink_to("/dev/zero"),
    "a folder": Path.mkdir,
    "30 GB of nothing": make_sparse,
    "a link to itself": lambda path: path.symlink_to(path),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", READERS)
def test_whatever_is_no_file_is_refused_in_one_line(
    tmp_path: Path, name: str, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    read, refused = READERS[name]
    path = tmp_path / name
    KINDS[kind](path)
    if name == "press.csv":
        (tmp_path / "press.mcap").touch()
    message = one_line(refused, read, path)
    assert path.stem in message
    assert len(message) < 400 + len(str(path))


@pytest.mark.parametrize("kind", KINDS)
def test_no_stored_file_stops_a_finger(tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    store = CalibrationStore(tmp_path)
    for path in (tmp_path / "settings.json", store.path, store.previous):
        KINDS[kind](path)
    assert SettingsFile(tmp_path / "settings.json").values == NodeSettings()
    assert store.load() == []


def test_pipes_that_a_program_was_started_with_are_read(tmp_path: Path) -> None:
    """As `program /dev/stdin`, `program <(other)`: the shell names what is open already."""
    code = (
        "import sys; from hostlink.input_file import read_bounded; print(len(read_bounded(sys.argv[1], 100)))"
    )
    (tmp_path / "content").write_text("x" * 50)
    for command in ('"$@" /dev/stdin < content', 'cat content | "$@" /dev/stdin', '"$@" <(cat content)'):
        words = ("bash", "-c", command, "bash", sys.executable, "-c", code)
        done = program(*words, cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])})
        assert (done.stdout, done.stderr) == ("50\n", ""), command


def test_a_link_to_a_file_is_read_up_to_the_limit(tmp_path: Path) -> None:
    file, link = tmp_path / "file", tmp_path / "link"
    file.write_bytes(b"x" * 2048)
    link.symlink_to(file)
    assert len(read_bounded(link, 2048)) == 2048
    with pytest.raises(InputFileError, match="larger than 1 KiB"):
        read_bounded(link, 1024)
    with open_input(link) as opened:
        assert opened.read(3) == b"xxx"


def test_any_name_of_an_image_has_its_place_in_a_folder(tmp_path: Path) -> None:
    import cv2

    names = ("1²3.png", "²", "1", "٣", "½", "Ⅷ", "9" * 240, "frame_2", "frame_10")
    for name in names:
        (tmp_path / f"{name.removesuffix('.png')}.png").write_bytes(
            cv2.imencode(".png", np.zeros((16, 16), np.uint8))[1].tobytes()
        )
    source = open_source(str(tmp_path))
    order = [path.stem for path in source.paths]  # type: ignore[attr-defined]
    assert len(order) == len(names)
    assert order.index("frame_2") < order.index("frame_10")
    assert order.index("1") < order.index("٣")
    assert len(list(source)) == len(names)
