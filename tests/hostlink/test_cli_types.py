"""NaN and infinity are refused on a command line, and the message gives a right value."""

from __future__ import annotations

import click
import pytest

from hostlink.cli_types import FiniteFloat, WholeNumber, counted


@pytest.mark.parametrize("text", ["nan", "NaN", "abc", "", "0x10"])
def test_non_numbers_are_refused(text: str) -> None:
    with pytest.raises(click.BadParameter, match="is not a number; give a number above 0"):
        FiniteFloat(min=0, min_open=True).convert(text, None, None)


@pytest.mark.parametrize("text", ["inf", "-inf", "1e999"])
def test_non_finite_numbers_are_refused(text: str) -> None:
    with pytest.raises(click.BadParameter, match="is not finite; give a number above 0"):
        FiniteFloat(min=0, min_open=True).convert(text, None, None)


def test_one_of_a_thing_is_singular() -> None:
    assert [counted(n, "frame") for n in (0, 1, 2)] == ["0 frames", "1 frame", "2 frames"]


@pytest.mark.parametrize("text", ["nan", "inf", "1.5", "abc", "1e3"])
def test_non_whole_numbers_are_refused(text: str) -> None:
    with pytest.raises(click.BadParameter, match="is not a whole number; give a whole number from 1 to 127"):
        WholeNumber(1, 127).convert(text, None, None)


def test_limits_hold() -> None:
    assert FiniteFloat(0, 2).convert("1.5", None, None) == 1.5
    assert FiniteFloat().convert("-1e300", None, None) == -1e300
    assert WholeNumber(1, 127).convert("127", None, None) == 127
    for kind, text in (
        (FiniteFloat(0, 2), "2.1"),
        (FiniteFloat(0, min_open=True), "0"),
        (WholeNumber(1, 3), "4"),
    ):
        with pytest.raises(click.BadParameter):
            kind.convert(text, None, None)
