"""What the program answers to bad input."""

from collections.abc import Callable
from typing import Any

import pytest


def one_line(error: type[Exception], call: Callable[..., object], *arguments: Any, **options: Any) -> str:
    """The one line with which a call refuses its arguments."""
    with pytest.raises(error) as caught:
        call(*arguments, **options)
    message = str(caught.value)
    assert "\n" not in message
    return message
