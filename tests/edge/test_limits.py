"""Limits of files: sizes, nesting and numbers, each refusal one line that a person understands."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_limits
from hypothesis import strategies as st

from calib.errors import ProtocolError, RigError
from calib.protocols import load_protocol
from calib.rig.simulated import load_simulation
from calib.rig.stage import load_stage
from edge import limits
from edge.calibration import CalibrationFile
from edge.config import Config, load_config
from edge.errors import ConfigError, SourceError
from edge.limits import BadContent, Name, Number
from edge.sensors import load_sensor
from edge.sources.lens_file import load_lens
from tests.support.nasty import NASTY
from tests.support.refusals import one_line

NUMBER = "a number from -9007199254740992 to 9007199254740992"


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
        ('{"items":[{"x":1e16}]}', f"items[0].x: must be {NUMBER}"),
        ('{"items":[{"x":NaN}]}', "no JSON: invalid character (byte 15)"),
        ('{"items":[{"x":"1"}]}', f"items[0].x: must be {NUMBER}, is text"),
        ('{"items":[{"x":true}]}', f"items[0].x: must be {NUMBER}, is true or false"),
        ('{"items":[{"y":1}]}', "items[0]: unknown key 'y'; known: x, names, kind"),
        ('{"items":[{}]}', "items[0]: lacks x"),
        ('{"items":[{"x":1,"names":["a","b","c"]}]}', "items[0].names: must have at most 2 items"),
        ('{"items":[{"x":1,"kind":3}]}', "items[0].kind: must be text or null, is a whole number"),
        ('{"items":[],"n":1.5}', "n: must be a whole number, is a number"),
        ('{"items":{}}', "items: must be a list, each of it a table {...}, is a table {...}"),
        ("[]", "must be a table {...}, is a list"),
        ('{"items":[', "no JSON: input data was truncated"),
        ('{"other":' + "[" * 100_000, "lists and tables are nested too deeply"),
    ],
)
def test_errors_have_readable_messages(raw: str, expected: str) -> None:
    assert one_line(BadContent, limits.decode_json, raw.encode(), Table) == expected


#: Sections and keys of all our TOML files, and values that no file should have.
PLACES = sorted(
    {f"{s.name}.{k.name}" for s in msgspec.structs.fields(Config) for k in msgspec.structs.fields(s.type)}
    | {"size_px", "k", "model", "pins.count", "tip.n_pins", "camera.size_px", "look.noise", "steps", "step",
       "stage.port", "stage.feed_mm_min", "axes.X", "axes.X.sign", "rest", "seed", "rate_hz", "truth.pins",
       "a.b.c", ".".join("a" * 1000), '"$.`x`"', '" - at `$.sensor`"', '""'}
)  # fmt: skip
VALUES = (
    *NASTY, "nan", "-inf", "0x" + "f" * 5000, "1979-05-27", "07:32:00", '["a", nan]', "[" * 3000, "{a = 1}",
    "", "[[" + "9" * 4000 + "]]", '"""', "'" + "x" * 6000 + "'",
)  # fmt: skip
LOADERS = (load_config, load_lens, lambda path: load_sensor(str(path)), load_simulation,
           lambda path: load_stage(str(path)), lambda path: load_protocol(str(path)))  # fmt: skip
ONE_LINE = (ConfigError, SourceError, RigError, ProtocolError)


def refusal(load: Callable[[Path], object], path: Path) -> str:
    """Why it is refused; the file's name if it is read."""
    try:
        load(path)
    except ONE_LINE as error:
        return str(error)
    return path.name


@pytest.mark.generative
@hypothesis_limits(max_examples=100, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(PLACES), st.sampled_from(VALUES)), min_size=1, max_size=3))
def test_any_toml_is_read_or_refused_in_one_line(
    tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[str, str]]
) -> None:
    path = tmp_path_factory.getbasetemp() / "fuzzed.toml"
    path.write_text("".join(f"{place} = {value}\n" for place, value in rows))
    for load in LOADERS:
        why = refusal(load, path)
        assert "fuzzed.toml" in why
        assert len(why) < 700
        assert why.isprintable()


def test_a_key_of_many_parts_takes_no_time(tmp_path: Path) -> None:
    path = tmp_path / "dotted.toml"
    for text in (".".join("a" * 30_000) + " = 1", "a = {" + ".".join("b" * 30_000) + " = 1}"):
        path.write_text(text)
        with pytest.raises(BadContent, match="nested too deeply"):
            limits.read_toml(path)


#: Ends of the keys that must be there.
LIMITS = {"integer": ("inimum", "aximum"), "number": ("inimum", "aximum"), "array": ("axItems",)}


def unbounded(schema: Any, where: str) -> Iterator[str]:
    """Places in a JSON schema whose numbers have no range, or whose lists have no longest length."""
    if isinstance(schema, dict):
        ends = LIMITS.get(str(schema.get("type")), ())
        if not all(any(key.endswith(end) for key in schema) for end in ends):
            yield where
        for key, value in schema.items():
            yield from unbounded(value, f"{where}.{key}")
    elif isinstance(schema, list):
        for i, value in enumerate(schema):
            yield from unbounded(value, f"{where}[{i}]")


def test_every_number_of_a_calibration_has_a_range() -> None:
    """Of the configuration: `test_every_key_names_its_values`."""
    found = list(unbounded(msgspec.json.schema(CalibrationFile), ""))
    assert found == [".$defs.CalibrationFile.properties.version"]
