"""Buses that python-can drives: all but the kernel's own. It reports a dead bus in many ways (`broken`)."""

import logging

import can
import serial

from edge.link.medium import FULL, CanFrame, Medium, MediumFull, is_off_after
from edge.link.params import PARAMS
from hostlink.can_bus import OpenBus, open_can_bus
from hostlink.wire.address import Address

INSTANT = frozenset({"virtual", "udp_multicast"})  # interfaces whose send(timeout=0) returns
# python-can also logs what it raises: that would be a second line on stderr.
logging.getLogger("can").propagate = False


class CanMedium(Medium):
    """A python-can bus; instant: its `send(timeout=0)` returns at once."""

    broken = (can.CanError, *Medium.broken)

    def __init__(self, bus: can.BusABC | OpenBus, instant: bool) -> None:
        self.instant, self._bus = instant, bus
        self._timeout_s = 0.0 if instant else PARAMS.write_s

    def write(self, item: CanFrame) -> None:
        message = can.Message(
            arbitration_id=item.can_id,
            data=item.data,
            is_extended_id=False,
            is_fd=item.fd,
            bitrate_switch=item.fd,
        )
        try:
            self._bus.send(message, timeout=self._timeout_s)
        except self.broken as error:
            if _means_full(error):
                raise MediumFull(str(error)) from error
            raise
        self.bus_off = False

    def read(self, timeout_s: float) -> CanFrame | None:
        message = self._bus.recv(timeout_s)
        if message is None:
            return None
        if message.is_error_frame:
            self.bus_off = is_off_after(message.arbitration_id, self.bus_off)
            return None
        if message.is_extended_id or message.is_remote_frame:
            return None
        return CanFrame(message.arbitration_id, bytes(message.data), message.is_fd)

    def close(self) -> None:
        self._bus.shutdown()


def open_python_can(address: Address) -> CanMedium:
    """Open the bus of an address. Raises whatever its driver raises."""
    return CanMedium(open_can_bus(address), address.interface in INSTANT)


def _means_full(error: BaseException) -> bool:
    number = getattr(error, "error_code", None) or getattr(error.__cause__, "errno", None)
    if number is None:
        # slcan raises "Transmit buffer full" and a timeout without a number.
        timed_out = isinstance(error.__cause__, TimeoutError | serial.SerialTimeoutException)
        return timed_out or isinstance(error, TimeoutError) or "buffer full" in str(error)
    return number in FULL
