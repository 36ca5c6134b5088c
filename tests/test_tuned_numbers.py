"""Chosen numbers are few, and each has its evidence in docs/tuning.md."""

import re

from tests.support.tuned_numbers import EXEMPT, ROOT, tuned_numbers

#: How many there may be. Lower it when there are fewer; a new number needs an old one to go.
AT_MOST = 119
WORDS_MAX = 3000


def _page() -> str:
    return (ROOT / "docs" / "tuning.md").read_text(encoding="utf-8")


def _rows() -> list[list[str]]:
    """The cells of each row that describes numbers."""
    lines = [line for line in _page().splitlines() if line.startswith("`") and "|" in line]
    return [[cell.strip() for cell in line.split("|")] for line in lines]


def test_there_are_no_more_chosen_numbers_than_before() -> None:
    counted = {stage: len(names) for stage, names in tuned_numbers().items() if names}
    print(counted)
    assert sum(counted.values()) <= AT_MOST, "replace a number, or use a model that needs none"


def test_exemptions_name_what_exists() -> None:
    for entry in EXEMPT:
        file, _, name = entry.partition(":")
        text = (ROOT / file).read_text(encoding="utf-8")
        assert re.search(rf"^.*\b{name}\b.*=", text, re.M), f"{entry} is gone"


def test_every_number_has_its_row_and_every_row_its_number() -> None:
    names = {name for cells in _rows() for name in re.findall(r"`([^`]+)`", cells[0])}
    chosen = {re.split("[:.]", entry)[-1] for entries in tuned_numbers().values() for entry in entries}
    assert not chosen - names
    code = "\n".join(
        path.read_text(encoding="utf-8")
        for folder in ("edge", "calib", "hostlink")
        for path in (ROOT / folder).rglob("*.py")
    )
    gone = [name for name in names if not re.search(rf"\b{name}\b[^=\n]*= ", code)]
    assert not gone


def test_the_page_of_numbers_can_be_read() -> None:
    assert len(_page().split()) <= WORDS_MAX
    for cells in _rows():
        assert len(cells) == 5, f"name, unit, value, why, command: {cells}"
        assert all(cells[i] for i in (0, 2, 3, 4)), cells
