"""Decoder and client for voronoi-touch fingertips.

    import hostlink

    with hostlink.connect("can:can0") as hand:            # or serial:/dev/ttyACM0, udp:239.0.0.1, ...
        hand.finger(1).tare()                             # waits; refused while something touches it
        for sample in hand.samples(timeout_s=0.05):       # all fingers on the bus, as samples come
            print(sample.finger, sample.host_time_s, sample.state.displacement_mm)

    connect(address)            Connection: iterate, `async for`, on_sample(callback), latest(), statistics
    Connection.finger(node)     Finger: latest, info, tare, set_rate, get/set, upload_calibration, clock
    Sample                      finger, state, host_time_s +- host_error_s, arrival_s, lost_n, age_s
    Connection.window()         all samples since the last call, as arrays: for learning (`hostlink.window`)
    NO_CONTROL                  status bits of samples that must never move a hand
    CanDecoder, SerialDecoder   the same without any I/O: bytes in, events out (`hostlink.decoder`)
    decode_recording(path)      events of a .log, .blf, .serial or .mcap file (`hostlink.recording`)
    to_arrays, to_pandas        samples as NumPy columns or a DataFrame (extra `data`; `hostlink.table`)
    LinkError and its children  `hostlink.errors`; a user's mistake is a UsageError, one line

Values, units and ranges: WIRE.md. `python -m hostlink --help` for the tools.
Names are imported when they are first used, so that programs start quickly; python-can and pyserial
when a link is opened, numpy by `to_arrays` alone.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hostlink.client import Connection, Finger, Info, connect
    from hostlink.decoder import CanDecoder, SerialDecoder
    from hostlink.errors import (
        ConnectError,
        LinkDown,
        LinkError,
        LinkTimeout,
        ObjectAborted,
        RestFrameRefused,
        UsageError,
        VersionMismatch,
    )
    from hostlink.events import Sample
    from hostlink.finger import RestFrameOutcome
    from hostlink.order_and_time import LinkStatistics
    from hostlink.recording import decode_recording
    from hostlink.table import to_arrays, to_pandas
    from hostlink.wire import (
        NO_CONTROL,
        CanIds,
        Contact,
        FaultCode,
        RestFrameReason,
        RestFrameState,
        State,
        Status,
    )

__all__ = [
    "NO_CONTROL",
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
    "LinkStatistics",
    "LinkTimeout",
    "ObjectAborted",
    "RestFrameOutcome",
    "RestFrameReason",
    "RestFrameRefused",
    "RestFrameState",
    "Sample",
    "SerialDecoder",
    "State",
    "Status",
    "UsageError",
    "VersionMismatch",
    "connect",
    "decode_recording",
    "to_arrays",
    "to_pandas",
]

_MODULES = {
    "hostlink.client": ("Connection", "Finger", "Info", "connect"),
    "hostlink.decoder": ("CanDecoder", "SerialDecoder"),
    "hostlink.errors": (
        "ConnectError",
        "LinkDown",
        "LinkError",
        "LinkTimeout",
        "ObjectAborted",
        "RestFrameRefused",
        "UsageError",
        "VersionMismatch",
    ),
    "hostlink.events": ("Sample",),
    "hostlink.finger": ("RestFrameOutcome",),
    "hostlink.recording": ("decode_recording",),
    "hostlink.order_and_time": ("LinkStatistics",),
    "hostlink.table": ("to_arrays", "to_pandas"),
    "hostlink.wire": (
        "NO_CONTROL",
        "CanIds",
        "Contact",
        "FaultCode",
        "RestFrameReason",
        "RestFrameState",
        "State",
        "Status",
    ),
}
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names}

if not TYPE_CHECKING:  # or a type checker would take any name for one of ours

    def __getattr__(name: str) -> object:
        """A public name, or a module that has some (`hostlink.errors`)."""
        if f"hostlink.{name}" in _MODULES:
            return import_module(f"hostlink.{name}")
        if name not in _MODULE_OF:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = globals()[name] = getattr(import_module(_MODULE_OF[name]), name)
        return value

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__})
