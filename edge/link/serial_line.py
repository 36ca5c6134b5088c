"""Serial lines, through pyserial."""

from contextlib import suppress
from typing import Any

import serial

from edge.link.medium import Medium, MediumFull
from edge.link.params import PARAMS
from hostlink.wire.address import Address


class SerialMedium(Medium):
    """A pyserial port."""

    def __init__(self, port: Any) -> None:
        self._port = port

    def write(self, item: bytes) -> None:
        try:
            self._port.write(item)
        except serial.SerialTimeoutException as error:
            with suppress(*self.broken):
                self._port.reset_output_buffer()  # its contents are old by now
            raise MediumFull(str(error)) from error

    def read(self, timeout_s: float) -> bytes | None:
        if self._port.timeout != timeout_s:  # to set it takes system calls, which can fail
            self._port.timeout = timeout_s
        first = self._port.read(1)
        return bytes(first + self._port.read(self._port.in_waiting)) if first else None

    def close(self) -> None:
        self._port.close()


def open_port(address: Address) -> SerialMedium:
    """Open the serial port of an address. Raises whatever its driver raises."""
    port = serial.serial_for_url(
        address.channel,
        baudrate=address.baud,
        timeout=PARAMS.read_s,
        write_timeout=PARAMS.write_s,
        exclusive=True,  # two readers would steal each other's bytes
    )
    return SerialMedium(port)
