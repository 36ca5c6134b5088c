"""TOML files of rigs and protocols: read under the limits of `edge.limits`, errors are one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeVar

import msgspec

from edge import limits

__all__ = ["load_toml"]

T = TypeVar("T")


def load_toml(path: Path, kind: type[T]) -> tuple[dict[str, Any], T]:
    """The file's table as read, and decoded as the given type.

    Raises  ValueError: the error, without the file's name
    """
    try:
        table = limits.read_toml(path)
        limits.check_numbers(table)
        return table, msgspec.convert(table, kind)
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror}") from None
    except msgspec.ValidationError as error:
        raise ValueError(limits.explain(str(error))) from None
