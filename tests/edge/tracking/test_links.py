"""Pieces of pins that move alike; wrong sizes and indices are refused."""

import numpy as np
import pytest

from edge.tracking.match import Links
from tests.support.refusals import refused

pytestmark = pytest.mark.kernels


def test_pieces_end_where_the_motion_differs_and_at_unknown_pins() -> None:
    pairs = np.array([[0, 1], [1, 2], [2, 3], [3, 4], [4, 5]], np.int32)
    links = Links(6, pairs, np.array([1.0, 1.0, 1.0, 1.0, 1.0]))
    motion = np.array([[0, 0], [0.9, 0], [1.8, 0], [3.0, 0], [3.0, 0], [3.0, 0]])
    label = links.pieces(motion, np.array([True, True, True, True, False, True]))
    assert label[0] == label[1] == label[2] != label[3]
    assert len({int(label[k]) for k in (2, 3, 4, 5)}) == 4


@pytest.mark.parametrize("pin", [-1, 3])
def test_links_to_a_pin_that_does_not_exist_are_refused(pin: int) -> None:
    refused("pins of 0 to 2", Links, 3, np.array([[0, 1], [1, pin]], np.int32), np.ones(2))


def test_links_refuse_other_sizes() -> None:
    refused("a limit for each", Links, 3, np.array([[0, 1], [1, 2]], np.int32), np.ones(3))
    links = Links(3, np.array([[0, 1], [1, 2]], np.int32), np.ones(2))
    for motion, known in (((2, 2), 3), ((3, 2), 2), ((3, 3), 3)):
        refused(r"motion \(3, 2\)", links.pieces, np.zeros(motion), np.ones(known, bool))
