"""A frame's result as the wire's sample, and its bytes. No units change here, only names and validity.

An unknown value is NaN, never 0. Without trusted identities, or without a result, the sample is still sent:
status bits and time, no values.

A kernel (`CONTRIBUTING.md`, "Kernels"). Its bytes are those that `hostlink.wire.state.quantise` gives, by the
same table of fields; that function explains the rules.
"""

import cython
import numpy as np

from edge.types import Reading, Result, Tracks
from hostlink.wire import State, Status
from hostlink.wire.body import received
from hostlink.wire.fields import SCHEMA

if cython.compiled:
    from cython.cimports.cpython.bytes import PyBytes_FromStringAndSize
    from cython.cimports.edge.geometry.copies import numbers_of
    from cython.cimports.libc.math import NAN, isnan, rint
else:
    from math import isnan
    from math import nan as NAN  # noqa: N812

    from edge.geometry.copies import numbers_of

    rint = round

#: Standard deviations that are sent, each with the values that it is of: of two axes the larger one.
SIGMAS = (
    ("displacement_sigma_mm", "displacement_mm", "displacement_mm"),
    ("shear_sigma_mm", "shear_x_mm", "shear_y_mm"),
    ("force_xy_sigma_n", "force_x_n", "force_y_n"),
    ("torque_z_sigma_nmm", "torque_z_nmm", "torque_z_nmm"),
)
UNCALIBRATED = cython.declare(cython.int, int(Status.UNCALIBRATED))
SATURATED = cython.declare(cython.int, int(Status.SATURATED))
TRACKER_LOST = cython.declare(cython.int, int(Status.TRACKER_LOST))
LOW_CONFIDENCE = cython.declare(cython.double, Tracks.LOW_CONFIDENCE)


@cython.final
@cython.cclass
class StatePacker:
    """Makes one sample after the other."""

    places: dict[str, int]  # of the fields in the table
    sigmas: list[tuple[int, str, str]]  # SIGMAS, by the place of each
    plain: cython.uchar[::1]
    size: cython.int[::1]  # bytes
    scale: cython.double[:, ::1]  # step, low, high
    raw: cython.longlong[:, ::1]  # of low, high, NaN
    reading: Reading | None  # the last one: without a touch it stays the same
    known: cython.double[::1]  # its numbers, and the status bits that follow from it
    values: cython.double[::1]  # numbers of the sample
    exact: cython.uchar[::1]  # the same memory
    body: cython.uchar[::1]
    contacts: cython.Py_ssize_t  # place of the contacts' fields, from here up to there
    behind: cython.Py_ssize_t
    sample: cython.Py_ssize_t  # places of other fields
    status: cython.Py_ssize_t
    time: cython.Py_ssize_t
    latency: cython.Py_ssize_t
    temperature: cython.Py_ssize_t
    tracked: cython.Py_ssize_t
    count: cython.Py_ssize_t

    def __init__(self) -> None:
        rows = SCHEMA.layout
        self.plain = np.array([f.plain for f in rows], np.uint8)
        self.size = np.array([f.size for f in rows], np.int32)
        self.scale = np.array([(f.scale, f.low, f.high) for f in rows], np.float64)
        self.raw = np.array([(f.raw_low, f.raw_high, f.raw_nan(8 * f.size)) for f in rows], np.int64)
        self.reading, self.known, values = None, np.empty(len(rows)), np.empty(len(rows))
        self.values, self.exact = values, values.view(np.uint8)
        self.body = np.empty(SCHEMA.body.size, np.uint8)
        self.body[0] = SCHEMA.version
        self.places = at = {f.name: i for i, f in enumerate(rows)}
        self.sigmas = [(at[name], one, other) for name, one, other in SIGMAS]
        self.contacts = at["contact0_x_mm"]
        self.behind = self.contacts + sum(f.contact for f in rows)
        self.sample, self.status, self.time = at["sample"], at["status"], at["capture_time_us"]
        self.latency, self.temperature = at["latency_us"], at["temperature_degc"]
        self.tracked, self.count = at["pins_tracked"], at["contact_n"]

    def to_state(
        self, measured: Result | None, sample: cython.longlong, status: cython.longlong,
        capture_time_us: cython.longlong, latency_us: cython.double = NAN,
        temperature_degc: cython.double = NAN,
    ) -> State:  # fmt: skip
        """The sample of one frame, packed; it keeps the numbers as they were before that, too.

        measured          None: there is no rest frame, or no image
        sample            number of the measurement; wraps on the wire
        status            bits known so far; SATURATED, UNCALIBRATED, TRACKER_LOST are added from the result
        capture_time_us   start of exposure on this device's monotonic clock
        latency_us        from capture to sending
        Raises            TypeError: a value that the wire has no field for (a programming error)
        """
        i: cython.Py_ssize_t
        values: cython.double[::1] = self.values
        reading: Reading | None = None if measured is None else measured.reading
        if reading is None or reading is not self.reading:
            self._take(reading)
        for i in range(values.shape[0]):
            values[i] = self.known[i]
        status |= cython.cast(cython.longlong, values[self.status])
        if measured is not None:
            tracks: Tracks = measured.tracks
            confidence: cython.double = tracks.confidence
            if confidence < LOW_CONFIDENCE:
                status |= TRACKER_LOST
            seen_n: cython.double = tracks.n_seen
            n: cython.double = len(tracks.seen)
            if n > 0.0:
                values[self.tracked] = seen_n / n
        values[self.sample], values[self.status], values[self.time] = sample, status, capture_time_us
        values[self.latency], values[self.temperature] = latency_us, temperature_degc
        exact = _bytes_of(self.exact)
        return received(State, self._packed(), exact)

    @cython.cfunc
    def _take(self, reading: Reading | None) -> cython.void:
        i: cython.Py_ssize_t
        self.reading = None
        for i in range(self.known.shape[0]):
            self.known[i] = NAN
        self.known[self.status] = self.known[self.count] = 0.0
        if reading is None:
            return
        values: dict[str, float] = reading.values
        for name, value in values.items():
            place: object = self.places.get(name)
            if place is None:
                raise TypeError(f"a sample has no field {name}")
            i = place
            self.known[i] = value
        sigmas: dict[str, float] = reading.sigmas
        for i, one, other in self.sigmas:
            sigma: object = sigmas.get(one)
            if sigma is not None:
                self.known[i] = max(cython.cast(cython.double, sigma), sigmas[other])
        n: cython.Py_ssize_t = len(reading.contacts)
        self.known[self.count] = n
        if n > 0:
            numbers = numbers_of(reading.contacts, 3 * n)
            for i in range(min(3 * n, self.behind - self.contacts)):
                self.known[self.contacts + i] = numbers[i]
        if not reading.calibrated:
            self.known[self.status] += UNCALIBRATED
        if reading.saturated:
            self.known[self.status] += SATURATED
        self.reading = reading

    @cython.cfunc
    def _packed(self) -> bytes:
        i: cython.Py_ssize_t
        k: cython.Py_ssize_t
        at: cython.Py_ssize_t = 1
        raw: cython.longlong
        self._drop_unplaced()
        self.values[self.count] = min(self.values[self.count], self.scale[self.count, 2])
        for i in range(self.size.shape[0]):
            raw = cython.cast(cython.longlong, self.values[i]) if self.plain[i] else self._quantise(i)
            for k in range(self.size[i]):
                self.body[at + k] = raw >> 8 * k & 0xFF
            at += self.size[i]
        return _bytes_of(self.body)

    @cython.cfunc
    @cython.exceptval(check=False)
    def _quantise(self, i: cython.Py_ssize_t) -> cython.longlong:
        value: cython.double = self.values[i]
        if isnan(value):
            return self.raw[i, 2]
        if value >= self.scale[i, 2]:
            return self.raw[i, 1]
        if value <= self.scale[i, 1]:
            return self.raw[i, 0]
        return cython.cast(cython.longlong, rint(value / self.scale[i, 0]))

    @cython.cfunc
    def _drop_unplaced(self) -> cython.void:
        values: cython.double[::1] = self.values
        at: cython.Py_ssize_t
        end: cython.Py_ssize_t = self.contacts
        for at in range(self.contacts, self.behind, 3):
            if not (isnan(values[at]) or isnan(values[at + 1])):
                values[end], values[end + 1], values[end + 2] = values[at], values[at + 1], values[at + 2]
                end += 3
        for at in range(end, self.behind):
            values[at] = NAN


@cython.cfunc
def _bytes_of(memory: cython.uchar[::1]) -> bytes:
    if not cython.compiled:
        return bytes(memory)
    return PyBytes_FromStringAndSize(cython.cast(cython.p_char, cython.address(memory[0])), memory.shape[0])
