"""A bus or a line without hardware, for sinks and nodes."""

from typing import Any

from edge.link.medium import Medium


class Trouble(dict[str, BaseException]):
    """What a driver raises, once, in its call of each name."""

    def call(self, name: str) -> None:
        if name in self:
            raise self.pop(name)


class Wire(Medium):
    """A medium that accepts everything, and receives nothing."""

    def __init__(self, instant: bool = True) -> None:
        self.instant = instant
        self.items: list[Any] = []

    def write(self, item: Any) -> None:
        self.items.append(item)

    def read(self, timeout_s: float) -> None:
        return None

    def close(self) -> None:
        """Nothing to close."""
