"""What the tests of the host side share."""

from collections.abc import Iterator
from dataclasses import replace

import pytest

from edge.link import python_can, serial_line
from hostlink import links, objects
from tests.support.bus import Wire, open_wire
from tests.support.waiting import SOON_S


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """An answer, or a write, may take long on a busy machine."""
    monkeypatch.setattr(objects, "TIMEOUT_S", 5.0)
    monkeypatch.setattr(links, "WRITE_S", SOON_S)
    for module in (python_can, serial_line):
        monkeypatch.setattr(module, "PARAMS", replace(module.PARAMS, write_s=SOON_S))


@pytest.fixture
def wire(request: pytest.FixtureRequest) -> Iterator[Wire]:
    """A virtual bus with nothing on it, and a connection to it."""
    with open_wire(request.node.name) as made:
        yield made
