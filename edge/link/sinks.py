"""The kinds of link, and the door to them: `open_sink("can:can0")`; addresses: `hostlink.wire.address`."""

from collections import deque
from collections.abc import Callable, Sequence
from typing import Protocol

from edge.errors import SinkError
from edge.link.link_sink import LinkSink, SinkCounters
from edge.link.medium import CanFrame, Medium, MediumError
from hostlink.wire import CanIds, Kind, Message, State, encode_frame, pack_message, pack_parts, unpack_message
from hostlink.wire.address import DEFAULT_BAUD, Address, AddressError, parse_address
from hostlink.wire.errors import CorruptFrame
from hostlink.wire.open_errors import cannot_open
from hostlink.wire.serial import FRAME_MAX, decode_frame
from hostlink.wire.state import pack_state
from hostlink.wire.timing import classic_frame_s, fd_frame_s, serial_frame_s

NODE_DEFAULT = 1
BITRATE, DBITRATE = 1_000_000, 5_000_000  # used if the address names none: CiA 601-3


class Sink(Protocol):
    """Where samples go."""

    name: str

    @property
    def counters(self) -> SinkCounters: ...

    def send(self, state: State) -> bool:
        """Send a sample; False: dropped and counted. Never blocks, never raises."""

    def drain(self, timeout_s: float) -> bool:
        """Wait until nothing waits to be sent: for recordings, which are sent as fast as possible."""

    def close(self) -> None: ...


class MemorySink:
    """Keeps the newest samples: for tests and for measuring without a bus."""

    name = "memory:"

    def __init__(self, keep: int = 100_000) -> None:
        self.states: deque[State] = deque(maxlen=keep)
        self.counters = SinkCounters()

    def send(self, state: State) -> bool:
        self.states.append(state)
        self.counters.sent += 1
        return True

    def drain(self, timeout_s: float) -> bool:
        return True

    def close(self) -> None:
        """Nothing to close."""


class CanSink(LinkSink):
    """A node, 1..127, on a CAN bus. Items and incoming messages are `CanFrame`."""

    bitrate, dbitrate = BITRATE, DBITRATE  # of the bus, where the address names them

    def __init__(
        self, name: str, open_it: Callable[[], Medium], node: int = NODE_DEFAULT, ids: CanIds | None = None
    ) -> None:
        self.node, self.ids = node, ids or CanIds()
        self._state_id = self.ids.state(node)  # ValueError: no such node
        super().__init__(name, open_it)

    def frame_s(self, n_bytes: int, fd: bool = True) -> float:
        """How long a frame occupies the bus, at worst."""
        if not fd:
            return classic_frame_s(n_bytes, self.bitrate)
        return fd_frame_s(n_bytes, self.bitrate, self.dbitrate)


class CanFdSink(CanSink):
    """One CAN FD frame of 64 bytes a sample, on TPDO1's identifier."""

    def encode(self, state: State, counter: int) -> Sequence[CanFrame]:
        return (CanFrame(self._state_id, pack_state(state, counter), True),)

    def encode_detail(self, payload: bytes) -> CanFrame:
        """The message of one detail segment, on TPDO4's identifier."""
        return CanFrame(self.ids.detail(self.node), payload, fd=True)


class CanClassicSink(CanSink):
    """4 to 12 messages of 8 bytes a sample, on the identifiers of TPDO1..4."""

    def encode(self, state: State, counter: int) -> Sequence[CanFrame]:
        return [CanFrame(self.ids.tpdo(tpdo, self.node), data) for tpdo, data in pack_parts(state, counter)]


class SerialSink(LinkSink):
    """COBS frames on a serial line. Items are bytes; incoming messages are (type, counter, body).

    Damaged frames are dropped: the host repeats its request.

    node  CANopen node number
    ids   the objects that ask for identifiers read these
    """

    baud = DEFAULT_BAUD

    def __init__(self, name: str, open_medium: Callable[[], Medium], node: int = NODE_DEFAULT) -> None:
        self.node, self.ids = node, CanIds()
        self._buffer = bytearray()
        self.on_frame: Callable[[Message, int, bytes], None] | None = None
        super().__init__(name, open_medium)
        self.on_message = self._split

    def encode(self, state: State, counter: int) -> Sequence[bytes]:
        return (encode_frame(Message.STATE, pack_state(state, counter)),)

    def encode_detail(self, payload: bytes) -> bytes:
        """The frame of one detail segment."""
        return encode_frame(Message.DETAIL, payload)

    def frame_s(self, n_bytes: int) -> float:
        """How long such a frame occupies the line."""
        return serial_frame_s(n_bytes, self.baud)

    def frame(self, kind: Message, body: bytes, counter: int) -> bytes:
        """The bytes of an answer, an emergency or a heartbeat."""
        return encode_frame(kind, pack_message(kind, body, counter))

    def _split(self, chunk: bytes) -> None:
        self._buffer += chunk
        *blocks, rest = self._buffer.split(b"\0")
        self._buffer = rest[-FRAME_MAX:]  # what is longer is noise
        for block in filter(None, blocks):
            try:
                number, payload = decode_frame(bytes(block))
                kind = Message(number)
                counter, body = unpack_message(kind, payload)
            except (CorruptFrame, ValueError):
                continue
            if self.on_frame is not None:
                self.on_frame(kind, counter, body)


def opener(address: Address, wanted: Sequence[int] = ()) -> Callable[[], Medium]:
    """A function that opens the bus or serial port of an address, again and again.

    It raises MediumError, one line for the user. A medium's module and library are loaded when it is opened.

    wanted  identifiers of the messages that must be received on a bus; others may be
    """

    def open_it() -> Medium:
        try:
            if not address.is_can:
                from edge.link.serial_line import open_port

                return open_port(address)
            if address.interface == "socketcan":
                from edge.link.socketcan import open_socket

                return open_socket(address.channel, address.fd, wanted)
            from edge.link.python_can import open_python_can

            return open_python_can(address)
        except Exception as error:
            raise MediumError(cannot_open(address, error)) from error

    return open_it


def open_sink(spec: str, node: int = NODE_DEFAULT, ids: CanIds | None = None) -> Sink:
    """The sink at an address such as `can:can0`, `serial:/dev/ttyACM0?baud=921600`, `memory:`.

    node    CANopen node number if the address names none
    Raises  SinkError, one line: the address is invalid, or cannot be opened
    """
    try:
        address = parse_address(spec)
    except AddressError as error:
        raise SinkError(str(error)) from None
    if address.scheme == "memory":
        return MemorySink(keep=1000)  # 1 MB
    node = address.node or node
    if not address.is_can:
        line = SerialSink(str(address), opener(address), node)
        line.baud = address.baud
        return line
    kind: type[CanSink] = CanFdSink if address.fd else CanClassicSink
    ids = ids or CanIds()
    wanted = (ids.nmt, ids.sync, ids.of(Kind.SDO_REQUEST, node))
    bus = kind(str(address), opener(address, wanted), node, ids)
    bus.bitrate, bus.dbitrate = address.bitrate or BITRATE, address.dbitrate or DBITRATE
    return bus
