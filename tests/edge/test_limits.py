"""Limits of files: sizes, nesting and numbers, each refusal one line that a person understands."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import msgspec
import pytest
from msgspec import inspect

from edge import limits
from edge.calibration import CalibrationFile
from edge.config import Config
from edge.limits import BadContent, Name, Number


class Item(msgspec.Struct, forbid_unknown_fields=True):
    x: Number
    names: Annotated[list[Name], msgspec.Meta(max_length=2)] = []
    kind: str | None = None


class Table(msgspec.Struct):
    items: list[Item]
    n: int = 0


@pytest.mark.parametrize(
    ("raw", "expected"),
    [
        ('{"items":[{"x":1e400}]}', "items[0].x: number out of range"),
        ('{"items":[{"x":1e16}]}', "items[0].x: must be at most 1e+15"),
        ('{"items":[{"x":NaN}]}', "no JSON: invalid character (byte 15)"),
        ('{"items":[{"x":"1"}]}', "items[0].x: must be a number, is text"),
        ('{"items":[{"x":true}]}', "items[0].x: must be a number, is true or false"),
        ('{"items":[{"y":1}]}', "items[0]: unknown key 'y'"),
        ('{"items":[{}]}', "items[0]: lacks x"),
        ('{"items":[{"x":1,"names":["a","b","c"]}]}', "items[0].names: must have at most 2 items"),
        ('{"items":[{"x":1,"kind":3}]}', "items[0].kind: must be text or null, is a whole number"),
        ('{"items":[],"n":1.5}', "n: must be a whole number, is a number"),
        ('{"items":{}}', "items: must be a list, is a table {...}"),
        ("[]", "must be a table {...}, is a list"),
        ('{"items":[', "no JSON: input data was truncated"),
        ('{"other":' + "[" * 100_000, "lists and tables are nested too deeply"),
    ],
)
def test_errors_have_readable_messages(raw: str, expected: str) -> None:
    with pytest.raises(BadContent) as caught:
        limits.decode_json(raw.encode(), Table)
    assert str(caught.value) == expected


def test_a_file_is_read_up_to_its_limit(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"x" * 2048)
    assert len(limits.read_bounded(path, 2048)) == 2048
    with pytest.raises(BadContent, match="larger than 1 KiB"):
        limits.read_bounded(path, 1024)
    with pytest.raises(BadContent, match="a folder or a device"):
        limits.read_bounded(Path("/dev/zero"), 1024)
    with pytest.raises(FileNotFoundError):
        limits.read_bounded(tmp_path / "absent", 1024)


def test_quoted_text_is_one_short_line() -> None:
    assert limits.quote("smell") == "'smell'"
    assert limits.quote("a\nb\x1b[2J") == r"'a\nb\x1b[2J'"
    assert len(limits.quote("x" * 1000)) == 42


def unbounded(kind: inspect.Type, where: str) -> Iterator[str]:
    """Places in a file's structure whose numbers have no range, or whose lists have no longest length."""
    if isinstance(kind, inspect.StructType):
        for field in kind.fields:
            yield from unbounded(field.type, f"{where}.{field.name}")
    elif isinstance(kind, inspect.UnionType):
        for one in kind.types:
            yield from unbounded(one, where)
    elif isinstance(kind, inspect.TupleType):
        for i, one in enumerate(kind.item_types):
            yield from unbounded(one, f"{where}[{i}]")
    elif isinstance(kind, inspect.ListType | inspect.VarTupleType):
        if isinstance(kind, inspect.ListType) and kind.max_length is None:
            yield where
        yield from unbounded(kind.item_type, f"{where}[]")
    elif isinstance(kind, inspect.IntType | inspect.FloatType):
        lows, highs = (kind.ge, kind.gt), (kind.le, kind.lt)
        if lows == (None, None) or highs == (None, None):
            yield where


@pytest.mark.parametrize("kind", [CalibrationFile, Config])
def test_every_number_of_a_file_has_a_range(kind: type) -> None:
    assert not [place for place in unbounded(inspect.type_info(kind), "") if place != ".version"]
