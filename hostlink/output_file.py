"""Output files of a command: one rule for the three programs.

    path = check_output("tip.json", (".json",), inputs=("targets.csv",), overwrite=overwrite)
    ...                                                       # the work
    with writing(path, overwrite=overwrite) as unfinished:
        unfinished.write_bytes(content)

Rules
- Never over an input of the same command, never over an existing file unless `--overwrite` was given, never
  with the suffix of another format. `check_output` checks that before any work is done, and
  also whether the folder is writable.
- A file appears under its name when it is complete: it is written beside it, as `.STEM.XXXXXXXX.part.SUFFIX`,
  synced to the disk and then renamed. On an error or a signal it is removed, unless a partial file is useful.
- Only a regular file is replaced. A link to one stays a link, where the user named it; a file whose name the
  program chose (a store's) replaces the link, so that nobody leads it elsewhere.
- `cli_exit.run_command` turns OutputError into one line and exit code 2, WriteError into exit code 1.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from hostlink.interrupt import interrupts_held

__all__ = ["OutputError", "WriteError", "check_output", "find_unfinished", "writing"]

_PROBE = bytes(4096)  # one block: an empty file fits on a full disk
_CANNOT_LINK = frozenset({errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK})
#: Errors of a write that are caused by the disk, in whatever library.
_DISK = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS})


class OutputError(Exception):
    """This file must not or cannot be written: one line: why, and what would be right."""


class WriteError(OutputError):
    """Writing failed half-way: the disk is full, or the folder disappeared."""


def check_output(
    path: str | Path, suffixes: Sequence[str], inputs: Iterable[str | Path] = (), overwrite: bool = False
) -> Path:
    """The path, if a command may write there. Call it before the work whose result goes there.

    suffixes   allowed ones with their dot, e.g. (".json",); empty: any
    inputs     files that the same command reads
    overwrite  whether the user allowed to replace an existing file
    Raises     OutputError
    """
    path = Path(path)
    if suffixes and path.suffix.lower() not in suffixes:
        raise OutputError(f"{path}: the name must end in {' or '.join(suffixes)}")
    try:
        _check_place(path, inputs, overwrite)
    except OSError as error:  # a name that is too long, a folder that may not be looked into
        raise _cannot(path, error) from None
    _try_folder(path)
    return path


def _check_place(path: Path, inputs: Iterable[str | Path], overwrite: bool) -> None:
    if path.is_dir():
        raise OutputError(f"{path}: is a folder; give the name of a file")
    if path.exists() and not path.is_file():
        raise OutputError(f"{path}: is a device or a pipe; give the name of a file")
    for other in inputs:
        if _is_same(path, Path(other)):
            raise OutputError(f"{path}: is an input of this command; give another name for the output")
    if os.path.lexists(path) and not overwrite:
        raise OutputError(f"{path}: exists already; give another name, or --overwrite to replace it")
    if path.parent.exists() and not path.parent.is_dir():
        raise OutputError(f"{path}: {path.parent} is no folder; give a name in one")
    if not path.parent.is_dir():
        raise OutputError(f"{path}: there is no folder {path.parent}")


@contextmanager
def writing(
    path: str | Path, overwrite: bool = False, keep_partial: bool = False, through_link: bool = True
) -> Iterator[Path]:
    """The name to write under; when the block ends without an error, the file gets the name `path`.

    overwrite     replace an existing file; else a file that another program made meanwhile stays, and this
                  one is kept beside it
    keep_partial  a file that is incomplete after an error is useful, like a recording: it gets its name, too
    through_link  replace what a link of this name leads to, not the link
    Raises     OutputError: the folder is not writable, or no file has this name; WriteError: the disk is full
               or broken (also if code within the block raised it)
    """
    path = Path(path)
    target = Path(os.path.realpath(path)) if through_link else path
    if _is_special(target):
        raise OutputError(f"{path}: is a folder, a device or a pipe; give the name of a file")
    unfinished = _unfinished_name(target)
    try:
        os.close(os.open(unfinished, os.O_WRONLY | os.O_CREAT | os.O_EXCL, _mode(target)))
        if _is_file(target):  # the mode above went through the umask
            unfinished.chmod(_mode(target))
        yield unfinished
        with interrupts_held():
            _force_to_disk(unfinished)
            _rename(unfinished, target, overwrite)
            _force_to_disk(target.parent)
    except OSError as error:
        _give_up(unfinished, target, overwrite, keep_partial)
        if error.errno in _DISK or error.filename in (str(unfinished), str(target.parent)):
            raise _cannot(path, error) from None
        raise
    except WriteError:  # kept on purpose, see `_rename`
        raise
    except BaseException:
        _give_up(unfinished, target, overwrite, keep_partial)
        raise


def find_unfinished(path: str | Path) -> list[Path]:
    """Temporary files of `writing(path)` that a loss of power or a kill left behind."""
    path = Path(path)
    length = len(_unfinished_name(path).name)
    return [p for p in path.parent.glob(f".{path.stem}.*.part{path.suffix}") if len(p.name) == length]


def _unfinished_name(path: Path) -> Path:
    """A name beside the file, hidden, with the same suffix: many libraries choose the format by it."""
    return path.with_name(f".{path.stem}.{os.urandom(4).hex()}.part{path.suffix}")


def _mode(path: Path) -> int:
    """Mode of the file that is replaced; of a new one what the umask leaves."""
    return path.stat().st_mode & 0o777 if _is_file(path) else 0o666


def _is_file(path: Path) -> bool:
    """Whether it is a regular file itself, and no link to one."""
    with suppress(OSError):
        return stat.S_ISREG(path.lstat().st_mode)
    return False


def _is_special(path: Path) -> bool:
    """Whether something is there that is neither a file nor a link."""
    with suppress(OSError):
        mode = path.lstat().st_mode
        return not (stat.S_ISREG(mode) or stat.S_ISLNK(mode))
    return False


def _is_same(path: Path, other: Path) -> bool:
    try:
        return path.samefile(other)
    except OSError:  # one of them does not exist
        return os.path.realpath(path) == os.path.realpath(other)


def _try_folder(path: Path) -> None:
    """Write and remove one block: permissions are not enough (read-only or full disk)."""
    probe = _unfinished_name(path)
    with interrupts_held():
        try:
            probe.write_bytes(_PROBE)
        except OSError as error:
            raise _cannot(path, error) from None
        finally:
            _remove(probe)


def _force_to_disk(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _rename(unfinished: Path, target: Path, overwrite: bool) -> None:
    if overwrite:
        unfinished.replace(target)
        return
    try:
        os.link(unfinished, target)  # unlike a rename, a link never replaces a file
    except FileExistsError:
        raise WriteError(f"{target}: another program made it meanwhile; this one's is {unfinished}") from None
    except OSError as error:
        if error.errno not in _CANNOT_LINK:
            raise
        if target.exists():
            raise WriteError(
                f"{target}: another program made it meanwhile; this one's is {unfinished}"
            ) from None
        unfinished.replace(target)
        return
    unfinished.unlink()


def _give_up(unfinished: Path, target: Path, overwrite: bool, keep: bool) -> None:
    """After an error, remove the partial file or give it its name, if there is anything in it."""
    with interrupts_held(), suppress(OSError, WriteError):  # then it stays beside the target
        if keep and unfinished.stat().st_size:
            _rename(unfinished, target, overwrite)
        else:
            unfinished.unlink()


def _remove(path: Path) -> None:
    with suppress(OSError):
        path.unlink()


def _cannot(path: Path, error: OSError) -> OutputError:
    """WriteError for a full or broken disk, OutputError for a folder that this user may not write to."""
    kind = WriteError if error.errno in _DISK else OutputError
    return kind(f"{path}: cannot be written: {error.strerror}")
