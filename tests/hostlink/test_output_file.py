"""No command destroys its input or an earlier result, and no file is ever seen half-written."""

from __future__ import annotations

import errno
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from hostlink.output_file import OutputError, WriteError, check_output, find_unfinished, writing
from tests.support.environment import uncounted


def test_new_file_is_allowed_and_nothing_is_left_by_the_check(tmp_path: Path) -> None:
    path = tmp_path / "tip.JSON"
    assert check_output(str(path), (".json",)) == path
    assert list(tmp_path.iterdir()) == []


def test_existing_file_is_refused_without_overwrite(tmp_path: Path) -> None:
    path = tmp_path / "tip.json"
    path.write_text("old")
    with pytest.raises(OutputError, match=r"tip\.json: exists already; .*--overwrite"):
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
    ],
)
def test_an_unusable_name_is_refused_with_a_usable_one(tmp_path: Path, name: str, what: str) -> None:
    (tmp_path / "folder.json").mkdir()
    (tmp_path / "file.json").touch()
    with pytest.raises(OutputError, match=what):
        check_output(tmp_path / name, (".json", ".yaml"), overwrite=True)


def test_device_is_refused() -> None:
    with pytest.raises(OutputError, match="device or a pipe"):
        check_output("/dev/null", (), overwrite=True)


def test_folder_that_takes_no_file_is_found_before_the_work() -> None:
    with pytest.raises(OutputError, match=r"/proc/x\.json: cannot be written: "):
        check_output("/proc/x.json", (".json",))


def test_file_appears_whole_and_only_at_the_end(tmp_path: Path) -> None:
    path = tmp_path / "a.b.json"
    with writing(path) as unfinished:
        assert unfinished.parent == tmp_path
        assert unfinished.suffix == ".json"
        unfinished.write_text("new")
        assert not path.exists()
        assert find_unfinished(path) == [unfinished]
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


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


def test_full_disk_is_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    met_by_a_library = OSError(errno.ENOSPC, "No space left on device")
    with pytest.raises(WriteError, match=r"x\.json: cannot be written: No space left on device$"):
        write_and_raise(tmp_path / "x.json", met_by_a_library)
    assert list(tmp_path.iterdir()) == []


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


def test_part_of_a_recording_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "x.log"
    with pytest.raises(WriteError):
        write_and_raise(path, OSError(errno.ENOSPC, "No space left on device"), keep_partial=True)
    assert path.read_text() == "half"
    assert list(tmp_path.iterdir()) == [path]


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


PROGRAM = """
import sys, click
from hostlink.cli_exit import run_command
from hostlink.output_file import check_output, writing

@click.command()
@click.argument("file")
def make(file):
    path = check_output(file, (".json",))
    with writing(path) as unfinished:
        unfinished.write_bytes(bytes(1 << 20))

sys.exit(run_command(make, "make", ()))
"""


def test_command_on_a_full_disk_ends_with_one_line_and_code_1(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(path)],
        env=uncounted(),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 16, 1 << 16)),
        capture_output=True,
        text=True,
        check=False,
    )
    assert (run.returncode, run.stderr) == (1, f"error: {path}: cannot be written: File too large\n")
    assert list(tmp_path.iterdir()) == []


def test_command_with_a_wrong_name_ends_with_one_line_and_code_2(tmp_path: Path) -> None:
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(tmp_path / "x.png")], capture_output=True, text=True, check=False
    )
    assert run.returncode == 2
    assert run.stderr == f"error: {tmp_path / 'x.png'}: the name must end in .json\n"
