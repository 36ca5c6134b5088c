"""What the program answers to bad input."""

from collections.abc import Callable
from typing import Any

import pytest

__all__ = ["one_line", "refused"]


def one_line(error: type[Exception], call: Callable[..., object], *arguments: Any, **options: Any) -> str:
    """The one line with which a call refuses its arguments."""
    with pytest.raises(error) as caught:
        call(*arguments, **options)
    message = str(caught.value)
    assert "\n" not in message
    return message


def refused(message: str, call: Callable[..., object], *arguments: Any, **options: Any) -> None:
    """Assert that a call refuses its arguments with a message like this one."""
    with pytest.raises(ValueError, match=message):
        call(*arguments, **options)
