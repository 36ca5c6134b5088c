"""Input files of a command: only what ends by itself is opened, and no more is read than its reader can use.

    raw = read_bounded(path, 2 << 20)
    with open_input(path) as file: ...

Rules
- A regular file, also behind a link, or a pipe that the program was started with (`/dev/stdin`, `<(...)`). A
  named pipe might never be written to, a device never end, and reading some devices changes them.
- Every refusal is an OSError with the file's name and one line as `strerror`, like those of the system.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO

__all__ = ["BYTES_MAX", "DEPTH_MAX", "UPLOAD_BYTES", "InputFileError", "open_input", "read_bounded"]


UPLOAD_BYTES = 2 << 20  # a calibration, configuration or settings; a finger takes no more
BYTES_MAX = 160 << 20  # the largest that is read as a whole: an image of 21 million pixels of 8 bytes
DEPTH_MAX = 100  # of lists and tables in a file; ours have three


class InputFileError(OSError):
    """A file that cannot be what is wanted, whatever is in it."""


def open_input(path: str | Path) -> BinaryIO:
    """The file, to read bytes from. Raises InputFileError, OSError."""
    _check(path, os.stat(path))  # before it is opened: that alone changes some devices
    # Not waiting: meanwhile it might have become a pipe.
    handle = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        _check(path, os.fstat(handle))
        os.set_blocking(handle, True)
        return os.fdopen(handle, "rb")
    except BaseException:
        os.close(handle)
        raise


def read_bounded(path: str | Path, bytes_max: int = BYTES_MAX) -> bytes:
    """All its bytes. Raises InputFileError: there are more, or it is no file; OSError: it cannot be read."""
    with open_input(path) as file:
        size = os.fstat(file.fileno()).st_size
        raw = b"" if size > bytes_max else file.read(bytes_max + 1)
    if size > bytes_max or len(raw) > bytes_max:
        raise InputFileError(errno.EFBIG, f"larger than {bytes_max >> 10} KiB", str(path))
    return raw


def _check(path: str | Path, status: os.stat_result) -> None:
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    handed_over = os.path.realpath(path).startswith(("/proc/", "/dev/fd/"))
    if not (stat.S_ISREG(status.st_mode) or (stat.S_ISFIFO(status.st_mode) and handed_over)):
        raise InputFileError(errno.EINVAL, "a named pipe, a folder or a device", str(path))
