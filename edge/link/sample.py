"""A frame's result as the wire's sample: `to_state`. No units change here, only names and validity.

An unknown value is NaN, never 0. Without trusted identities, or without a result, the sample is still sent:
status bits and time, no values.
"""

from math import nan
from typing import Any

from edge.types import Result, Tracks
from hostlink.wire import Contact, State, Status
from hostlink.wire.fields import CONTACTS_MAX

#: Standard deviations that are sent, each with the values that it is of; two axes share the larger one.
SIGMAS = (
    ("displacement_sigma_mm", ("displacement_mm",)),
    ("shear_sigma_mm", ("shear_x_mm", "shear_y_mm")),
    ("force_xy_sigma_n", ("force_x_n", "force_y_n")),
    ("torque_z_sigma_nmm", ("torque_z_nmm",)),
)


def to_state(
    measured: Result | None,
    *,
    sample: int,
    status: Status,
    capture_time_us: int,
    latency_us: float = nan,
    temperature_degc: float = nan,
) -> State:
    """The sample of one frame.

    measured          None: there is no rest frame, or no image
    sample            number of the measurement; continues over gaps, wraps on the wire
    status            bits known so far; SATURATED, UNCALIBRATED and TRACKER_LOST are added from the result
    capture_time_us   start of exposure on this device's monotonic clock
    latency_us        from capture to sending
    Raises            TypeError: a value that the wire has no field for (a programming error)
    """
    frame: dict[str, Any] = {
        "sample": sample,
        "status": status,
        "capture_time_us": capture_time_us,
        "latency_us": latency_us,
        "temperature_degc": temperature_degc,
    }
    if measured is None:
        return State(**frame)
    reading, tracks = measured.reading, measured.tracks
    sigmas, found, n = reading.sigmas, reading.contacts, len(tracks.seen)
    frame |= reading.values
    for name, parts in SIGMAS:
        if parts[0] in sigmas:
            frame[name] = max([sigmas[part] for part in parts])
    if not reading.calibrated:
        frame["status"] |= Status.UNCALIBRATED
    if reading.saturated:
        frame["status"] |= Status.SATURATED
    if tracks.confidence < Tracks.LOW_CONFIDENCE:
        frame["status"] |= Status.TRACKER_LOST
    if n:
        frame["pins_tracked"] = tracks.n_seen / n
    if len(found):
        frame["contact_n"] = len(found)
        frame["contacts"] = tuple([Contact(*row) for row in found[:CONTACTS_MAX].tolist()])
    return State(**frame)
