"""A master's commands and a host's requests, as each kind of link brings them, and how answers go back."""

import time
from collections import Counter
from typing import Protocol

from edge.link.medium import CanFrame
from edge.link.object_server import Aborted, ObjectServer
from edge.link.params import PARAMS
from edge.link.sdo_server import DOWNLOAD_MAX, TOO_LONG, SdoServer
from edge.link.sinks import CanSink, SerialSink
from hostlink.wire import Abort, CorruptFrame, Kind, Message, ObjectReply, ObjectRequest, Op
from hostlink.wire.nmt import NmtState
from hostlink.wire.serial import CHUNK_MAX


class Commanded(Protocol):
    """A node, as its commands see it."""

    number: int
    state: NmtState
    objects: ObjectServer

    def command(self, number: int) -> None: ...

    def sync(self) -> None: ...


class CanCommands:
    """CANopen's messages to the node at a CAN bus."""

    def __init__(self, sink: CanSink, node: Commanded) -> None:
        self._node, self._ids = node, sink.ids
        self._request = sink.ids.of(Kind.SDO_REQUEST, node.number)
        response = sink.ids.of(Kind.SDO_RESPONSE, node.number)
        spacing_s = sink.frame_s(8, fd=False) / PARAMS.spaced_rel
        self.sdo = SdoServer(
            node.objects,
            lambda data: sink.post(CanFrame(response, data)),
            lambda block: sink.post_spaced("block", [CanFrame(response, b) for b in block], spacing_s),
        )
        sink.on_message = self.receive

    def item(self, kind: Kind, data: bytes) -> CanFrame:
        """The item that carries a heartbeat or an emergency."""
        return CanFrame(self._ids.of(kind, self._node.number), data)

    def receive(self, frame: CanFrame) -> None:
        """Handle a frame from the bus, for any node."""
        can_id, data, fd = frame.can_id, frame.data, frame.fd
        if fd:
            return
        if can_id == self._ids.nmt:
            if len(data) == 2 and data[1] in (0, self._node.number):
                self.sdo.reset()
                self._node.command(data[0])
        elif can_id == self._ids.sync:
            if len(data) <= 1:  # CiA 301: empty, or one counter
                self._node.sync()
        elif can_id == self._request and len(data) == 8 and self._node.state is not NmtState.STOPPED:
            self.sdo.request(data)


class SerialCommands:
    """The same at the end of a serial line, where requests and replies are `hostlink.wire.serial`'s."""

    def __init__(self, sink: SerialSink, node: Commanded) -> None:
        self._line, self._node = sink, node
        self._sent_n = Counter[Message]()
        self._answered: tuple[int, bytes] | None = None
        self._answer, self._answered_s = b"", 0.0
        self._upload = bytearray()
        self._upload_to: tuple[int, int] | None = None
        sink.on_frame = self.receive

    def item(self, kind: Kind, data: bytes) -> bytes:
        """The item that carries a heartbeat or an emergency."""
        message = Message[kind.name]
        self._sent_n[message] += 1
        return self._line.frame(message, data, self._sent_n[message])

    def receive(self, kind: Message, counter: int, body: bytes) -> None:
        if kind is Message.NMT and len(body) == 1:
            self._upload_to = None
            self._node.command(body[0])
        elif kind is Message.SYNC:
            self._node.sync()
        elif kind is Message.REQUEST and self._node.state is not NmtState.STOPPED:
            # A request repeated because its answer was lost gets the same answer; the action (a tare, a
            # reboot) is not repeated. After a while it is another program's, whose counter has begun anew.
            now_s = time.monotonic()
            if self._answered != (counter, body) or now_s - self._answered_s > PARAMS.repeat_s:
                try:
                    request = ObjectRequest.unpack(body)
                except CorruptFrame:
                    return
                self._answered, self._answer = (counter, body), self._serve(request).pack()
            self._answered_s = now_s
            self._line.post(self._line.frame(Message.REPLY, self._answer, counter))

    def _serve(self, ask: ObjectRequest) -> ObjectReply:
        try:
            if ask.op is Op.READ:
                data = self._node.objects.read(ask.index, ask.sub)
                chunk = data[ask.offset : ask.offset + CHUNK_MAX]
                return ObjectReply(ask.index, ask.sub, 0, ask.offset, len(data), chunk)
            self._take(ask)
            return ObjectReply(ask.index, ask.sub, 0, ask.offset, ask.total)
        except Aborted as error:
            self._upload_to = None
            return ObjectReply(ask.index, ask.sub, error.code, ask.offset)

    def _take(self, ask: ObjectRequest) -> None:
        """Take a segment of a value; the last one applies it."""
        if ask.total > DOWNLOAD_MAX:
            self._node.objects.refusal = TOO_LONG
            raise Aborted(Abort.LENGTH)
        if ask.offset == 0:
            self._upload, self._upload_to = bytearray(), (ask.index, ask.sub)
        if self._upload_to != (ask.index, ask.sub) or ask.offset != len(self._upload):
            raise Aborted(Abort.TOGGLE)
        self._upload += ask.data
        if len(self._upload) > ask.total:
            raise Aborted(Abort.LENGTH)
        if len(self._upload) == ask.total:
            self._upload_to = None
            self._node.objects.write(ask.index, ask.sub, bytes(self._upload))
