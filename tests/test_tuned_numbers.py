"""Chosen numbers are few, and each has its evidence in docs/tuning.md."""

from __future__ import annotations

import fnmatch
import re
from pathlib import Path

from tests.support.tuned_numbers import NOT_TUNED, ROOT, tuned_numbers

#: How many there may be. Lower it when there are fewer; a new number needs an old one to go.
AT_MOST = {
    "calibration": 17,
    "cells": 9,
    "cli": 15,
    "edge": 14,
    "faults": 4,
    "features": 17,
    "geometry": 9,
    "link": 16,
    "pins": 30,
    "recording": 6,
    "rest": 3,
    "shared": 10,
    "sources": 28,
    "tracking": 24,
    "view": 10,
    "worker": 21,
}


def test_there_are_no_more_chosen_numbers_than_before() -> None:
    counted = {stage: len(names) for stage, names in tuned_numbers().items() if names}
    print(counted)
    more = {stage: n for stage, n in counted.items() if n > AT_MOST.get(stage, 0)}
    assert not more, f"at most {AT_MOST}: replace a number, or use a model that needs none"


def test_exemptions_name_what_exists() -> None:
    for reason, names in NOT_TUNED.items():
        for entry in names:
            file, _, name = entry.partition(":")
            text = (ROOT / file).read_text(encoding="utf-8")
            assert re.search(rf"^.*\b{name}\b.*=", text, re.M), f"{entry} ({reason}) is gone"


def test_every_number_has_its_evidence() -> None:
    tuning = (Path(ROOT) / "docs" / "tuning.md").read_text(encoding="utf-8")
    rows = {name for line in tuning.splitlines() for name in re.findall(r"`([^`]+)`", line)}
    missing = [
        entry
        for names in tuned_numbers().values()
        for entry in names
        if not any(fnmatch.fnmatch(re.split("[:.]", entry)[-1], row) for row in rows)
    ]
    assert not missing
