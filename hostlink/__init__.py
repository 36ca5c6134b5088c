"""Decoder and client for voronoi-touch fingertips.

    import hostlink

    with hostlink.connect("can:can0") as hand:            # or serial:/dev/ttyACM0, udp:239.0.0.1, ...
        hand.finger(1).tare()                             # refused while something touches it
        for sample in hand:                               # all fingers on the bus, as samples come
            print(sample.finger, sample.host_time_s, sample.state.displacement_mm)

    connect(address)            Connection: iterate, `async for`, on_sample(callback), latest(), statistics
    Connection.finger(node)     Finger: latest, info, tare, set_rate, get/set, upload_calibration, clock
    Sample                      finger, state, host_time_s +- host_error_s, arrival_s, lost_n, age_s
    CanDecoder, SerialDecoder   the same without any I/O: bytes in, events out (`hostlink.decoder`)
    decode_recording(path)      events of a .log, .blf or .serial file (`hostlink.recording`)
    LinkError and its children  `hostlink.errors`; a user's mistake is a UsageError, one line

Values, units and ranges: WIRE.md. `python -m hostlink --help` for the tools.
python-can, pyserial and canopen are loaded when a link is opened, numpy never.
"""

from hostlink.client import Connection, Finger, Info, Sample, connect
from hostlink.decoder import CanDecoder, SerialDecoder, Statistics
from hostlink.errors import (
    ConnectError,
    LinkDown,
    LinkError,
    LinkTimeout,
    ObjectAborted,
    UsageError,
    VersionMismatch,
)
from hostlink.recording import decode_recording
from hostlink.wire import CanIds, Contact, FaultCode, State, Status

__all__ = [
    "CanDecoder",
    "CanIds",
    "ConnectError",
    "Connection",
    "Contact",
    "FaultCode",
    "Finger",
    "Info",
    "LinkDown",
    "LinkError",
    "LinkTimeout",
    "ObjectAborted",
    "Sample",
    "SerialDecoder",
    "State",
    "Statistics",
    "Status",
    "UsageError",
    "VersionMismatch",
    "connect",
    "decode_recording",
]
