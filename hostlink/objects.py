"""Reading and writing a node's objects from the host: SDO on CAN, requests on serial.

Both return the object's bytes or raise: ObjectAborted (refused, with the reason), LinkTimeout (no
answer), LinkDown (not sent). A request is repeated until it is answered or its time is over, whatever else
arrives; a node recognises a repetition and does nothing twice.
"""

from __future__ import annotations

import os
import queue
import random
import threading
import time
from collections import deque
from collections.abc import Callable, Set
from contextlib import suppress
from typing import Protocol

from hostlink.errors import LinkDown, LinkTimeout, ObjectAborted
from hostlink.sdo_channel import SdoChannel, Whose
from hostlink.wire import (
    ABORTS,
    Abort,
    Message,
    ObjectReply,
    ObjectRequest,
    Op,
    encode_frame,
    object_at,
    pack_message,
)
from hostlink.wire.sdo import (
    EXPEDITED,
    HEAD,
    LAST,
    SEGMENT,
    SIZE_GIVEN,
    TOGGLE,
    Sdo,
    expedited,
    pack_abort,
    pack_segment,
    segment_data,
)
from hostlink.wire.serial import CHUNK_MAX

__all__ = ["ObjectClient", "SdoObjects", "SerialObjects"]

TIMEOUT_S = 0.5  # of one request; a node answers within some ms
TRIES = 3
GRACE_S = 0.01  # for another host's next frame; pauses after a collision are random up to this
_ALWAYS_THERE = ObjectRequest(Op.READ, 0x1000, 0)
_BUSY = "another host keeps the finger busy with a long value; ask again when it is done"
_UPSET = frozenset({Abort.TOGGLE, Abort.COMMAND})  # segments that another's frame has disturbed


class ObjectClient(Protocol):
    """Access to one node's objects."""

    def read(self, index: int, sub: int) -> bytes: ...

    def write(self, index: int, sub: int, data: bytes) -> None: ...


class _Disturbed(Exception):
    """Another host uses the channel; worth another attempt. `code`: the server's."""

    def __init__(self, code: int) -> None:
        super().__init__(f"0x{code:08X}")
        self.code = code


class SdoObjects:
    """One node's SDO server.

    send    sends (identifier, 8 bytes)
    echoes  what is sent comes back, as if it were another host's
    """

    def __init__(
        self,
        node: int,
        request_id: int,
        response_id: int,
        send: Callable[[int, bytes], None],
        echoes: bool = False,
    ) -> None:
        self._node, self._request_id, self._response_id = node, request_id, response_id
        self._send_frame = send
        self._to_come_back = deque[bytes](maxlen=TRIES if echoes else 0)
        self._asking = threading.Lock()  # one transfer at a time: the server has one
        self._changed = threading.Condition()  # guards what follows
        self._channel = SdoChannel(TIMEOUT_S, GRACE_S)
        self._answer = b""
        self._unclear = False
        self._write_n = int.from_bytes(os.urandom(3), "little")

    def answer(self, data: bytes) -> None:
        """A message from the SDO server, to this host or to another."""
        with self._changed:
            whose = self._channel.answer(data)
            if whose is Whose.OURS:
                self._answer = data
            self._unclear |= whose is Whose.UNCLEAR
            self._changed.notify_all()

    def overhear(self, data: bytes) -> None:
        """Another host's message to the SDO server."""
        with self._changed:
            if data in self._to_come_back:
                self._to_come_back.remove(data)
            else:
                self._channel.overhear(data, time.monotonic())

    def _send(self, data: bytes) -> None:
        self._to_come_back.append(data)
        self._send_frame(self._request_id, data)

    def read(self, index: int, sub: int) -> bytes:
        return self._transfer(index, sub, lambda: self._upload(index, sub))

    def write(self, index: int, sub: int, data: bytes) -> None:
        self._transfer(index, sub, lambda: self._download(index, sub, data))

    def _transfer(self, index: int, sub: int, run: Callable[[], bytes]) -> bytes:
        """Repeat a transfer that another host's has disturbed, or has to wait for."""
        end_s = time.monotonic() + TRIES * TIMEOUT_S
        with self._asking:
            while True:
                begun_s = time.monotonic()
                self._wait_for_turn(HEAD.pack(0, index, sub)[1:], end_s)
                try:
                    return run()
                except _Disturbed as error:
                    if error.code != Abort.NOT_NOW:
                        self._abort(index, sub, error.code)
                    if begun_s >= end_s:
                        raise aborted(index, sub, error.code, _BUSY) from None
                    _pause()
                except LinkTimeout:
                    self._abort(index, sub, Abort.TIMEOUT)
                    raise

    def _abort(self, index: int, sub: int, code: int) -> None:
        """Give the server free for others."""
        with suppress(LinkDown):
            self._send(pack_abort(index, sub, code))

    def _wait_for_turn(self, what: bytes, end_s: float) -> None:
        """Wait while another host transfers the same object: nothing would tell its segments from ours."""
        self._wait_while(lambda now_s: self._channel.busy_s(what, now_s), end_s)

    def _wait_while(self, busy_s: Callable[[float], float], end_s: float) -> None:
        """Wait for as long as this says, asked anew after each message."""
        with self._changed:
            while (now_s := time.monotonic()) < end_s and (left_s := busy_s(now_s)) > 0:
                self._changed.wait(min(left_s, end_s - now_s))

    def _upload(self, index: int, sub: int) -> bytes:
        answer = self._exchange(HEAD.pack(Sdo.UPLOAD, index, sub) + bytes(4), index, sub, {Abort.NOT_NOW})
        if answer[0] & EXPEDITED:
            return answer[4 : 8 - (answer[0] >> 2 & 3 if answer[0] & SIZE_GIVEN else 0)]
        size = int.from_bytes(answer[4:], "little") if answer[0] & SIZE_GIVEN else None
        value, command = bytearray(), Sdo.UPLOAD_SEGMENT
        while True:
            answer = self._exchange(bytes((command,)) + bytes(7), index, sub, _UPSET)
            value += segment_data(answer)
            command ^= TOGGLE
            if answer[0] & LAST or (size is not None and len(value) > size):
                break
        if size not in (None, len(value)):  # a segment went to another host
            raise _Disturbed(Abort.TOGGLE)
        return bytes(value)

    def _download(self, index: int, sub: int, data: bytes) -> bytes:
        if 0 < len(data) <= 4:
            return self._exchange(
                expedited(Sdo.DOWNLOAD, index, sub, data, self._mark(4 - len(data))), index, sub
            )
        head = HEAD.pack(Sdo.DOWNLOAD | SIZE_GIVEN, index, sub)
        self._exchange(head + len(data).to_bytes(4, "little"), index, sub, {Abort.NOT_NOW})
        command = Sdo.DOWNLOAD_SEGMENT
        for at in range(0, max(1, len(data)), SEGMENT):
            last = LAST if at + SEGMENT >= len(data) else 0
            self._exchange(pack_segment(command | last, data[at : at + SEGMENT]), index, sub, _UPSET)
            command ^= TOGGLE
        return b""

    def _mark(self, size: int) -> bytes:
        """Another number each time, for the bytes behind a value: with it a node tells a repetition from a
        request that is made again. Zeros would be no mark."""
        self._write_n += 1
        return (1 + self._write_n % (256**size - 1)).to_bytes(size, "little") if size else b""

    def _exchange(self, request: bytes, index: int, sub: int, disturbed: Set[int] = frozenset()) -> bytes:
        """The answer to a request. Raises _Disturbed: aborted with one of these codes."""
        end_s = time.monotonic() + TRIES * TIMEOUT_S
        while True:
            self._wait_while(self._channel.blocked_s, end_s)
            if (now_s := time.monotonic()) >= end_s:
                break
            with self._changed:
                if not self._channel.ask(request, now_s):
                    raise _Disturbed(Abort.TOGGLE)
                self._answer, self._unclear = b"", False
            self._send(request)
            with self._changed:
                self._changed.wait_for(lambda: self._answer or self._unclear, min(TIMEOUT_S, end_s - now_s))
                answer, unclear = self._answer, self._unclear
            if answer[:1] == bytes((Sdo.ABORT,)):
                code = int.from_bytes(answer[4:], "little")
                raise _Disturbed(code) if code in disturbed else aborted(index, sub, code)
            if answer:
                return answer
            if unclear:
                self._wait_while(self._channel.unanswered_s, end_s)
                _pause()
        if self._channel.blocked_s(now_s) > 0.0:
            raise aborted(index, sub, Abort.NOT_NOW, _BUSY)
        raise LinkTimeout(
            f"finger {self._node} did not answer on 0x{self._response_id:X} ({TRIES} times {TIMEOUT_S:g} s)"
        )


def _pause() -> None:
    """Let another host's frames pass; random, so that two hosts do not collide again."""
    threading.Event().wait(random.uniform(0.0, GRACE_S))


class SerialObjects:
    """The node at the other end of a serial line.

    send  writes bytes
    """

    def __init__(self, send: Callable[[bytes], None]) -> None:
        self._send = send
        self._asking = threading.Lock()
        self._replies: queue.SimpleQueue[tuple[int, ObjectReply]] = queue.SimpleQueue()
        self._counter: int | None = None

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
        """The reply to a request.

        A node repeats its last answer where counter and request are the last ones again. The counters of this
        connection and of the one before may meet; the first request is therefore one whose answer nobody
        needs.
        """
        if self._counter is None:
            self._exchange(_ALWAYS_THERE, first := os.urandom(1)[0])
            self._counter = first
        self._counter = (self._counter + 1) & 0xFF
        reply = self._exchange(request, self._counter)
        if reply.abort:
            raise aborted(request.index, request.sub, reply.abort)
        return reply

    def _exchange(self, request: ObjectRequest, counter: int) -> ObjectReply:
        """Repeat the request, with the same counter, until there is an answer."""
        frame = encode_frame(Message.REQUEST, pack_message(Message.REQUEST, request.pack(), counter))
        end_s = time.monotonic()
        for _ in range(TRIES):
            self._send(frame)
            end_s += TIMEOUT_S
            while (left_s := end_s - time.monotonic()) > 0:
                with suppress(queue.Empty):
                    got, reply = self._replies.get(timeout=left_s)
                    if got == counter and (reply.index, reply.sub) == (request.index, request.sub):
                        return reply
        raise LinkTimeout(f"the finger did not answer ({TRIES} times {TIMEOUT_S:g} s)")


def aborted(index: int, sub: int, code: int, reason: str = "") -> ObjectAborted:
    """The error for an abort code, if need be with a better reason."""
    try:
        name = object_at(index, sub).name
    except KeyError:  # accessed by its number, on a newer node
        name = ""
    return ObjectAborted(index, sub, code, reason or ABORTS.get(code, "refused"), name)
