"""The one reader of tables: CSV in UTF-8, commas between cells, decimal points, the first row the headings.

A table is read whole or refused in one line that says which line is wrong and what would be right. Nothing is
guessed: a decimal comma makes a cell too many, and two columns of one name would make a value of either.

Some forms that spreadsheets and pandas write are taken: a byte order mark, any line ends, blank lines, quoted
cells, spaces round headings and numbers, empty cells behind the last heading, columns without one.
"""

import csv
import io
import math
import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path

from calib.errors import TableError
from edge.limits import quote, read_bounded

BYTES_MAX = 1 << 28  # a million rows of a capture; more would fill the memory
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)", re.IGNORECASE)
_COMMA = re.compile(r"[+-]?[0-9]*,[0-9]+")
_OTHER_SEPARATORS = {";": "semicolons", "\t": "tabs", "|": "bars"}


@dataclass(frozen=True, slots=True)
class TableRow:
    """One row.

    line   in the file, from 1, where it begins
    cells  by heading; "" where it ends earlier
    whole  whether it has a cell for each heading
    """

    line: int
    cells: dict[str, str]
    whole: bool


@dataclass(frozen=True, slots=True)
class StrictTable:
    """A table. names: its headings, without surrounding spaces; raw: the file's bytes."""

    names: tuple[str, ...]
    rows: tuple[TableRow, ...]
    raw: bytes


def read_table(path: Path, needed: Collection[str], once: Collection[str] = ()) -> StrictTable:
    """Read a table.

    needed  headings that it must have
    once    headings that it may have only once, as those needed; another may be there twice, nobody reads it
    Raises  TableError: one line with file, line and what would be right
    """
    raw = _bytes_of(path)
    rows = _rows_of(path, _text_of(path, raw))
    _, head = next(rows, (1, []))
    names = tuple(name.strip() for name in head)
    for name in needed:
        if name not in names:
            raise TableError(f"{path}: no column {name}{_other_separator(names, name)}")
    for name in (*needed, *once):
        if names.count(name) > 1:
            raise TableError(f"{path}: line 1: {names.count(name)} columns {name}; leave one of them")
    found = []
    for line, cells in rows:
        beyond = [cell for cell in cells[len(names) :] if cell.strip()]
        if beyond:
            raise TableError(
                f"{path}: line {line}: {len(cells)} cells for {len(names)} headings; write "
                "decimals with a point, and a cell with a comma within quotes"
            )
        named = dict.fromkeys(names, "") | dict(zip(names, cells, strict=False))
        found.append(TableRow(line, named, len(cells) >= len(names)))
    return StrictTable(names, tuple(found), raw)


def number(text: str, where: str) -> float:
    """A cell's finite decimal number. Raises TableError: `where`, and what it is instead."""
    text = text.strip()
    if _NUMBER.fullmatch(text) and math.isfinite(value := float(text)):
        return value
    if _NUMBER.fullmatch(text) or _NOT_FINITE.fullmatch(text):
        raise TableError(f"{where}: {shown(text)} is not a finite number")
    hint = f"; write {text.replace(',', '.')}" if _COMMA.fullmatch(text) else ""
    raise TableError(f"{where}: '{shown(text)}' is not a number{hint}")


def shown(text: str) -> str:
    """A cell as it stands in a message: in one line, and not long."""
    return quote(text)[1:-1]


def _bytes_of(path: Path) -> bytes:
    try:
        return read_bounded(path, BYTES_MAX)
    except OSError as error:
        raise TableError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise TableError(f"{path}: {error}; a table is a file of at most {BYTES_MAX >> 20} MiB") from None


def _text_of(path: Path, raw: bytes) -> str:
    right = "a CSV table in UTF-8 is needed"
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise TableError(f"{path}: UTF-16, not UTF-8; save it as CSV in UTF-8")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise TableError(f"{path}: not a text file, line {line} is not UTF-8; {right}") from None
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise TableError(f"{path}: not a text file, line {line} has a NUL byte; {right}")
    return text


def _rows_of(path: Path, text: str) -> Iterator[tuple[int, list[str]]]:
    """The rows that have cells, each with the number of the line where it begins."""
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    line = 1
    try:
        for cells in reader:
            if cells:
                yield line, cells
            line = reader.line_num + 1
    except csv.Error as error:
        raise TableError(
            f"{path}: line {line}: no row of a table: {error}; close quotes, and double those within quotes"
        ) from None


def _other_separator(names: tuple[str, ...], wanted: str) -> str:
    """The fault within a cell, where the heading is there."""
    head = names[0] if names else ""
    for separator, name in _OTHER_SEPARATORS.items():
        if wanted in (part.strip().strip('"') for part in head.split(separator)) and separator in head:
            return f"; its cells have {name} between them, write commas, and decimals with a point"
    return ""
