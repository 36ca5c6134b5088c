"""Samples as a table: one row a sample, one column a value, for NumPy, pandas, CSV and Parquet.

    hostlink.to_arrays("press.log")["displacement_mm"]         # NumPy, shape (samples,)
    hostlink.to_pandas("press.log").groupby("finger").mean()
    hostlink.to_pandas(itertools.islice(hand.samples(), 1000))

Rules
- Columns: `COLUMNS`, the same everywhere. Names carry units; frame of reference and sign: WIRE.md.
- A value that is not valid is NaN; an empty cell in CSV, as pandas and spreadsheets read it.
- `status` is a number: `frame[frame.status & int(hostlink.NO_CONTROL) == 0]` selects the rows that may move a
hand. All but arrays have `status_names` too, the names of its bits with spaces between, as the last column.
- Files are written piece by piece: a recording of hours needs no more memory than one of seconds.
- A damaged recording is an error here; `decode --csv` or `--parquet` keeps the samples before the damage.
"""

from __future__ import annotations

import csv
from array import array
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import islice
from math import nan
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from hostlink.events import Event, Sample
from hostlink.extras import require
from hostlink.recording import decode_blocks
from hostlink.wire import Status
from hostlink.wire.fields import CONTACTS_MAX, FIELDS, LAYOUT, SCHEMA

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

__all__ = ["COLUMNS", "Column", "row_of", "to_arrays", "to_pandas", "write_csv", "write_parquet"]

Source = str | Path | Iterable[Event]
Row = tuple[float, ...]

ROWS_PER_PIECE: Final = 1 << 14  # 4 MB of columns: enough for a Parquet row group to compress well
_DIGITS: Final = 6  # finer than the smallest step of any field, and the resolution of recorded times


@dataclass(frozen=True, slots=True)
class Column:
    """One value of a sample.

    whole  a whole number (int64), else float64 with NaN where the value is not valid
    """

    name: str
    unit: str
    meaning: str
    whole: bool = False


_CONTACT_ROWS: Final = tuple(f for f in LAYOUT if f.contact)
COLUMNS: Final = (
    Column("finger", "", "node number", whole=True),
    Column("arrival_s", "s", "when the sample came in"),
    Column("host_time_s", "s", "when the image was taken, on the clock of arrival_s"),
    Column("host_error_s", "s", "bound of host_time_s's error"),
    Column("lost_n", "", "samples lost between the one before and this", whole=True),
    *(Column(f.name, f.unit, f.meaning, whole=f.plain) for f in (*FIELDS, *_CONTACT_ROWS)),
)

_NAMES: Final = "status_names"
_STATUS: Final = next(i for i, c in enumerate(COLUMNS) if c.name == "status")
_OF_SAMPLE: Final = attrgetter("finger", "arrival_s", "host_time_s", "host_error_s", "lost_n")
_OF_STATE: Final = attrgetter(*(f.name for f in FIELDS))
_DTYPE: Final = {  # of a frame's version and fields
    "names": ["version", *(f.name for f in LAYOUT)],
    "formats": ["u1", *(f"<{'i' if f.signed else 'u'}{f.size}" for f in LAYOUT)],
}
_NOTHING: Final = bytes(SCHEMA.body.size)
_NO_CONTACT: Final = (nan,) * (len(_CONTACT_ROWS) // CONTACTS_MAX)


@cache
def _names_of(status: float) -> str:
    return " ".join(bit.name or "" for bit in Status(int(status)))


def row_of(sample: Sample) -> Row:
    """The sample's values in the order of COLUMNS."""
    contacts: list[float] = []
    for contact in sample.state.contacts:
        contacts += (contact.x_mm, contact.y_mm, contact.depth_mm)
    contacts += _NO_CONTACT * (CONTACTS_MAX - len(sample.state.contacts))
    return (*_OF_SAMPLE(sample), *_OF_STATE(sample.state), *contacts)


def _samples(source: Source, channel: str | int | None) -> Iterator[Any]:
    """Samples, or what a bare decoder gives for them."""
    events = decode_blocks(source, channel) if isinstance(source, str | Path) else source
    return (event for event in events if isinstance(event, tuple))


def _columns_of(samples: list[Any], numpy: Any) -> list[np.ndarray]:
    """A column each, in the order of COLUMNS; fields of frames are decoded together, by the table."""
    n = len(samples)
    fingers, states, *times, lost_n = zip(*samples, strict=True)
    known = [state if type(state) is bytes else state.body for state in states]
    raws = numpy.frombuffer(b"".join(body or _NOTHING for body in known), numpy.dtype(_DTYPE))
    values = {f.name: raws[f.name].astype(numpy.int64 if f.plain else numpy.float64) for f in LAYOUT}
    for f in LAYOUT:
        if not f.plain:
            values[f.name] *= f.scale
            values[f.name][raws[f.name] == f.raw_nan(8 * f.size)] = nan
    places = numpy.stack([values[f.name] for f in _CONTACT_ROWS]).reshape(CONTACTS_MAX, -1, n)
    for i in reversed(range(CONTACTS_MAX)):  # those without a place are left out, and others take theirs
        gone = numpy.isnan(places[i, 0])
        places[i:-1, :, gone] = places[i + 1 :, :, gone]
        places[-1, :, gone] = nan
    host_s, error_s, arrival_s = (numpy.array(column, numpy.float64) for column in times)
    columns = [
        numpy.array(fingers, numpy.int64),
        arrival_s,
        host_s,
        error_s,
        numpy.array(lost_n, numpy.int64),
    ]
    columns += [*(values[f.name] for f in FIELDS), *places.reshape(-1, n)]
    if None in known:  # made of values, or of an older version
        for i in (i for i, body in enumerate(known) if body is None):
            for column, value in zip(columns, row_of(samples[i]), strict=True):
                column[i] = value
    return columns


def to_arrays(source: Source, channel: str | int | None = None) -> dict[str, np.ndarray]:
    """Columns by name, each (samples,), int64 or float64.

    source   a recording's path, or events of which the samples are taken
    channel  of a recording of several buses: the one whose samples are wanted
    Raises   UsageError: NumPy is not installed, or a channel must be chosen; LogError: the recording is
             unreadable or damaged
    """
    numpy = require("numpy", "data")
    columns: list[array[Any]] = [array("q" if c.whole else "d") for c in COLUMNS]
    samples = _samples(source, channel)
    while piece := list(islice(samples, ROWS_PER_PIECE)):
        for column, values in zip(columns, _columns_of(piece, numpy), strict=True):
            column.frombytes(values.tobytes())
    return {
        c.name: numpy.frombuffer(column, dtype=numpy.int64 if c.whole else numpy.float64)
        for c, column in zip(COLUMNS, columns, strict=True)
    }


def to_pandas(source: Source, channel: str | int | None = None) -> pd.DataFrame:
    """One row a sample; `frame.attrs["units"]` has the unit of each column. Arguments: `to_arrays`.

    Raises  UsageError: pandas is not installed, or a channel must be chosen; LogError: as there
    """
    frame: pd.DataFrame = require("pandas", "data").DataFrame(to_arrays(source, channel), copy=False)
    frame[_NAMES] = frame["status"].map(_names_of)
    frame.attrs["units"] = {c.name: c.unit for c in COLUMNS}
    return frame


def write_csv(samples: Iterable[Sample], path: Path) -> int:
    """Write a table with a line of names; returns the number of samples. Raises OSError."""
    written_n = 0
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow((*(c.name for c in COLUMNS), _NAMES))
        for row in map(row_of, samples):
            cells = (
                int(v) if c.whole else "" if v != v else round(v, _DIGITS)
                for c, v in zip(COLUMNS, row, strict=True)
            )
            writer.writerow((*cells, _names_of(row[_STATUS])))
            written_n += 1
    return written_n


def write_parquet(samples: Iterable[Sample], path: Path) -> int:
    """Write a Parquet file, units and meanings as metadata of its columns; returns the number of samples.

    Raises  UsageError: pyarrow is not installed; OSError
    """
    arrow, parquet = require("pyarrow", "data"), require("pyarrow.parquet", "data")
    fields = [
        arrow.field(
            c.name,
            arrow.int64() if c.whole else arrow.float64(),
            metadata={"unit": c.unit, "meaning": c.meaning},
        )
        for c in COLUMNS
    ]
    schema = arrow.schema([*fields, arrow.field(_NAMES, arrow.string())])
    written_n = 0
    with parquet.ParquetWriter(path, schema, compression="zstd") as writer:
        rows = map(row_of, samples)
        while piece := list(islice(rows, ROWS_PER_PIECE)):
            columns = [
                arrow.array(map(int, column) if c.whole else column, field.type)
                for c, field, column in zip(COLUMNS, fields, zip(*piece, strict=True), strict=True)
            ]
            columns.append(arrow.array([_names_of(row[_STATUS]) for row in piece]))
            writer.write_table(arrow.Table.from_arrays(columns, schema=schema))
            written_n += len(piece)
    return written_n
