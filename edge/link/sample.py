"""A frame's result as the wire's sample: `to_state`. No units change here, only names and validity.

An unknown value is NaN, never 0. Without trusted identities, or without a result, the sample is still sent:
status bits and time, no values.
"""

from itertools import starmap
from math import nan
from typing import Any

from edge.types import Result, Tracks
from hostlink.wire import Contact, State, Status
from hostlink.wire.fields import CONTACTS_MAX
from hostlink.wire.status import status_of

#: Standard deviations that are sent, each with the values that it is of: of two axes the larger one.
SIGMAS = (
    ("displacement_sigma_mm", "displacement_mm", "displacement_mm"),
    ("shear_sigma_mm", "shear_x_mm", "shear_y_mm"),
    ("force_xy_sigma_n", "force_x_n", "force_y_n"),
    ("torque_z_sigma_nmm", "torque_z_nmm", "torque_z_nmm"),
)
# Bits as plain integers: an operation on flags takes as long as all of a frame's values.
_UNCALIBRATED, _SATURATED, _TRACKER_LOST = map(
    int, (Status.UNCALIBRATED, Status.SATURATED, Status.TRACKER_LOST)
)


def to_state(
    measured: Result | None,
    *,
    sample: int,
    status: int,
    capture_time_us: int,
    latency_us: float = nan,
    temperature_degc: float = nan,
) -> State:
    """The sample of one frame.

    measured          None: there is no rest frame, or no image
    sample            number of the measurement; wraps on the wire
    status            bits known so far; SATURATED, UNCALIBRATED and TRACKER_LOST are added from the result
    capture_time_us   start of exposure on this device's monotonic clock
    latency_us        from capture to sending
    Raises            TypeError: a value that the wire has no field for (a programming error)
    """
    values: dict[str, float] = {}
    frame: dict[str, Any] = {
        "sample": sample,
        "capture_time_us": capture_time_us,
        "latency_us": latency_us,
        "temperature_degc": temperature_degc,
    }
    if measured is not None:
        reading, tracks = measured.reading, measured.tracks
        sigmas, found, n = reading.sigmas, reading.contacts, len(tracks.seen)
        values = reading.values
        for name, one, other in SIGMAS:
            if one in sigmas:
                sigma, of_other = sigmas[one], sigmas[other]
                frame[name] = of_other if of_other > sigma else sigma
        if not reading.calibrated:
            status |= _UNCALIBRATED
        if reading.saturated:
            status |= _SATURATED
        if tracks.confidence < Tracks.LOW_CONFIDENCE:
            status |= _TRACKER_LOST
        if n:
            frame["pins_tracked"] = tracks.n_seen / n
        if len(found):
            frame["contact_n"] = len(found)
            frame["contacts"] = tuple(starmap(Contact, found.tolist()[:CONTACTS_MAX]))
    frame["status"] = status_of(status)
    return State.of(values, frame)
