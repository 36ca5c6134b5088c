"""No command destroys its input or an earlier result, and no file is ever seen half-written."""

import errno
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

import hostlink.output_file
from edge.calibration import Calibration
from edge.link.settings import SettingsFile
from edge.runtime.calibration_store import CalibrationStore
from hostlink.interrupt import ENDING
from hostlink.output_file import OutputError, WriteError, check_output, find_unfinished, writing
from tests.hostlink.test_input_file import make_socket
from tests.support.processes import program, python, uncounted


def test_existing_file_is_refused_without_overwrite(tmp_path: Path) -> None:
    path = tmp_path / "tip.JSON"
    assert check_output(str(path), (".json",)) == path
    assert list(tmp_path.iterdir()) == []
    path.write_text("old")
    with pytest.raises(OutputError, match=r"tip\.JSON: exists already; .*--overwrite"):
        check_output(path, (".json",))
    assert check_output(path, (".json",), overwrite=True) == path
    assert path.read_text() == "old"


def test_input_is_refused_even_with_overwrite_and_under_another_name(tmp_path: Path) -> None:
    table = tmp_path / "targets.csv"
    table.write_text("truth")
    link = tmp_path / "link.csv"
    link.symlink_to(table)
    for name in (table, link, tmp_path / "." / "targets.csv"):
        with pytest.raises(OutputError, match="is an input of this command"):
            check_output(name, (), inputs=(table,), overwrite=True)


@pytest.mark.parametrize(
    ("name", "what"),
    [
        ("x.png", r"must end in \.json or \.yaml"),
        ("x", r"must end in \.json or \.yaml"),
        ("missing/x.json", "there is no folder"),
        ("folder.json", "is a folder"),
        ("file.json/x.json", "file.json is no folder"),
        ("/proc/x.json", r"/proc/x\.json: cannot be written: "),
        ("x" * 300 + ".json", "File name too long"),
    ],
)
def test_an_unusable_name_is_refused_with_a_usable_one(tmp_path: Path, name: str, what: str) -> None:
    (tmp_path / "folder.json").mkdir()
    (tmp_path / "file.json").touch()
    with pytest.raises(OutputError, match=what):
        check_output(tmp_path / name, (".json", ".yaml"), overwrite=True)
    with pytest.raises(OutputError, match="device or a pipe"):
        check_output("/dev/null", (), overwrite=True)


def write_and_raise(
    path: Path, error: BaseException, overwrite: bool = False, keep_partial: bool = False
) -> None:
    with writing(path, overwrite, keep_partial) as unfinished:
        unfinished.write_text("half")
        raise error


@pytest.mark.parametrize("error", [KeyboardInterrupt(), ValueError("of the block"), OSError("of the block")])
def test_error_leaves_the_old_file_and_nothing_else(tmp_path: Path, error: BaseException) -> None:
    path = tmp_path / "x.json"
    path.write_text("old")
    with pytest.raises(type(error)):
        write_and_raise(path, error, overwrite=True)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("keep_partial", [False, True])
def test_full_disk_is_one_line_and_leaves_nothing_but_a_recording(tmp_path: Path, keep_partial: bool) -> None:
    path, met_by_a_library = tmp_path / "x.json", OSError(errno.ENOSPC, "No space left on device")
    with pytest.raises(WriteError, match=r"x\.json: cannot be written: No space left on device$"):
        write_and_raise(path, met_by_a_library, keep_partial=keep_partial)
    assert [(one, one.read_text()) for one in tmp_path.iterdir()] == (
        [(path, "half")] if keep_partial else []
    )


def test_file_made_meanwhile_is_kept_and_so_is_ours(tmp_path: Path) -> None:
    path = tmp_path / "x.log"

    def write_while_another_does() -> None:
        with writing(path) as unfinished:
            unfinished.write_text("ours")
            path.write_text("theirs")

    with pytest.raises(WriteError, match="another program made it"):
        write_while_another_does()
    assert path.read_text() == "theirs"
    assert [p.read_text() for p in find_unfinished(path)] == ["ours"]


def test_mode_of_the_file_replaced_is_kept_and_a_link_stays_a_link(tmp_path: Path) -> None:
    target, link = tmp_path / "target.json", tmp_path / "link.json"
    target.write_text("old")
    target.chmod(0o640)
    link.symlink_to(target)
    with writing(link, overwrite=True) as unfinished:
        unfinished.write_text("new")
    assert link.is_symlink()
    assert target.read_text() == "new"
    assert target.stat().st_mode & 0o777 == 0o640


#: A link leads to one of these. Socket and pipe stand in for devices, which a failing test would destroy.
AIMS: dict[str, Callable[[Path], object]] = {
    "a file": lambda path: path.write_text("kept"),
    "nothing": lambda path: None,
    "a socket": make_socket,
    "a pipe": os.mkfifo,
}


@pytest.mark.parametrize("aim", AIMS)
def test_a_store_replaces_a_link_and_not_what_it_leads_to(
    tmp_path: Path, aim: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever may write into the state folder must not lead the finger to another file."""
    monkeypatch.chdir(tmp_path)
    aim_at = tmp_path / "aim"
    AIMS[aim](aim_at)
    folder = tmp_path / "state"
    folder.mkdir()
    store = CalibrationStore(folder)
    calibration = Calibration.load(Path(__file__).parents[1] / "data" / "rings331_ball.json")
    store.replace(calibration)
    for name in ("settings.json", "calibration.json", "calibration.previous.json"):
        (folder / name).unlink(missing_ok=True)
        (folder / name).symlink_to(aim_at)
    SettingsFile(folder / "settings.json").change(divider=3)
    store.replace(calibration)
    store.replace(calibration)
    assert all(not path.is_symlink() and path.is_file() for path in folder.iterdir())
    assert SettingsFile(folder / "settings.json").values.divider == 3
    assert len(store.load()) == 2
    assert aim_at.exists() == (aim != "nothing")
    assert not aim_at.is_file() or aim_at.read_text() == "kept"


@pytest.mark.parametrize("aim", ["a socket", "a pipe"])
@pytest.mark.parametrize("overwrite", [True, False])
def test_only_a_file_is_replaced(
    tmp_path: Path, aim: str, overwrite: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    aim_at = tmp_path / "aim"
    AIMS[aim](aim_at)
    link = tmp_path / "link.json"
    link.symlink_to(aim_at)
    for path in (link, aim_at):
        with pytest.raises(OutputError, match="give the name of a file"), writing(path, overwrite):
            pytest.fail("the work was begun")
    assert not aim_at.is_file()


def test_a_folder_of_another_user_is_one_line(tmp_path: Path) -> None:
    """As user nobody where the tests run as root, who may look into all."""
    folder = tmp_path / "state"
    folder.mkdir(mode=0o700)
    (folder / "settings.json").write_text("{}")
    for parent in (tmp_path, *tmp_path.parents):
        if parent.stat().st_uid == os.geteuid() and parent != Path("/"):
            parent.chmod(parent.stat().st_mode | 0o011)
    if os.geteuid():
        folder.chmod(0)
    code = f"""
import logging, os, sys
from pathlib import Path
from edge.cli.assembly import _state_directory
from edge.config import Config, StateTable
from edge.runtime.calibration_store import CalibrationStore
from edge.link.settings import NodeSettings, SettingsFile
from hostlink.interrupt import ENDING
from hostlink.output_file import OutputError, check_output
if not os.geteuid():
    os.setresgid(65534, 65534, 65534)
    os.setresuid(65534, 65534, 65534)
logging.basicConfig(format="%(message)s")
folder = Path({str(folder)!r})
_state_directory(Config(state=StateTable(directory=str(folder))))
settings, store = SettingsFile(folder / "settings.json"), CalibrationStore(folder)
store.clear_leftovers()
assert settings.values == NodeSettings() and store.load() == []
for write in (lambda: settings.change(divider=2), lambda: check_output(folder / "x.json", ())):
    try:
        write()
    except OutputError as error:
        print(error, file=sys.stderr)
"""
    run = python("-c", code, env=uncounted())
    lines = run.stderr.splitlines()
    assert (run.returncode, len(lines)) == (0, 5), run.stderr
    assert all(str(folder) in line and "Permission denied" in line for line in lines), run.stderr


ENDED = """
import os, sys, click
import hostlink.output_file
from hostlink.cli_exit import run_command
from hostlink.output_file import writing

@click.command()
@click.argument("number", type=int)
@click.argument("when")
@click.argument("file")
def make(number, when, file):
    def end(*_):
        os.kill(os.getpid(), number)
        os.kill(os.getpid(), number)  # the shell and the kernel both report a terminal's end
    if when == "while it gets its name":
        hostlink.output_file._force_to_disk = end
    if when == "while its folder is tried":
        remove = hostlink.output_file._remove
        hostlink.output_file._remove = lambda path: (end(), remove(path))
    hostlink.output_file.check_output(file, ())
    with writing(file, keep_partial=when == "a recording") as unfinished:
        unfinished.write_text("content")
        if when != "while it gets its name":
            end()

sys.exit(run_command(make, "make", ()))
"""


@pytest.mark.parametrize("number", ENDING)
@pytest.mark.parametrize(
    "when", ["while its folder is tried", "while it is written", "a recording", "while it gets its name"]
)
def test_a_signal_leaves_a_whole_file_or_none(tmp_path: Path, number: signal.Signals, when: str) -> None:
    path = tmp_path / "x.json"
    run = python("-c", ENDED, str(int(number)), when, path, env=uncounted())
    assert (run.returncode, run.stderr.strip()) == (128 + number, "")
    kept = [path] if when in ("a recording", "while it gets its name") else []
    assert list(tmp_path.iterdir()) == kept
    assert all(one.read_text() == "content" for one in kept)


@pytest.mark.parametrize("overwrite", [False, True])
def test_ctrl_c_at_any_instruction_leaves_a_whole_file_or_none(tmp_path: Path, overwrite: bool) -> None:
    """A recording that is kept half-way replaces an earlier one by something, never by nothing."""
    path, content = tmp_path / "x.json", {"old" if overwrite else None, "content"}
    for number in count():
        if overwrite:
            path.write_text("old")
        with interrupted_at(number) as came, suppress(KeyboardInterrupt):
            check_output(path, (".json",), overwrite=overwrite)
            with writing(path, overwrite, keep_partial=overwrite) as unfinished:
                unfinished.write_text("content")
        if not came:
            break
        assert {one.name for one in tmp_path.iterdir()} <= {path.name}
        assert (path.read_text() if path.exists() else None) in content
        path.unlink(missing_ok=True)
    assert number > 300
    assert path.read_text() == "content"


@contextmanager
def interrupted_at(number: int) -> Iterator[list[int]]:
    """Ctrl-C before this instruction of the module's, counted from the block's begin.

    The list stays empty if the block ends before.
    """
    numbers, came = count(), list[int]()

    def trace(frame: FrameType, event: str, argument: object) -> Any:
        if frame.f_code.co_filename != hostlink.output_file.__file__:
            return None
        frame.f_trace_opcodes = True
        if event == "opcode" and next(numbers) == number:
            came.append(number)
            signal.raise_signal(signal.SIGINT)
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        yield came
    finally:
        sys.settrace(before)


def test_a_program_under_nohup_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    command = ("nohup", sys.executable, "-c", ENDED, str(int(signal.SIGHUP)), "", path)
    assert program(*command, env=uncounted()).returncode == 0
    assert path.read_text() == "content"
