"""A frame takes no more instructions and cache misses than when it was last made cheaper."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.bench.instructions import VARIANTS, count, record

#: This recording's frame then.
INSTRUCTIONS, LL_MISSES = 858_000, 12_700
MARGIN = 1.05


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("valgrind") is None, reason="needs valgrind (.ci/packages)")
def test_a_frame_takes_no_more_than_before(tmp_path: Path) -> None:
    counts = count(VARIANTS["contact"][2], record("contact", tmp_path), tmp_path)
    assert counts.instructions <= MARGIN * INSTRUCTIONS, counts.stages()
    assert counts.ll_misses <= MARGIN * LL_MISSES
