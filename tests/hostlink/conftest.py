"""Number of rounds of the generative tests: few in `make test`, FUZZ_ROUNDS times as long in `make fuzz`."""

from __future__ import annotations

import os

import pytest

from hostlink import objects

ROUNDS = int(os.environ.get("FUZZ_ROUNDS", "1"))


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """An answer may take long on a busy machine."""
    monkeypatch.setattr(objects, "TIMEOUT_S", 5.0)


@pytest.fixture
def clock_rounds() -> int:
    return 20 * ROUNDS


@pytest.fixture
def classic_rounds() -> int:
    return 4 * ROUNDS
