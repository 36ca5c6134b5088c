"""The limits under which every file and upload is parsed: calibration, settings, configuration, recordings.

The cost of a file in time and memory is bounded by its size in bytes, which is known before anything is read,
and by the lengths in its types. NaN and infinity are never accepted. An error is one line, `BadContent`: the
place in the file, what would be right; the reader of the file puts the file's name before it.
"""

import json
import re
import struct
import tomllib
from pathlib import Path
from typing import Annotated, Any, TypeVar

import msgspec
from msgspec import inspect

from hostlink import input_file
from hostlink.wire import detail

FILE_BYTES = input_file.UPLOAD_BYTES  # 1000 pins with every model take a quarter of it

IMAGE_SIDE_PX = 8192  # width or height
#: With four levels of 16 bits a pixel, the widest format, they fill the largest file that is read.
IMAGE_PIXELS = input_file.BYTES_MAX // struct.calcsize("4H")
TICK_HZ = 1_000_000  # of the time in a sample, in microseconds: 32 bits, then it wraps
RATE_MAX_HZ = float(TICK_HZ)  # images a second; more would share their times
RATE_MIN_HZ = TICK_HZ / 2**32  # of a camera or of samples, where 0 has a meaning of its own
PINS_MIN = 12  # the fewest that `edge.pins` accepts as a pattern
PINS_MAX = detail.PINS_MAX  # the most that a detail stream can name
POINTS_MAX = 1_000_000  # a plane's; of a triangulation, every index of a half-edge then fits in 32 bits

T = TypeVar("T")

#: A key of as many parts: the parser's time grows with their square, to a minute for 64 KiB.
_BARE = rb"[^\s.,=\[\]{}]"
_LONG_KEY = re.compile(rb"(?<!%s)(?:%s++[ \t]*+\.[ \t]*+){%d}" % (_BARE, _BARE, input_file.DEPTH_MAX))
_TOO_DEEP = "lists and tables are nested too deeply"

#: Any number of a file that has no narrower range.
NUMBER_MAX = 2.0**53  # whole numbers up to it are exact
Number = Annotated[float, msgspec.Meta(ge=-NUMBER_MAX, le=NUMBER_MAX)]
#: A place or a length in an image; a place may lie slightly outside of it.
Pixels = Annotated[float, msgspec.Meta(ge=-IMAGE_SIDE_PX, le=2 * IMAGE_SIDE_PX)]
ImageSide = Annotated[int, msgspec.Meta(ge=16, le=IMAGE_SIDE_PX)]
Name = Annotated[str, msgspec.Meta(max_length=64)]


class ClosedTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table of a file: immutable, and closed to keys that it does not name."""


class BadContent(ValueError):
    """A file's content cannot be used: the place in it, what is wrong, what would be right. One line."""


def read_bounded(path: Path, bytes_max: int) -> bytes:
    """A file's bytes. Raises BadContent: too many, or it is no ordinary file; OSError: it cannot be read."""
    try:
        return input_file.read_bounded(path, bytes_max)
    except IsADirectoryError:
        raise BadContent("a folder or a device; give a file") from None
    except input_file.InputFileError as error:
        raise BadContent(f"{error.strerror}; give a file") from None


def decode_json(raw: bytes, kind: type[T]) -> T:
    """Decode JSON as the given type. Raises BadContent."""
    try:
        return msgspec.json.decode(raw, type=kind)
    except msgspec.ValidationError as error:
        raise BadContent(explain(str(error), kind)) from None
    except msgspec.DecodeError as error:
        reason = str(error).removeprefix("JSON is malformed: ")
        raise BadContent(f"no JSON: {reason[:1].lower() + reason[1:]}") from None
    except UnicodeDecodeError as error:
        raise BadContent(f"no JSON: byte {error.start} is not UTF-8 text") from None
    except RecursionError:
        raise BadContent(_TOO_DEEP) from None


def read_toml(path: Path) -> dict[str, Any]:
    """A TOML file's table. Raises BadContent; OSError: it cannot be read."""
    raw = read_bounded(path, FILE_BYTES)
    if _LONG_KEY.search(raw):
        raise BadContent(_TOO_DEEP)
    try:
        table = tomllib.loads(raw.decode())
    except tomllib.TOMLDecodeError as error:
        raise BadContent(f"not TOML: {quote(str(error), 200)[1:-1]}") from None
    except UnicodeDecodeError as error:
        raise BadContent(f"not TOML: byte {error.start} is not UTF-8 text") from None
    except ValueError:  # the interpreter's own limit: 4300 digits
        raise BadContent("not TOML: a number has too many digits") from None
    except RecursionError:
        raise BadContent(_TOO_DEEP) from None
    _check_size(table)
    return table


def _check_size(table: dict[str, Any]) -> None:
    """Raises BadContent: deeper than any file is, or with an integer that no message could hold."""
    below: list[tuple[Any, int]] = [(table, 0)]
    while below:
        value, depth = below.pop()
        if depth > input_file.DEPTH_MAX:
            raise BadContent(_TOO_DEEP)
        if isinstance(value, int) and value.bit_length() > 64:
            raise BadContent(f"a number of {value.bit_length()} bits; give one of 64 at most")
        if isinstance(value, dict | list):
            inside = value.values() if isinstance(value, dict) else value
            below += [(one, depth + 1) for one in inside]


def read_toml_as(path: Path, kind: type[T], **added: object) -> tuple[dict[str, Any], T]:
    """A TOML file's table with keys from its name, `added`, and the same as a type. Raises BadContent."""
    try:
        table = read_toml(path)
        for name in added.keys() & table.keys():
            raise BadContent(f"unknown key {name!r}; it follows from the file's name")
        table |= added
        content = msgspec.convert(table, kind)
        check_numbers(table)
        return table, content
    except OSError as error:
        raise BadContent(f"cannot be read: {error.strerror}") from None
    except msgspec.ValidationError as error:
        raise BadContent(explain(str(error), kind, table)) from None


def check_numbers(value: object, place: str = "") -> None:
    """Raises BadContent: a number that is not finite or beyond `Number`; for types without such limits."""
    if isinstance(value, dict):
        for name, below in value.items():
            check_numbers(below, f"{place}.{name}" if place else name)
    elif isinstance(value, list):
        for k, below in enumerate(value):
            check_numbers(below, f"{place}[{k}]")
    elif isinstance(value, int | float) and not -NUMBER_MAX <= value <= NUMBER_MAX:
        raise BadContent(f"{place} = {value:g}: give a finite number, at most {NUMBER_MAX:g}")


def quote(text: str, most: int = 40) -> str:
    """Text from a file for a message: printable, in quotes, shortened if long."""
    text = text if len(text) <= most else text[: most - 3] + "..."
    return repr(text) if text.isprintable() else ascii(text)


_KINDS = {
    "str": "text",
    "int": "a whole number",
    "float": "a number",
    "bool": "true or false",
    "array": "a list",
    "object": "a table {...}",
    "null": "null",
    "tuple": "a list",
    "struct": "a table {...}",
    "dict": "a table {...}",
    "none": "null",
}
_LIMITS = {"from": "ge", "from above": "gt", "to": "le", "to below": "lt"}
_COMPARED = {">=": "at least", ">": "more than", "<=": "at most", "<": "less than", None: "exactly"}
# Compiled when a message is explained, not at each start: (?s) lets a dot match all.
_PATH = r"(?s) - at `\$\.?(?P<path>.*)`$"
_LENGTH = r"Expected `(?P<kind>\w+)` of length (?P<op>[<>]=?)? ?(?P<n>\d+)"
_RANGE = r"Expected `\w+` [<>]=? "
_KIND = r"Expected `(?P<wanted>[^`]*)`, got `(?P<found>[^`]*)`"
_FIELD = r"(?s)Object (?P<what>missing required|contains unknown) field `(?P<name>.*)`"
_VALUE = r"(?s)Invalid (?:enum )?value (?P<value>.*)"


def explain(message: str, kind: Any, content: Any = None) -> str:
    """A message of msgspec in plain English: `tare.steady_px: must be a number from 0.01 to 100, is 0`.

    kind     the type that it is about
    content  what was converted, for the wrong value; None: not shown
    """
    found = re.search(_PATH, message)
    place = found["path"] if found else ""
    message = message[: found.start()] if found else message
    what = _what(message)
    steps = re.findall(r"\w+|\.{3}", place)  # in a dict every key is "..."
    kinds = [inspect.type_info(kind)]
    for step in steps:
        kinds = [below for one in kinds for below in _below(one, step)]
    if wrong := re.match(_KIND, message) or re.match(_RANGE, message):
        is_found = f", is {_named(wrong['found'])}" if "found" in wrong.groupdict() else ""
        if content is not None and "..." not in steps:
            for step in steps:
                content = content[int(step) if isinstance(content, list) else step]
            is_found = f", is {_shown(content)}"
        what = f"must be {' or '.join(dict.fromkeys(map(_wanted, kinds)))}{is_found}"
    elif what.startswith("unknown") and len(kinds) == 1 and (known := _known(kinds[0])):
        what += f"; known: {', '.join(known)}"
    return f"{place}: {what}" if place else what


def _shown(value: object) -> str:
    text = json.dumps(value, default=str)
    return text if len(text) <= 40 else text[:37] + "..."


def _below(kind: inspect.Type, step: str) -> list[inspect.Type]:
    """The types of a field or of an item; none where there is no such field."""
    match kind:
        case inspect.UnionType(types=types):
            return [below for one in types for below in _below(one, step)]
        case inspect.StructType(fields=fields):
            return [field.type for field in fields if field.encode_name == step]
        case inspect.TupleType(item_types=items):
            return list(items)
        case inspect.ListType(item_type=item) | inspect.VarTupleType(item_type=item):
            return [item]
        case inspect.DictType(value_type=value):
            return [value]
    return []


def _known(kind: inspect.Type) -> list[str]:
    """The keys or values that a place may have; empty where it may have any."""
    match kind:
        case inspect.StructType(fields=fields):
            return [field.encode_name for field in fields]
        case inspect.EnumType(cls=cls):
            return [member.value for member in cls if member.value]
        case inspect.LiteralType(values=values):
            return list(map(str, values))
        case inspect.UnionType(types=types):  # a value, or none is given
            return [known for one in types for known in _known(one)]
    return []


def _wanted(kind: inspect.Type) -> str:
    """The values that a place takes, with their whole range."""
    match kind:
        case inspect.UnionType(types=types):
            return " or ".join(dict.fromkeys(map(_wanted, types)))
        case inspect.ListType(item_type=item) | inspect.VarTupleType(item_type=item):
            return f"a list, each of it {_wanted(item)}"
        case inspect.EnumType() | inspect.LiteralType():
            return f"one of {', '.join(_known(kind))}"
        case inspect.StrType(max_length=int(most)):
            return f"text of at most {most} characters"
    limits = [(word, getattr(kind, name, None)) for word, name in _LIMITS.items()]
    within = "".join(f" {word} {limit:.16g}" for word, limit in limits if limit is not None)
    return _named(type(kind).__name__.removesuffix("Type").lower()) + within


def _what(message: str) -> str:
    if m := re.match(_LENGTH, message):
        unit = "character" if m["kind"] == "str" else "item"
        return f"must have {_COMPARED[m['op']]} {m['n']} {unit}{'s' * (m['n'] != '1')}"
    if m := re.match(_FIELD, message):
        if m["what"] == "missing required":
            return f"lacks {m['name']}"
        return f"unknown key {quote(m['name'])}"
    if m := re.match(_VALUE, message):
        return f"unknown value {quote(m['value'].strip(chr(39)))}"
    return message[:1].lower() + message[1:]


def _named(kinds: str) -> str:
    return " or ".join(_KINDS.get(kind, kind) for kind in kinds.split(" | "))
