"""Libraries of the package's extras: imported when needed; a missing one is one line."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from hostlink.errors import UsageError

__all__ = ["require"]


def require(module: str, extra: str) -> Any:
    """The module. Raises UsageError: not installed; the message names the extra."""
    try:
        return import_module(module)
    except ImportError as error:
        raise UsageError(f'{error}: pip install "voronoi-touch[{extra}]" or -e ".[{extra}]"') from None
