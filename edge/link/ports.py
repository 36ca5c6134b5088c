"""A `canopen` node on our own links: NMT, heartbeat, SDO server on CAN; the same over serial.

`canopen` implements the state machines of CiA 301; the link is ours, because it must survive what
`canopen.Network` does not: a bus that disappears and comes back. So the network below has no bus of its own:
messages from `canopen` are posted to the sink, incoming ones are passed to it.

    CAN     identifiers are moved to the configured bases on their way out and in
    serial  heartbeat, emergency, NMT and SYNC have message types of their own; objects come as requests
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import can
import canopen
from canopen.sdo.exceptions import SdoAbortedError

from edge.link.object_server import Aborted, ObjectServer
from edge.link.sdo_server import DOWNLOAD_MAX, TOO_LONG, SdoServer
from edge.link.sinks import CanSink, SerialSink
from hostlink.wire import OBJECTS, Abort, CorruptFrame, Kind, Message, ObjectReply, ObjectRequest, Op
from hostlink.wire.objects import TYPES
from hostlink.wire.serial import CHUNK_MAX

__all__ = ["CanPort", "SerialPort", "StandardNode", "object_dictionary"]

NMT, SYNC, EMERGENCY, SDO_RESPONSE, SDO_REQUEST, HEARTBEAT = 0x000, 0x080, 0x080, 0x580, 0x600, 0x700
STOPPED = "STOPPED"


def object_dictionary() -> Any:
    """The object table as a `canopen.ObjectDictionary`."""
    od: Any = canopen.ObjectDictionary()
    by_index: dict[int, list[Any]] = {}
    for row in OBJECTS:
        by_index.setdefault(row.index, []).append(row)
    for index, rows in by_index.items():
        record = canopen.objectdictionary.ODRecord(rows[0].name.removesuffix("_max_sub"), index)
        for row in rows:
            variable = canopen.objectdictionary.ODVariable(row.name, index, row.sub)
            variable.data_type = TYPES[row.type][0]
            variable.access_type = row.access
            record.add_member(variable)
        od.add_object(record if len(rows) > 1 else variable)
    return od


class _Series:
    """Handle for `canopen` of a message that is sent periodically."""

    def __init__(self, network: _Network, can_id: int, data: bytes, period_s: float) -> None:
        self._network, self._can_id, self._data = network, can_id, bytes(data)
        network.every(can_id, period_s, lambda: network.item(can_id, self._data))

    def stop(self) -> None:
        self._network.every(self._can_id, 0.0, None)

    def update(self, data: bytes) -> None:
        self._data = bytes(data)


class _Network(canopen.Network):
    """A network without a bus: `post` sends an item, `item` makes one of a standard identifier and data."""

    def __init__(
        self,
        item: Callable[[int, bytes], Any],
        post: Callable[[Any], None],
        every: Callable[[int, float, Callable[[], Any] | None], None],
    ) -> None:
        super().__init__()
        self.item, self._post, self.every = item, post, every

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        self._post(self.item(can_id, bytes(data)))

    def send_periodic(self, can_id: int, data: bytes, period: float, remote: bool = False) -> Any:
        return _Series(self, can_id, bytes(data), period)


class StandardNode(canopen.LocalNode):
    """A `canopen` node whose objects are the object server's."""

    def __init__(self, node: int, server: ObjectServer) -> None:
        super().__init__(node, object_dictionary())
        self._server = server

    def get_data(self, index: int, subindex: int, check_readable: bool = False) -> bytes:
        try:
            return self._server.read(index, subindex)
        except Aborted as error:
            raise SdoAbortedError(error.code) from None

    def set_data(self, index: int, subindex: int, data: bytes, check_writable: bool = False) -> None:
        try:
            self._server.write(index, subindex, bytes(data))
        except Aborted as error:
            raise SdoAbortedError(error.code) from None


class _Port:
    """Common to both links.

    on_nmt   called after the state machine has taken an NMT command, with the command
    on_sync  called at each SYNC
    """

    def __init__(
        self, network: _Network, node: int, server: ObjectServer, on_nmt: Callable[[int], None],
        on_sync: Callable[[], None],
    ) -> None:  # fmt: skip
        self.node: Any = StandardNode(node, server)  # `canopen` is typed in parts only
        self.server = server
        self._network = network
        self._on_nmt, self._on_sync = on_nmt, on_sync
        network[node] = self.node

    def start(self) -> None:
        """Boot-up message, then pre-operational, with heartbeat."""
        self.node.nmt.stop_heartbeat()
        self.node.nmt.state = "INITIALISING"
        self.node.nmt.state = "PRE-OPERATIONAL"

    def set_heartbeat(self, period_ms: int) -> None:
        self.node.nmt.start_heartbeat(period_ms)

    def forget_transfer(self) -> None:
        """Abandon a segmented transfer."""

    def send_emergency(self, data: bytes) -> None:
        self._network.send_message(EMERGENCY + self.node.id, data)

    def _nmt(self, command: int, node: int, timestamp_s: float) -> None:
        if node in (0, self.node.id):
            self.forget_transfer()
            self._network.notify(NMT, bytearray((command, node)), timestamp_s)
            self._on_nmt(command)


class CanPort(_Port):
    """The node on a CAN bus."""

    def __init__(self, sink: CanSink, server: ObjectServer, *callbacks: Any) -> None:
        ids, node = sink.ids, sink.node
        self._out = {
            SDO_RESPONSE + node: ids.of(Kind.SDO_RESPONSE, node),
            HEARTBEAT + node: ids.of(Kind.HEARTBEAT, node),
            EMERGENCY + node: ids.of(Kind.EMERGENCY, node),
        }
        self._in = {ids.nmt: NMT, ids.sync: SYNC, ids.of(Kind.SDO_REQUEST, node): SDO_REQUEST}
        super().__init__(_Network(self._item, sink.post, sink.every), node, server, *callbacks)
        response = ids.of(Kind.SDO_RESPONSE, node)
        self.sdo = SdoServer(server, lambda data: sink.post_can(response, data))
        sink.on_message = self.receive

    def _item(self, can_id: int, data: bytes) -> can.Message:
        return can.Message(arbitration_id=self._out[can_id], data=data, is_extended_id=False)

    def forget_transfer(self) -> None:
        self.sdo.reset()

    def receive(self, message: can.Message) -> None:
        """Handle a message from the bus, for any node."""
        kind = self._in.get(message.arbitration_id)
        if kind is None or message.is_extended_id or message.is_remote_frame or message.is_fd:
            return
        data = bytearray(message.data)
        if kind == NMT and len(data) == 2:
            self._nmt(data[0], data[1], message.timestamp)
        elif kind == SYNC and len(data) <= 1:  # CiA 301: empty, or one counter
            self._on_sync()
        elif kind == SDO_REQUEST and len(data) == 8 and self.node.nmt.state != STOPPED:
            self.sdo.request(bytes(data))


class SerialPort(_Port):
    """The node at the end of a serial line."""

    def __init__(self, sink: SerialSink, node: int, server: ObjectServer, *callbacks: Any) -> None:
        self._sink = sink
        self._counters = {Message.HEARTBEAT: 0, Message.EMERGENCY: 0}
        self._answered: tuple[int, bytes] | None = None
        self._answer = b""
        self._upload = bytearray()
        self._upload_to: tuple[int, int] | None = None
        super().__init__(_Network(self._item, sink.post, sink.every), node, server, *callbacks)
        sink.on_frame = self.receive

    def _item(self, can_id: int, data: bytes) -> bytes:
        kind = Message.HEARTBEAT if can_id == HEARTBEAT + self.node.id else Message.EMERGENCY
        self._counters[kind] += 1
        return self._sink.frame(kind, data, self._counters[kind])

    def forget_transfer(self) -> None:
        self._upload_to = None

    def receive(self, kind: Message, counter: int, body: bytes) -> None:
        """Handle a frame from the line."""
        if kind is Message.NMT and len(body) == 1:
            self._nmt(body[0], self.node.id, 0.0)
        elif kind is Message.SYNC:
            self._on_sync()
        elif kind is Message.REQUEST and self.node.nmt.state != STOPPED:
            # A request repeated because its answer was lost gets the same answer; the action (a tare, a
            # reboot) is not repeated.
            if self._answered != (counter, body):
                try:
                    request = ObjectRequest.unpack(body)
                except CorruptFrame:
                    return
                self._answered, self._answer = (counter, body), self._serve(request).pack()
            self._sink.post_frame(Message.REPLY, self._answer, counter)

    def _serve(self, ask: ObjectRequest) -> ObjectReply:
        try:
            if ask.op is Op.READ:
                data = self.server.read(ask.index, ask.sub)
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
            self.server.refusal = TOO_LONG
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
            self.server.write(ask.index, ask.sub, bytes(self._upload))
