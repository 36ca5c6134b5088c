"""Objects over SDO, asked of a node whose answers are late."""

from __future__ import annotations

from typing import Any

import pytest

from edge.link.sdo_server import SdoServer
from hostlink import objects
from hostlink.errors import LinkTimeout
from hostlink.objects import SdoObjects
from hostlink.wire import CanIds, Kind

NODE, INDEX = 5, 0x2030
ABORT = 0x80


class Store:
    """One object that can be written and read."""

    refusal = ""

    def __init__(self) -> None:
        self.value = b""
        self.writes_n = 0

    def read(self, index: int, sub: int) -> bytes:
        return self.value

    def write(self, index: int, sub: int, data: bytes) -> None:
        self.value = data
        self.writes_n += 1


class LateNode:
    """Answers a request when it comes for the second time, and then answers both."""

    def __init__(self) -> None:
        self.store = Store()
        server: Any = self.store
        self.server = SdoServer(server, self.deliver)
        self.waiting = b""
        ids = CanIds()
        self.objects = SdoObjects(
            NODE, ids.of(Kind.SDO_REQUEST, NODE), ids.of(Kind.SDO_RESPONSE, NODE), self.take
        )

    def deliver(self, data: bytes) -> None:
        self.objects.answer(data)

    def take(self, can_id: int, data: bytes) -> None:
        if data[0] == ABORT:
            raise AssertionError("the client gave up")
        if data != self.waiting:
            self.waiting = data
            return
        self.waiting = b""
        for _ in range(2):
            self.server.request(data)


@pytest.mark.parametrize("size", [2, 30])
def test_late_answers_disturb_no_transfer(monkeypatch: pytest.MonkeyPatch, size: int) -> None:
    monkeypatch.setattr(objects, "TIMEOUT_S", 0.01)
    monkeypatch.setattr(objects, "TRIES", 1000)  # on a busy machine
    node = LateNode()
    value = bytes(range(size))
    node.objects.write(INDEX, 0, value)
    assert node.store.value == value
    assert node.objects.read(INDEX, 0) == value


def test_an_answer_that_comes_after_its_transfer_is_not_taken_for_another(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(objects, "TIMEOUT_S", 0.01)
    sent: list[bytes] = []
    client = SdoObjects(NODE, 0x605, 0x585, lambda _, data: sent.append(data))

    def late(can_id: int, data: bytes) -> None:
        client.answer(bytes((0x4B, 0x18, 0x10, 1, 7, 0, 0, 0)))  # of object 0x1018
        client.answer(bytes((0x80, 0x18, 0x10, 1, 0, 0, 0, 6)))

    with pytest.raises(LinkTimeout):
        client.read(0x1018, 1)
    client._client.network = objects._SendOnlyNetwork(late)
    with pytest.raises(LinkTimeout):
        client.read(INDEX, 0)
