"""Libraries that come with an extra of the package: imported when needed, refused in one line without."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from hostlink.errors import UsageError

__all__ = ["require"]


def require(module: str, extra: str) -> Any:
    """The module. Raises UsageError: it is not installed; which extra brings it."""
    try:
        return import_module(module)
    except ImportError as error:
        raise UsageError(f'{error}: pip install "voronoi-touch[{extra}]"') from None
