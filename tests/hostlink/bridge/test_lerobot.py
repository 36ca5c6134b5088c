"""The observations that the documentation shows for LeRobot."""

import re
from math import isnan
from pathlib import Path
from typing import Any

import pytest

import hostlink
from tests.hostlink.bridge.hand import Hand
from tests.hostlink.bridge.test_foxglove import state
from tests.support.waiting import until


def test_observations_have_the_features_by_name(request: pytest.FixtureRequest) -> None:
    text = (Path(hostlink.__file__).parents[1] / "docs" / "robot.md").read_text(encoding="utf-8")
    found = re.search(r"## LeRobot\n.*?```python\n(.*?)```", text, re.DOTALL)
    assert found is not None
    shown: dict[str, Any] = {}
    exec(found[1], shown)
    features = shown["observation_features"]([1, 3, 4])
    hand = Hand(f"lerobot-{request.node.name}", (1, 3), state)
    try:
        until(lambda: all(hand.connection.latest(n) for n in (1, 3)), "both fingers")
        until(lambda: shown["observe"](hand.connection, [3])["finger_3.displacement_mm"] == 0.75, "a sample")
        seen = shown["observe"](hand.connection, [1, 3, 4])
        assert seen.keys() == features.keys()
        assert all(isinstance(value, features[name]) for name, value in seen.items())
        assert isnan(seen["finger_4.displacement_mm"]), "not there"
    finally:
        hand.close()
