"""A view follows the array that it is given."""

import numpy as np
import pytest

from edge.features.modes import Modes
from tests.support.fields import tip

pytestmark = pytest.mark.kernels


def test_an_array_that_is_given_again_is_read_again_and_another_one_too() -> None:
    rest = tip(61)
    modes, everyone = Modes(rest), np.ones(len(rest), np.bool_)
    motion = np.random.default_rng(0).normal(size=(len(rest), 2))
    one = modes.fit(motion, everyone)
    np.testing.assert_allclose(modes.fit(2.0 * motion, None), 2.0 * one, rtol=0, atol=1e-5)
    motion *= 3.0
    np.testing.assert_allclose(modes.fit(motion, None), 3.0 * one, rtol=0, atol=1e-5)
    np.testing.assert_allclose(modes.fit(motion, None), 3.0 * one, rtol=0, atol=1e-5)
