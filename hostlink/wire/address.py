"""The address of an end of the wire: one line of text, for the edge's sink and the host's `connect` alike.

    can:can0                                  SocketCAN interface, CAN FD
    can:can0?fd=0                             the same in classic frames
    can:PCAN_USBBUS1?interface=pcan&bitrate=1000000&dbitrate=5000000
                                              any interface that python-can knows
    slcan:/dev/ttyACM0?bitrate=1000000        serial-line CAN adapter; fd=1&dbitrate=5000000 for FD ones
    virtual:finger0                           a bus inside this process
    udp:239.0.0.1?port=43113                  CAN frames over UDP multicast; ttl=0: this machine only
    serial:/dev/ttyACM0?baud=921600           UART or USB CDC
    serial:loop://                            any pyserial URL
    memory:                                   a list in memory

Options that every address takes: `node=1..127`, the CANopen node number (edge: who we are).
Addresses are always checked in full: unknown options are refused, never ignored.
"""

from __future__ import annotations

from dataclasses import dataclass
from ipaddress import ip_address
from typing import Any
from urllib.parse import parse_qsl

from hostlink.wire.errors import LinkError

__all__ = ["Address", "AddressError", "parse_address"]

SCHEMES = ("can", "slcan", "virtual", "udp", "serial", "memory")
"""The part before the colon."""

_EVERY = frozenset({"node"})
_CAN = _EVERY | {"fd"}
_OPTIONS: dict[str, frozenset[str]] = {
    "can": _CAN | {"interface", "bitrate", "dbitrate"},
    "slcan": _CAN | {"bitrate", "dbitrate", "baud"},
    "virtual": _CAN | {"bitrate", "dbitrate"},
    "udp": _CAN | {"port", "ttl", "bitrate", "dbitrate"},
    "serial": _EVERY | {"baud"},
    "memory": _EVERY,
}
_RANGES: dict[str, tuple[int, int]] = {
    "node": (1, 127),  # CiA 301
    "fd": (0, 1),
    "bitrate": (10_000, 1_000_000),  # ISO 11898-1 nominal
    "dbitrate": (10_000, 8_000_000),  # fastest CAN FD transceivers on the market
    "baud": (9_600, 12_000_000),  # USB high-speed UARTs end here
    "port": (1, 65_535),
    "ttl": (0, 255),
}
_DIGITS_MAX = 9
DEFAULT_BAUD = 921_600  # a 64-byte frame at 240 Hz takes a fifth of it
DEFAULT_UDP_PORT = 43_113  # python-can's own
NOMINAL_DEFAULT = 1_000_000  # CiA 601-3: 1 and 5 Mbit/s


class AddressError(LinkError, ValueError):
    """The text is not an address: one line, what is wrong and what would be right."""


@dataclass(frozen=True, slots=True)
class Address:
    """One end of the wire.

    scheme     one of SCHEMES
    channel    interface name, device path, multicast group, pyserial URL, or bus name
    interface  python-can's name of the driver; "" for serial and memory
    fd         CAN FD (state frame of 64 bytes) or classic (parts of 8 bytes)
    bitrate    bit/s; None: as configured in the system
    dbitrate   bit/s of the FD data phase; None as above
    baud       symbols/s of the serial line, of the adapter's line for slcan
    node       CANopen node number, None if not given
    """

    scheme: str
    channel: str
    interface: str = ""
    fd: bool = True
    bitrate: int | None = None
    dbitrate: int | None = None
    baud: int = DEFAULT_BAUD
    port: int = DEFAULT_UDP_PORT
    ttl: int = 0
    node: int | None = None

    @property
    def is_can(self) -> bool:
        return bool(self.interface)

    def __str__(self) -> str:
        return f"{self.scheme}:{self.channel}"

    def bus_arguments(self) -> dict[str, Any]:
        """Keyword arguments of `can.Bus`. FD adapters need `timing` too: `fd_timing`."""
        arguments: dict[str, Any] = {"interface": self.interface, "channel": self.channel}
        if self.interface == "udp_multicast":
            arguments |= {"port": self.port, "hop_limit": self.ttl, "fd": self.fd}
        elif self.interface == "slcan":
            # Current adapters are ready at once: python-can's wait of 2 s is for Arduinos.
            arguments |= {"tty_baudrate": self.baud, "sleep_after_open": 0.0}
        elif self.interface != "virtual":
            arguments["fd"] = self.fd
        if self.bitrate is not None and self.interface not in {"virtual", "udp_multicast", "socketcan"}:
            arguments["bitrate"] = self.bitrate
        return arguments

    def fd_timing(self) -> tuple[int, int] | None:
        """(nominal, data) bit/s for which an FD adapter needs a `can.BitTimingFd`; None: it needs none."""
        configured_elsewhere = self.interface in {"virtual", "udp_multicast", "socketcan"}
        if not self.fd or self.dbitrate is None or configured_elsewhere:
            return None
        return self.bitrate or NOMINAL_DEFAULT, self.dbitrate


def parse_address(text: str) -> Address:
    """Read an address; the module's head lists the forms.

    Raises AddressError: unknown scheme, option or value.
    """
    scheme, colon, rest = text.partition(":")
    if not colon or scheme not in SCHEMES:
        forms = ", ".join(f"{name}:" for name in SCHEMES)
        raise AddressError(f"{text!r} is no link address: it starts with one of {forms} (e.g. can:can0)")
    channel, _, query = rest.partition("?")
    if scheme != "memory" and not channel:
        raise AddressError(f"{text!r} names no channel (e.g. {_EXAMPLES[scheme]})")
    if scheme == "udp" and not _is_group(channel):
        raise AddressError(f"{text!r}: {channel} is no multicast group; give one, e.g. {_EXAMPLES[scheme]}")
    options = _read_options(text, scheme, query)
    interface = str(options.pop("interface", _INTERFACE[scheme]))
    fd = bool(options.pop("fd", scheme != "slcan"))
    if scheme == "slcan":
        options.setdefault("baud", 115_200)
    return Address(scheme, channel, interface, fd, **options)


def _is_group(channel: str) -> bool:
    try:
        return ip_address(channel).is_multicast
    except ValueError:
        return False


_INTERFACE = {
    "can": "socketcan",
    "slcan": "slcan",
    "virtual": "virtual",
    "udp": "udp_multicast",
    "serial": "",
    "memory": "",
}
_EXAMPLES = {
    "can": "can:can0",
    "slcan": "slcan:/dev/ttyACM0",
    "virtual": "virtual:finger0",
    "udp": "udp:239.0.0.1",
    "serial": "serial:/dev/ttyACM0",
}


def _read_options(text: str, scheme: str, query: str) -> dict[str, Any]:
    try:
        pairs = parse_qsl(query, keep_blank_values=True, strict_parsing=bool(query))
    except ValueError:
        raise AddressError(f"{text!r}: options are written ?name=value&name=value") from None
    options: dict[str, Any] = {}
    for name, value in pairs:
        if name not in _OPTIONS[scheme]:
            known = ", ".join(sorted(_OPTIONS[scheme]))
            raise AddressError(f"{text!r}: no option {name!r} for {scheme}: (there are {known})")
        if name not in _RANGES:
            options[name] = value
            continue
        low, high = _RANGES[name]
        if not value.isdecimal() or len(value) > _DIGITS_MAX or not low <= int(value) <= high:
            raise AddressError(f"{text!r}: {name} must be a whole number in {low}..{high}, not {value!r:.40}")
        options[name] = int(value)
    return options
