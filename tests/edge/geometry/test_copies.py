"""A copy stays as it is while somebody holds it, or a part of it; then its memory is used again."""

from typing import Any

import numpy as np
import pytest

from edge.geometry.copies import Copies

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize("hold", [np.asarray, np.transpose, memoryview, lambda array: array[1:, ::2]])
def test_held_copies_stay_and_others_are_used_again(hold: Any) -> None:
    source, held = np.zeros((3, 4)), list[Any]()
    copies = Copies(source)
    for k in range(9):
        source[:] = k
        held.append(hold(copies.take()))
    assert [np.unique(part).tolist() for part in held] == [[k] for k in range(9)]
    held.clear()
    assert len({copies.take().ctypes.data for _ in range(9)}) == 1
