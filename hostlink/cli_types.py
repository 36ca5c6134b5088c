"""Numbers on a command line, for all three programs: as they are given, and as they are said.

@click.option("--seconds", type=FiniteFloat(min=0, min_open=True))      # NaN and infinity are no numbers
@click.option("--finger", type=WholeNumber(1, 127))
click.echo(counted(1, "sample"))                                        # 1 sample; 2 samples
"""

from __future__ import annotations

from math import isfinite, isnan
from threading import TIMEOUT_MAX
from typing import Any

import click

__all__ = ["FiniteFloat", "WholeNumber", "channel_option", "counted", "seconds_option"]


class FiniteFloat(click.FloatRange):
    """A finite number, within optional limits, as in `click.FloatRange`."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        try:
            number = float(value)
        except (TypeError, ValueError, OverflowError):
            self.fail(f"{value!r} is not a number; give {_what('a number', self)}", param, ctx)
        if not isfinite(number):
            what = "a number" if isnan(number) else "finite"
            self.fail(f"{value!r} is not {what}; give {_what('a number', self)}", param, ctx)
        try:
            return float(super().convert(number, param, ctx))
        except click.BadParameter:
            self.fail(f"{value} is out of range; give {_what('a number', self)}", param, ctx)


class WholeNumber(click.IntRange):
    """A whole number, within optional limits, as in `click.IntRange`."""

    name = "whole number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        try:
            number = int(value)
        except (TypeError, ValueError, OverflowError):
            self.fail(f"{value!r} is not a whole number; give {_what('a whole number', self)}", param, ctx)
        try:
            return int(super().convert(number, param, ctx))
        except click.BadParameter:
            self.fail(f"{value} is out of range; give {_what('a whole number', self)}", param, ctx)


seconds_option = click.option(
    "--seconds",
    type=FiniteFloat(min=0, min_open=True, max=TIMEOUT_MAX),  # the longest that Python can wait
    help="Stop after this time; else at Ctrl-C.",
)

channel_option = click.option(
    "--channel", help="The bus, in a log of several: its name, or its number from 0 in .blf and .asc."
)


def counted(n: int, noun: str) -> str:
    """`1 sample`, `2 samples`."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"


def _what(kind: str, limits: click.FloatRange | click.IntRange) -> str:
    low, high = limits.min, limits.max
    if low is not None and high is not None and not (limits.min_open or limits.max_open):
        return f"{kind} from {low} to {high}"
    least = None if low is None else f"above {low}" if limits.min_open else f"of {low} or more"
    most = None if high is None else f"below {high}" if limits.max_open else f"up to {high}"
    return " ".join([kind, " and ".join(filter(None, (least, most)))]).rstrip()
