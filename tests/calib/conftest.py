"""What tests of the calibration share."""

from collections.abc import Iterator
from dataclasses import replace

import pytest

from calib import process_fit, process_likelihood


@pytest.fixture(scope="module")
def quick_fits() -> Iterator[None]:
    """Fits that are far from the most likely settings, in a few per cent of the time."""
    with pytest.MonkeyPatch.context() as patched:
        likelihood = replace(process_likelihood.PARAMS, turns=4, steps=2)
        patched.setattr(process_likelihood, "PARAMS", likelihood)
        patched.setattr(process_fit, "PARAMS", replace(process_fit.PARAMS, groups_min=2, rows_groups=2))
        yield
