"""What the tests of the host side share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from hostlink import objects
from tests.support.bus import Wire, open_wire


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """An answer may take long on a busy machine."""
    monkeypatch.setattr(objects, "TIMEOUT_S", 5.0)


@pytest.fixture
def wire(request: pytest.FixtureRequest) -> Iterator[Wire]:
    """A virtual bus with nothing on it, and a connection to it."""
    with open_wire(request.node.name) as made:
        yield made
