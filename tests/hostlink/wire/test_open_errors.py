"""Errors of an end of the wire that cannot be opened."""

import errno
from pathlib import Path

import can
import pytest
import serial

import hostlink
from edge.errors import SinkError
from edge.link.sinks import open_sink
from hostlink.wire.address import parse_address
from hostlink.wire.open_errors import ADVICE, cannot_open
from tests.support.refusals import one_line


def wrapped(number: int) -> can.CanError:
    """python-can's error for a serial adapter."""
    error = can.exceptions.CanInitializationError("could not open port")
    error.__cause__ = serial.SerialException(number, "could not open port")
    return error


@pytest.fixture
def machine(tmp_path: Path) -> dict[str, Path]:
    """Two CAN interfaces among others, and two ports."""
    for name, kind in (("can1", "280"), ("eth0", "1"), ("vcan0", "280")):
        (tmp_path / "net" / name).mkdir(parents=True)
        (tmp_path / "net" / name / "type").write_text(kind + "\n")
    (tmp_path / "dev").mkdir()
    for name in ("ttyACM3", "ttyS99", "ttyUSB0", "video0"):
        (tmp_path / "dev" / name).touch()
    return {"net": tmp_path / "net", "dev": tmp_path / "dev"}


@pytest.mark.parametrize(
    ("address", "error", "expected"),
    [
        (
            "can:can0",
            OSError(errno.ENODEV, "No such device"),
            "cannot open CAN interface 'can0' (socketcan): No such device; "
            "CAN interfaces here: can1, vcan0; deploy/can-up.sh can0 brings one up",
        ),
        ("can:can0", OSError(errno.EAFNOSUPPORT, ""), "this kernel has no CAN: modprobe can_raw"),
        (
            "serial:/dev/ttyACM0",
            serial.SerialException(errno.ENOENT, "could not open port"),
            "port '/dev/ttyACM0': No such file or directory; serial ports here: {dev}/ttyACM3, {dev}/ttyUSB0",
        ),
        ("slcan:/dev/ttyACM0", wrapped(errno.EACCES), "(slcan): Permission denied; join the group dialout"),
        (
            "serial:/dev/null",
            serial.SerialException("Could not configure"),
            "Could not configure; is it a serial",
        ),
        ("can:x?interface=kvaser", NameError("name 'canGet' is not defined"), "driver installed?"),
        ("can:x?interface=pcan", ValueError("No suitable bit timings found."), "found; its options do not"),
        ("udp:239.0.0.1", wrapped(errno.ENETUNREACH), "ip route add 239.0.0.0/8 dev lo"),
    ],
)
def test_why_it_does_not_open_and_what_to_do(
    machine: dict[str, Path], address: str, error: Exception, expected: str
) -> None:
    message = cannot_open(parse_address(address), error, **machine)
    assert expected.format(**machine) in message
    assert "\n" not in message
    assert "{" not in message


def test_every_advice_is_complete() -> None:
    for text in ADVICE.values():
        assert text.format(channel="c", cans="", ports="")


@pytest.mark.parametrize(
    ("address", "stated"),
    [
        ("can:nosuch0", "cannot open "),
        ("serial:/dev/nosuch", "cannot open "),
        ("slcan:/dev/nosuch", "cannot open serial port '/dev/nosuch' (slcan)"),
        ("can:0?interface=kvaser", "cannot open "),
        ("can:x?interface=nosuch", 'Unknown interface type "nosuch"'),
        ("can:x?interface=pcan&bitrate=999983&dbitrate=7999993", "cannot open "),
        *((text, "it starts with one of can:") for text in ("", "can0", "bus:can0")),
        ("can:", "names no channel"),
        ("can:a?fd", "options are written ?name=value&name=value"),
        ("can:a?fd=2", "fd must be a whole number in 0..1, not '2'"),
        ("can:a?baud=9600", "no option 'baud' for can:"),
        ("serial:/dev/ttyS0?baud=fast", "9600..12000000"),
        ("can:can0?node=200", "1..127"),
        *(
            (f"udp:{group}", f"{group} is no multicast group; give one, e.g. udp:239.0.0.1")
            for group in ("8.8.8.8", "300.1.1.1", "localhost", "::1")
        ),
    ],
)
def test_both_ends_refuse_an_address_in_the_same_line(address: str, stated: str) -> None:
    at_host = one_line(hostlink.ConnectError, hostlink.connect, address)
    assert at_host == one_line(SinkError, open_sink, address)
    assert stated in at_host
