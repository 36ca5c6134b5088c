"""One line of error and advice for an end of the wire that cannot be opened, the same for both ends.

python-can and pyserial wrap the system's error in their own; the advice depends on the system's error number.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from hostlink.wire.address import Address

__all__ = ["cannot_open", "message_of"]

_ARPHRD_CAN: Final = "280"  # linux/if_arp.h
_TAKEN: Final = frozenset({errno.EBUSY, errno.EAGAIN})
_PORTS: Final = ("ttyACM*", "ttyUSB*", "ttyAMA*", "ttyS[0-9]")
_DRIVER: Final = "is the adapter's driver installed? python-can's documentation says what it needs"
_ROUTE: Final = "give it a way: ip link set lo multicast on; ip route add 239.0.0.0/8 dev lo"

#: Advice by python-can's interface ("serial": a line) and the system's error; None: any other.
ADVICE: Final[dict[tuple[str, int | None], str]] = {
    ("socketcan", errno.ENODEV): "CAN interfaces here: {cans}; deploy/can-up.sh {channel} brings one up",
    ("socketcan", errno.EAFNOSUPPORT): "this kernel has no CAN: modprobe can_raw, or another kernel",
    ("socketcan", None): "ip -details link show {channel} says how it is set up",
    ("serial", errno.ENOENT): "serial ports here: {ports}",
    ("serial", errno.EACCES): "join the group dialout, log in again",
    ("serial", errno.EBUSY): "end that program, or use its link",
    ("serial", errno.EAGAIN): "end that program, or use its link",
    ("serial", None): "is it a serial port? Here are: {ports}",
    ("udp_multicast", errno.ENODEV): _ROUTE,
    ("udp_multicast", errno.ENETUNREACH): _ROUTE,
    (
        "udp_multicast",
        errno.EADDRINUSE,
    ): "another program keeps the port to itself; give ?port=43114",
}


def cannot_open(
    address: Address, error: BaseException, net: Path = Path("/sys/class/net"), dev: Path = Path("/dev")
) -> str:
    """One line for an error of python-can or pyserial: what cannot be opened, why, what to do.

    net, dev  where this system lists its interfaces and devices
    """
    kind = "serial" if address.interface in ("", "slcan") else address.interface
    number = next((n for e in _chain(error) if (n := getattr(e, "errno", None))), None)
    advice = ADVICE.get((kind, number)) or ADVICE.get((kind, None), _DRIVER)
    if kind not in ("serial", "socketcan") and isinstance(error, ValueError):
        advice = "its options do not suit it"  # the driver exists, and rejected them
    here = {"channel": address.channel, "cans": "", "ports": ""}
    if "{cans}" in advice:
        here["cans"] = ", ".join(p.parent.name for p in sorted(net.glob("*/type")) if _is_can(p)) or "none"
    if "{ports}" in advice:
        found = [path for pattern in _PORTS for path in sorted(dev.glob(pattern))]
        here["ports"] = ", ".join(map(str, found)) or "none"
    what_to_do = advice.format_map(here)
    what = "serial port" if kind == "serial" else "CAN interface"
    by = f" ({address.interface})" if address.interface else ""
    why = os.strerror(number) if number else message_of(error)
    if kind == "serial" and number in _TAKEN:
        why = "another program has it open"
    return f"cannot open {what} {address.channel!r}{by}: {why}; {what_to_do}"


def message_of(error: BaseException) -> str:
    """The error in one line, without the libraries' wrapping."""
    number = getattr(error, "errno", None)
    if isinstance(error, OSError) and number:
        return os.strerror(number)
    return str(error).splitlines()[0].rstrip(".") if str(error) else type(error).__name__


def _chain(error: BaseException) -> Iterator[BaseException]:
    """The error and its causes."""
    link: BaseException | None = error
    while link is not None:
        yield link
        link = link.__cause__


def _is_can(path: Path) -> bool:
    try:
        return path.read_text().strip() == _ARPHRD_CAN
    except OSError:  # gone meanwhile
        return False
