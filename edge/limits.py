"""The limits under which every file and upload is parsed: calibration, settings, configuration, recordings.

The cost of a file in time and memory is bounded by its size in bytes, which is known before anything is read,
and by the lengths in its types. NaN and infinity are never accepted. An error is one line, `BadContent`: the
place in the file, what would be right; the reader of the file puts the file's name before it.
"""

import re
import tomllib
from pathlib import Path
from typing import Annotated, Any, TypeVar

import msgspec

from hostlink import input_file
from hostlink.wire import detail

FILE_BYTES = input_file.UPLOAD_BYTES  # 1000 pins with every model take a quarter of it

IMAGE_SIDE_PX = 8192  # width or height
IMAGE_PIXELS = 1 << 24  # 4096 x 4096, more than any camera that fits behind a fingertip
TICK_HZ = 1_000_000  # of the time in a sample, in microseconds: 32 bits, then it wraps
RATE_MAX_HZ = float(TICK_HZ)  # images a second; more would share their times
RATE_MIN_HZ = TICK_HZ / 2**32  # of a camera or of samples, where 0 has a meaning of its own
PINS_MIN = 12  # the fewest that `edge.pins` accepts as a pattern
PINS_MAX = detail.PINS_MAX  # the most that a detail stream can name
POINTS_MAX = 1_000_000  # a plane's; of a triangulation, every index of a half-edge then fits in 32 bits

T = TypeVar("T")

#: A key of as many parts: the parser's time grows with their square, to a minute for 64 KiB.
_LONG_KEY = re.compile(rb"(?:[^\s.,=\[\]{}]+[ \t]*\.[ \t]*){%d}" % input_file.DEPTH_MAX)
_TOO_DEEP = "lists and tables are nested too deeply"

#: Any number of a file that has no narrower range.
NUMBER_MAX = 2.0**53  # whole numbers up to it are exact
Number = Annotated[float, msgspec.Meta(ge=-NUMBER_MAX, le=NUMBER_MAX)]
#: A place or a length in an image; a place may lie slightly outside of it.
Pixels = Annotated[float, msgspec.Meta(ge=-IMAGE_SIDE_PX, le=2 * IMAGE_SIDE_PX)]
ImageSide = Annotated[int, msgspec.Meta(ge=16, le=IMAGE_SIDE_PX)]
Name = Annotated[str, msgspec.Meta(max_length=64)]


class BadContent(ValueError):
    """A file's content cannot be used: the place in it, what is wrong, what would be right. One line."""


def read_bounded(path: Path, bytes_max: int) -> bytes:
    """A file's bytes, if there are not too many.

    Raises  BadContent: it is larger, or not an ordinary file; OSError: it cannot be read
    """
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
    """A TOML file's table, and the same decoded as a type.

    added   keys that follow from the file's name
    Raises  BadContent: it cannot be read, or what is wrong in it
    """
    try:
        table = read_toml(path)
        for name in added.keys() & table.keys():
            raise BadContent(f"unknown key {name!r}; it follows from the file's name")
        check_numbers(table)
        return table, msgspec.convert(table | added, kind)
    except OSError as error:
        raise BadContent(f"cannot be read: {error.strerror}") from None
    except msgspec.ValidationError as error:
        raise BadContent(explain(str(error), kind)) from None


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
}
_COMPARED = {">=": "at least", ">": "more than", "<=": "at most", "<": "less than", None: "exactly"}
_PATH = re.compile(r" - at `\$\.?(?P<path>.*)`$", re.DOTALL)
_LENGTH = re.compile(r"Expected `(?P<kind>\w+)` of length (?P<op>[<>]=?)? ?(?P<n>\d+)")
_RANGE = re.compile(r"Expected `\w+` (?P<op>[<>]=?) (?P<limit>\S+)")
_KIND = re.compile(r"Expected `(?P<wanted>[^`]*)`, got `(?P<found>[^`]*)`")
_FIELD = re.compile(r"Object (?P<what>missing required|contains unknown) field `(?P<name>.*)`", re.DOTALL)
_VALUE = re.compile(r"Invalid (?:enum )?value (?P<value>.*)", re.DOTALL)


def explain(message: str, kind: Any) -> str:
    """A message of msgspec on this type in plain English: `models[0].sigma: must be more than 0`."""
    found = _PATH.search(message)
    place = found["path"] if found else ""
    what = _what(message[: found.start()] if found else message)
    if what.startswith("unknown") and (known := _known(kind, place)):
        what += f"; known: {', '.join(known)}"
    return f"{place}: {what}" if place else what


def _known(kind: Any, place: str) -> list[str]:
    """The keys or values that a place may have; empty where it may be one of several tables."""
    at: Any = msgspec.inspect.type_info(kind)
    for step in re.findall(r"\w+", place):
        if isinstance(at, msgspec.inspect.StructType):
            at = {field.encode_name: field.type for field in at.fields}.get(step, at)
        else:
            at = getattr(at, "item_type", None) or getattr(at, "value_type", at)
    if isinstance(at, msgspec.inspect.StructType):
        return [field.encode_name for field in at.fields]
    if isinstance(at, msgspec.inspect.EnumType):
        return [member.value for member in at.cls if member.value]
    return list(map(str, getattr(at, "values", ())))


def _what(message: str) -> str:
    if m := _LENGTH.match(message):
        unit = "character" if m["kind"] == "str" else "item"
        return f"must have {_COMPARED[m['op']]} {m['n']} {unit}{'s' * (m['n'] != '1')}"
    if m := _RANGE.match(message):
        return f"must be {_COMPARED[m['op']]} {float(m['limit']):g}"
    if m := _KIND.match(message):
        return f"must be {_named(m['wanted'])}, is {_named(m['found'])}"
    if m := _FIELD.match(message):
        if m["what"] == "missing required":
            return f"lacks {m['name']}"
        return f"unknown key {quote(m['name'])}"
    if m := _VALUE.match(message):
        return f"unknown value {quote(m['value'].strip(chr(39)))}"
    return message[:1].lower() + message[1:]


def _named(kinds: str) -> str:
    return " or ".join(_KINDS.get(kind, kind) for kind in kinds.split(" | "))
