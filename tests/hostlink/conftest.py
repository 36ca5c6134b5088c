"""What the tests of the host side share."""

from __future__ import annotations

import pytest

from hostlink import objects


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """An answer may take long on a busy machine."""
    monkeypatch.setattr(objects, "TIMEOUT_S", 5.0)
