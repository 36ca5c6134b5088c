"""Where constants begin in memory, and that no row is cut off."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from edge.geometry.memory import aligned, short_rows
from edge.geometry.pair_sums import pair_rows


@pytest.mark.parametrize("array", [np.arange(7, dtype=np.int16), np.ones((3, 5))])
def test_a_copy_begins_with_a_line(array: NDArray[Any]) -> None:
    copies = [aligned(array) for _ in range(20)]
    for copy in copies:
        assert copy.dtype == array.dtype
        assert copy.__array_interface__["data"][0] % 64 == 0
        np.testing.assert_array_equal(copy, array)


def test_rows_keep_their_numbers() -> None:
    rows = np.array([[0, 1], [65_535, 2]], np.int32)
    assert short_rows(rows).dtype == np.uint16
    np.testing.assert_array_equal(short_rows(rows), rows)
    assert short_rows(np.empty((0, 6), np.int32)).shape == (0, 6)


@pytest.mark.parametrize("row", [-1, 65_536])
def test_rows_that_16_bits_do_not_hold_are_refused(row: int) -> None:
    rows = np.array([[0, row]], np.int32)
    with pytest.raises(ValueError, match="rows"):
        short_rows(rows)
    with pytest.raises(ValueError, match="rows"):
        pair_rows(rows, np.ones((1, 2)))
