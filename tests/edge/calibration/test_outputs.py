"""Outputs of models by name and by place."""

import math

import numpy as np
import pytest

from edge.calibration.polynomial import OutputRow


def row() -> OutputRow:
    outputs = OutputRow(("force_n", "contact_x_mm", "contact_y_mm"))
    outputs.rows[:] = [[1.5, 0.1, 0.0], [2.5, 0.2, 1.0], [math.nan, 0.3, 1.0]]
    return outputs


def test_values_sigmas_and_what_is_out_of_range_by_name() -> None:
    values, sigmas, outside = row().by_name()
    assert list(values) == list(sigmas) == ["force_n", "contact_x_mm", "contact_y_mm"]
    np.testing.assert_array_equal(list(values.values()), [1.5, 2.5, math.nan])
    assert list(sigmas.values()) == [0.1, 0.2, 0.3]
    assert outside == {"contact_x_mm"}  # what is not known is not out of range
    values["force_n"] = 0.0
    assert row().by_name()[0]["force_n"] == 1.5


def test_values_are_put_to_their_places_and_the_others_stay() -> None:
    numbers = [7.0, 8.0, 9.0, 10.0]
    row().write_into(numbers, (3, 0, 1))
    np.testing.assert_array_equal(numbers, [2.5, math.nan, 9.0, 1.5])
    for places in ((0, 1), (0, 1, 2, 3), (0, 1, 4), (0, -1, 2)):
        with pytest.raises(ValueError, match="are wanted"):
            row().write_into(numbers, places)
