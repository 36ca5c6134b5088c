"""A CANopen node on our links: NMT, heartbeat, emergencies and objects, on CAN and over serial."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

from edge.link.link_sink import LinkSink
from edge.link.medium import CanFrame
from edge.link.nmt import LEADS_TO, NmtCommand, NmtState
from edge.link.object_server import Aborted, ObjectServer
from edge.link.params import PARAMS
from edge.link.sdo_server import DOWNLOAD_MAX, TOO_LONG, SdoServer
from edge.link.sinks import CanSink, SerialSink
from hostlink.wire import Abort, CorruptFrame, Kind, Message, ObjectReply, ObjectRequest, Op
from hostlink.wire.canid import NODES_MAX
from hostlink.wire.serial import CHUNK_MAX


class _Port(ABC):
    """Common to both links.

    on_nmt   called after a master's command was taken
    on_sync  called at each SYNC
    state    may be set
    """

    def __init__(
        self, sink: LinkSink, node: int, server: ObjectServer, on_nmt: Callable[[NmtCommand], None],
        on_sync: Callable[[], None],
    ) -> None:  # fmt: skip
        self.server = server
        self._sink, self._node = sink, node
        self._on_nmt, self._on_sync = on_nmt, on_sync
        self.state = NmtState.INITIALISING

    @abstractmethod
    def _item(self, kind: Kind, data: bytes) -> Any:
        """What carries a heartbeat or an emergency."""

    def send_emergency(self, data: bytes) -> None:
        self._sink.post(self._item(Kind.EMERGENCY, data))

    @abstractmethod
    def forget_transfer(self) -> None:
        """Abandon a segmented transfer."""

    def _heartbeat(self) -> Any:
        return self._item(Kind.HEARTBEAT, bytes((self.state,)))

    def boot(self, heartbeat_ms: int) -> None:
        """Send the boot-up message, and be pre-operational, with heartbeat."""
        self.set_heartbeat(0)
        self.state = NmtState.INITIALISING
        self._sink.post(self._heartbeat())
        self.state = NmtState.PRE_OPERATIONAL
        self.set_heartbeat(heartbeat_ms)

    def set_heartbeat(self, period_ms: int) -> None:
        """Send the state each period from now on; 0: not."""
        # Fingers that begin together would else send theirs in the same moment for ever.
        phase = self._node / (NODES_MAX + 1)
        self._sink.every(period_ms / 1000.0, self._heartbeat if period_ms else None, phase)

    def _command(self, number: int) -> None:
        """Take a master's command, if there is such a one."""
        self.forget_transfer()
        if number in list(NmtCommand):
            command = NmtCommand(number)
            self.state = LEADS_TO[command]
            self._on_nmt(command)


class CanPort(_Port):
    """The node on a CAN bus."""

    def __init__(self, sink: CanSink, server: ObjectServer, *callbacks: Any) -> None:
        super().__init__(sink, sink.node, server, *callbacks)
        self._ids = sink.ids
        self._request = sink.ids.of(Kind.SDO_REQUEST, sink.node)
        response = sink.ids.of(Kind.SDO_RESPONSE, sink.node)
        spacing_s = sink.frame_s(8, fd=False) / PARAMS.spaced_rel
        self.sdo = SdoServer(
            server,
            lambda data: sink.post(CanFrame(response, data)),
            lambda block: sink.post_block([CanFrame(response, data) for data in block], spacing_s),
        )
        sink.on_message = self.receive

    def _item(self, kind: Kind, data: bytes) -> CanFrame:
        return CanFrame(self._ids.of(kind, self._node), data)

    def forget_transfer(self) -> None:
        self.sdo.reset()

    def receive(self, frame: CanFrame) -> None:
        """Handle a frame from the bus, for any node."""
        can_id, data, fd = frame
        if fd:
            return
        if can_id == self._ids.nmt:
            if len(data) == 2 and data[1] in (0, self._node):
                self._command(data[0])
        elif can_id == self._ids.sync:
            if len(data) <= 1:  # CiA 301: empty, or one counter
                self._on_sync()
        elif can_id == self._request and len(data) == 8 and self.state is not NmtState.STOPPED:
            self.sdo.request(data)


class SerialPort(_Port):
    """The node at the end of a serial line."""

    def __init__(self, sink: SerialSink, node: int, server: ObjectServer, *callbacks: Any) -> None:
        self._line = sink
        self._counters = {Message.HEARTBEAT: 0, Message.EMERGENCY: 0}
        self._answered: tuple[int, bytes] | None = None
        self._answered_s = 0.0
        self._answer = b""
        self._upload = bytearray()
        self._upload_to: tuple[int, int] | None = None
        super().__init__(sink, node, server, *callbacks)
        sink.on_frame = self.receive

    def _item(self, kind: Kind, data: bytes) -> bytes:
        message = Message.HEARTBEAT if kind is Kind.HEARTBEAT else Message.EMERGENCY
        self._counters[message] += 1
        return self._line.frame(message, data, self._counters[message])

    def forget_transfer(self) -> None:
        self._upload_to = None

    def receive(self, kind: Message, counter: int, body: bytes) -> None:
        if kind is Message.NMT and len(body) == 1:
            self._command(body[0])
        elif kind is Message.SYNC:
            self._on_sync()
        elif kind is Message.REQUEST and self.state is not NmtState.STOPPED:
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
            self._line.post_frame(Message.REPLY, self._answer, counter)

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
