"""Frames as fingertips send them, for tests that need no node."""

from collections.abc import Iterator
from contextlib import contextmanager

import can

import hostlink
from hostlink.hand_file import HandFile
from hostlink.wire import Message, State, encode_frame, pack_message, pack_state
from hostlink.wire.e2e import protected_p5
from hostlink.wire.fields import DATA_ID

FOREIGN_VERSION = 9


def message(can_id: int, data: bytes, time_s: float = 0.0) -> can.Message:
    """CAN FD where the data are longer than a classic frame's."""
    return can.Message(
        timestamp=time_s, arbitration_id=can_id, data=data, is_extended_id=False, is_fd=len(data) > 8
    )


def on_line(kind: Message, body: bytes, counter: int) -> bytes:
    """A message as it passes a serial line."""
    return encode_frame(kind, pack_message(kind, body, counter))


def state_on_line(state: State, counter: int) -> bytes:
    return encode_frame(Message.STATE, pack_state(state, counter))


def foreign_frame(counter: int, data_id: int = DATA_ID ^ 0x55) -> bytes:
    """A state frame of another version."""
    frame = pack_state(State(sample=counter), counter)
    return protected_p5(bytes((FOREIGN_VERSION,)) + frame[4:], counter, data_id)


class Wire:
    """A bus on which a test sends what it likes, and the host's connection to it."""

    def __init__(self, bus: can.BusABC, hand: hostlink.Connection) -> None:
        self._bus, self.hand = bus, hand

    def send(self, can_id: int, data: bytes) -> None:
        self._bus.send(message(can_id, data))

    def send_state(self, node: int, state: State) -> None:
        self.send(0x180 + node, pack_state(state, state.sample & 0xFF))

    def send_foreign(self, node: int, counter: int) -> None:
        self.send(0x180 + node, foreign_frame(counter))


@contextmanager
def open_wire(channel: str, hand: HandFile | None = None) -> Iterator[Wire]:
    with (
        can.Bus(interface="virtual", channel=channel) as bus,
        hostlink.connect(f"virtual:{channel}", hand=hand) as connection,
    ):
        yield Wire(bus, connection)
