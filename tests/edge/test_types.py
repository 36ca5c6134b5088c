"""What flows between the stages: unchanged once it is made, and copied with changes as any dataclass."""

from dataclasses import replace

import numpy as np
import pytest

from edge.types import Tracks


def test_an_object_of_a_frame_is_copied_with_changes_and_stays_unchanged() -> None:
    before = Tracks.of(np.zeros((3, 2)), np.ones(3), np.array([True, False, True]), 0.98)
    with pytest.raises(AttributeError):
        before.confidence = 0.0  # type: ignore[misc]
    after = replace(before, confidence=0.5)
    assert (after.confidence, before.confidence) == (0.5, 0.98)
    assert after.xy_img is before.xy_img
