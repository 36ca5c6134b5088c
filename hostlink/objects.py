"""Reading and writing a node's objects from the host: SDO on CAN (through `canopen`), requests on serial.

Both return the object's bytes or raise: ObjectAborted (refused, with the reason), LinkTimeout (no
answer), LinkDown (not sent).
"""

from __future__ import annotations

import logging
import queue
import struct
import threading
from collections.abc import Callable
from typing import Any, Protocol

from hostlink.errors import LinkTimeout, ObjectAborted
from hostlink.wire import (
    ABORTS,
    Message,
    ObjectReply,
    ObjectRequest,
    Op,
    encode_frame,
    object_at,
    pack_message,
)
from hostlink.wire.serial import CHUNK_MAX

__all__ = ["ObjectClient", "SdoObjects", "SerialObjects"]

TIMEOUT_S = 0.5  # of one request; a node answers within some ms
TRIES = 3
_HEAD = struct.Struct("<BHB")
_NAMES_OBJECT = (0x40, 0x60, 0x80)  # read, written, aborted; an answer to a segment does not


class ObjectClient(Protocol):
    """Access to one node's objects."""

    def read(self, index: int, sub: int) -> bytes: ...

    def write(self, index: int, sub: int, data: bytes) -> None: ...


class SdoObjects:
    """One node's SDO server, accessed through `canopen`'s client.

    send  sends (identifier, 8 bytes)
    """

    def __init__(
        self, node: int, request_id: int, response_id: int, send: Callable[[int, bytes], None]
    ) -> None:
        from canopen.objectdictionary import ObjectDictionary
        from canopen.sdo.client import SdoClient

        # `canopen` also logs what it raises; without a handler that would be more lines on stderr.
        logging.getLogger("canopen").addHandler(logging.NullHandler())

        self._node = node
        self._response_id = response_id
        self._asking = threading.Lock()  # one transfer at a time: the server has one
        client: Any = SdoClient(request_id, response_id, ObjectDictionary())
        client.RESPONSE_TIMEOUT = TIMEOUT_S
        client.MAX_RETRIES = TRIES
        client.network = _SendOnlyNetwork(send)
        self._client = client
        self._object = (0, 0)  # of the transfer under way
        self._last = b""

    def answer(self, data: bytes) -> None:
        """A message from the SDO server.

        A request is repeated if its answer is late, and then there are two. The second is dropped: the toggle
        bit makes answers to different segments differ, and all others name their object.
        """
        command, index, sub = _HEAD.unpack_from(data)
        names_object = command & 0xE0 in _NAMES_OBJECT and (index, sub) != (0, 0)
        if data == self._last or (names_object and (index, sub) != self._object):
            return
        self._last = bytes(data)
        self._client.on_response(self._response_id, bytearray(data), 0.0)

    def read(self, index: int, sub: int) -> bytes:
        return bytes(self._ask(index, sub, lambda: self._client.upload(index, sub)))

    def write(self, index: int, sub: int, data: bytes) -> None:
        self._ask(index, sub, lambda: self._client.download(index, sub, data))

    def _ask(self, index: int, sub: int, transfer: Callable[[], Any]) -> Any:
        from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

        with self._asking:
            self._object, self._last = (index, sub), b""
            try:
                return transfer()
            except SdoAbortedError as error:
                raise aborted(index, sub, int(error.code)) from None
            except SdoCommunicationError as error:
                raise LinkTimeout(f"finger {self._node} did not answer ({error})") from None


class _SendOnlyNetwork:
    """The part of a network that `canopen`'s client needs."""

    def __init__(self, send: Callable[[int, bytes], None]) -> None:
        self._send = send

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        self._send(can_id, bytes(data))


class SerialObjects:
    """The node at the other end of a serial line.

    send  writes bytes
    """

    def __init__(self, send: Callable[[bytes], None]) -> None:
        self._send = send
        self._asking = threading.Lock()
        self._replies: queue.SimpleQueue[tuple[int, ObjectReply]] = queue.SimpleQueue()
        self._counter = 0

    def answer(self, counter: int, reply: ObjectReply) -> None:
        """A reply from the line."""
        self._replies.put((counter, reply))

    def read(self, index: int, sub: int) -> bytes:
        data = b""
        with self._asking:
            while True:
                reply = self._ask(ObjectRequest(Op.READ, index, sub, len(data)))
                data += reply.data
                if len(data) >= reply.total or not reply.data:
                    return data

    def write(self, index: int, sub: int, data: bytes) -> None:
        with self._asking:
            for offset in range(0, max(1, len(data)), CHUNK_MAX):
                chunk = data[offset : offset + CHUNK_MAX]
                self._ask(ObjectRequest(Op.WRITE, index, sub, offset, len(data), chunk))

    def _ask(self, request: ObjectRequest) -> ObjectReply:
        """Repeat the request until there is an answer. The counter stays the same: a node that has served it
        repeats its answer.
        """
        self._counter = (self._counter + 1) & 0xFF
        frame = encode_frame(Message.REQUEST, pack_message(Message.REQUEST, request.pack(), self._counter))
        for _ in range(TRIES):
            self._send(frame)
            reply = self._await(request)
            if reply is None:
                continue
            if reply.abort:
                raise aborted(request.index, request.sub, reply.abort)
            return reply
        raise LinkTimeout(f"the finger did not answer ({TRIES} times {TIMEOUT_S:g} s)")

    def _await(self, request: ObjectRequest) -> ObjectReply | None:
        while True:
            try:
                counter, reply = self._replies.get(timeout=TIMEOUT_S)
            except queue.Empty:
                return None
            if counter == self._counter and (reply.index, reply.sub) == (request.index, request.sub):
                return reply


def aborted(index: int, sub: int, code: int) -> ObjectAborted:
    """The error for an abort code."""
    try:
        name = object_at(index, sub).name
    except KeyError:  # accessed by its number, on a newer node
        name = ""
    return ObjectAborted(index, sub, code, ABORTS.get(code, "refused"), name)
