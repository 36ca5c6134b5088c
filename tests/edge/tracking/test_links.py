"""Pieces of pins that move alike."""

import numpy as np
import pytest

from edge.tracking.match import Links

pytestmark = pytest.mark.kernels


def test_pieces_end_where_the_motion_differs_and_at_unknown_pins() -> None:
    pairs = np.array([[0, 1], [1, 2], [2, 3], [3, 4], [4, 5]], np.int32)
    links = Links(6, pairs, np.array([1.0, 1.0, 1.0, 1.0, 1.0]))
    motion = np.array([[0, 0], [0.9, 0], [1.8, 0], [3.0, 0], [3.0, 0], [3.0, 0]])
    label = links.pieces(motion, np.array([True, True, True, True, False, True]))
    assert label[0] == label[1] == label[2] != label[3]
    assert len({int(label[k]) for k in (2, 3, 4, 5)}) == 4
