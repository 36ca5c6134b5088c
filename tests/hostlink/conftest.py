"""How long the generative tests go on: a little in `make test`, FUZZ_ROUNDS times as long in `make fuzz`."""

from __future__ import annotations

import os

import pytest

ROUNDS = int(os.environ.get("FUZZ_ROUNDS", "1"))


@pytest.fixture
def clock_rounds() -> int:
    return 20 * ROUNDS


@pytest.fixture
def classic_rounds() -> int:
    return 4 * ROUNDS
