"""NaN and infinity are refused on a command line, and the message gives a right value."""

import click
import pytest

from hostlink.cli_types import FiniteFloat, WholeNumber, counted

ABOVE_0, TO_127 = FiniteFloat(min=0, min_open=True), WholeNumber(1, 127)
NUMBER = "is not a number; give a number above 0"
FINITE = "is not finite; give a number above 0"
WHOLE = "is not a whole number; give a whole number from 1 to 127"


@pytest.mark.parametrize(
    ("kind", "text", "message"),
    [
        *((ABOVE_0, text, NUMBER) for text in ("nan", "NaN", "abc", "", "0x10")),
        *((ABOVE_0, text, FINITE) for text in ("inf", "-inf", "1e999")),
        *((TO_127, text, WHOLE) for text in ("nan", "inf", "1.5", "abc", "1e3")),
        (FiniteFloat(0, 2), "2.1", "out of range"),
        (ABOVE_0, "0", "out of range"),
        (WholeNumber(1, 3), "4", "out of range"),
    ],
)
def test_other_numbers_are_refused(kind: FiniteFloat | WholeNumber, text: str, message: str) -> None:
    with pytest.raises(click.BadParameter, match=message):
        kind.convert(text, None, None)


def test_numbers_within_the_limits_are_taken() -> None:
    assert FiniteFloat(0, 2).convert("1.5", None, None) == 1.5
    assert FiniteFloat().convert("-1e300", None, None) == -1e300
    assert TO_127.convert("127", None, None) == 127


def test_one_of_a_thing_is_singular() -> None:
    assert [counted(n, "frame") for n in (0, 1, 2)] == ["0 frames", "1 frame", "2 frames"]
