"""Open the CAN bus of an address, for the fingertip and for the host alike."""

from __future__ import annotations

import logging
import os
from typing import TYPE_CHECKING

from hostlink.wire.address import Address
from hostlink.wire.port_lock import PortLock

if TYPE_CHECKING:
    import can

__all__ = ["open_can_bus"]

FD_CLOCK_HZ = 80_000_000  # CiA 601-3's recommended CAN FD clock
FD_SAMPLE_POINT = 80.0  # percent, both phases; CiA 601-3


def open_can_bus(address: Address) -> tuple[can.BusABC, PortLock | None]:
    """The bus, and the lock of the port of a serial-line adapter; the caller closes both.

    Raises  the errors of python-can and its drivers: can.CanError, OSError, ValueError, TypeError; without a
            driver's own library ImportError, AttributeError, NameError
    """
    import can

    # python-can also logs what it raises; without a handler that would be a second line on stderr.
    logging.getLogger("can").addHandler(logging.NullHandler())
    arguments = address.bus_arguments()
    # Locked before anything is sent to the adapter.
    lock = PortLock(address.channel) if address.interface == "slcan" else None
    try:
        timing = address.fd_timing()
        if timing is not None:
            arguments.pop("bitrate", None)
            arguments["timing"] = can.BitTimingFd.from_sample_point(
                f_clock=FD_CLOCK_HZ,
                nom_bitrate=timing[0],
                nom_sample_point=FD_SAMPLE_POINT,
                data_bitrate=timing[1],
                data_sample_point=FD_SAMPLE_POINT,
            )
        bus = can.Bus(**arguments)
        if address.interface == "socketcan":
            # An interface that goes down reports it once, to the reader or to a writer: a reader that was
            # woken for it after the writer got it would wait for ever.
            os.set_blocking(bus.fileno(), False)
    except BaseException:
        if lock is not None:
            lock.close()
        raise
    return bus, lock
