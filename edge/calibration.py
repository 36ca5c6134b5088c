"""From geometry to mechanical units: the calibration file, and its application to one frame.

The file is JSON, versioned, validated on load against the structures below, and replaced atomically. A
calibration belongs to one tip: it holds the rest pins it was made with, and the tare must find them again.
It holds models as data, never code:

    Curve     y = piecewise linear in one real input            the paper's displacement curve
    Moments   Y = sum_k weight_k * prod_j input[term_kj]        polynomial in complex inputs, complex weights;
              one output is its real part, two outputs (x, y) are its real and imaginary part

Rules
- Inputs are named and dimensionless: lengths are divided by the tip's radius, areas by its square, so that
  a weight does not depend on the camera's resolution. A star behind a name means the complex conjugate.
- Vectors are complex numbers x + i y: motion modes `c_ab` (`edge.features.modes`), place `p` on the disc.
- A value outside of the range that the data supported is set to the range's end and named in `saturated`.
- What the file has no model for is NaN: no raw number goes out in disguise.
- An untouched tip reads zero: that is what the tare defines.
- What follows from calibrated values and the scale has no model of its own (`DERIVED`): pressure is force
  over contact area; area, where no model gives it, is the contacts' in the image times the scale squared;
  slip speed is the motion that no load explains, times the scale, over the time between two frames.
- A single contact's depth is the frame's displacement: all pins bear witness to it, and on a ball that is
  several times closer than what the contact's own height and size say (0.05 against 0.2..0.3 mm rms).
- How many contacts there are has no unit: it goes out without a calibration too.
- Every value has a standard deviation: the residual of the fit on held-out frames, widened where a frame
  lies far from the data (leverage), as in Bayesian linear regression.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
import stat
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

from edge import _moments
from edge.errors import CalibrationError
from edge.types import Array, Complex, ContactRegion, Features, PinPattern, Pins, Reading, Rest

FORMAT = "voronoi-touch-calibration"
VERSION = 1
MAX_BYTES = 8 << 20  # a 1000-pin tip with every model takes about 0.5 MB
MODES = tuple(f"c{a}{d - a}" for d in range(6) for a in range(d, -1, -1))  # as `edge.features.modes` has them

Positive = Annotated[float, msgspec.Meta(gt=0)]
Point = tuple[float, float]

#: Value names a model may have as output, and what an untouched tip reads.
UNTOUCHED: dict[str, float] = {
    "displacement_mm": 0.0,
    "force_n": 0.0,
    "contact_area_mm2": 0.0,
    "shear_x_mm": 0.0,
    "shear_y_mm": 0.0,
    "torsion_deg": 0.0,
    "tilt_x_deg": math.nan,  # nothing under the tip has no tilt
    "tilt_y_deg": math.nan,
}
#: Made from other values and the scale, not by models of their own.
DERIVED = ("pressure_kpa", "orientation_deg", "slip_speed_mm_s", "slip_probability")
#: Outputs of models that are evaluated once a contact, from the contact's own inputs.
CONTACT_OUTPUTS = ("contact_x_mm", "contact_y_mm", "contact_depth_mm")

#: Inputs made of a frame's features; the order is that of `frame_inputs`. `volume` is real, `shear` the
#: plain mean of the pins' motion, `c_ab` the modes of motion.
FRAME_INPUTS: tuple[str, ...] = ("volume", "shear", *MODES)
#: Inputs made of one contact: place on the tip's unit disc, height of the maximum, the frame's mean motion,
#: for a shear shifts the maximum within the contact, and the root of the contact's area.
CONTACT_INPUTS: tuple[str, ...] = ("p", "peak", "shear", "size")


class Curve(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="curve"):
    """A monotone curve through knots (input, output); flat beyond its ends."""

    output: str
    input: str
    knots: list[Point]
    sigma: Positive


class Moments(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="moments"):
    """A polynomial in complex inputs: one output (real part) or two (real and imaginary part).

    terms     each a list of input names, multiplied; [] is the constant
    weights   one (real, imaginary) pair a term
    valid     [low, high] of each output in the data it was fitted to
    sigma     of each output, from held-out frames
    spread    how the sigma widens away from the data: rows (real, imaginary) of a factor L over the terms,
              variance = sigma^2 (1 + |L psi|^2); empty: not known
    """

    outputs: list[str]
    terms: list[list[str]]
    weights: list[Point]
    valid: list[Point]
    sigma: list[Positive]
    spread: list[list[Point]] = []


class Sensor(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The tip and camera that the file belongs to."""

    serial: str
    size_px: tuple[int, int]
    pin_radius_px: Positive
    pitch_px: Positive
    centre_px: Point
    tip_radius_px: Positive
    background: float
    brightness: float
    noise: float
    rest_xy_px: list[Point]


class Data(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What it was made from, for the record."""

    source: str
    sha256: str
    n_frames: int
    created: str


class CalibrationFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The file's top level."""

    format: str
    version: int
    sensor: Sensor
    mm_per_px: Positive | None
    models: list[Curve | Moments]
    data: Data


def frame_inputs(features: Features, tip_radius_px: float) -> Complex:
    """The inputs `FRAME_INPUTS` of one frame, NaN where a feature was not computed.

    Returns  (23,) complex128, dimensionless
    """
    z = np.full(len(FRAME_INPUTS), np.nan, dtype=np.complex128)
    r = tip_radius_px
    if features.volume_px2 is not None:
        z[0] = features.volume_px2 / (math.pi * r * r)
    if features.shear_px is not None:
        z[1] = complex(*features.shear_px.tolist()) / r
    if features.modes_px is not None:
        z[2:] = features.modes_px / r
    return z


def contact_inputs(contact: ContactRegion, features: Features, pattern: PinPattern) -> Complex:
    """The inputs `CONTACT_INPUTS` of one contact of a frame.

    Returns  (4,) complex128, dimensionless
    """
    x, y = contact.xy_img.tolist()
    x0, y0 = pattern.centre_img.tolist()
    shear = math.nan if features.shear_px is None else complex(*features.shear_px.tolist())
    r = pattern.tip_radius_px
    size = math.sqrt(contact.area_px2) / r
    place = complex((x - x0) / r, (y - y0) / r)
    return np.array([place, contact.peak, shear / r, size], dtype=np.complex128)


def _curve(model: Curve, inputs: Sequence[str], where: str) -> tuple[int, Array, float]:
    """A curve as `edge._moments` takes it."""
    column = int(term_columns([[model.input]], inputs, where)[0, 0])
    knots = np.array(model.knots, dtype=np.float64).reshape(-1, 2)
    if len(knots) < 2 or not np.all(np.isfinite(knots)):
        raise CalibrationError(f"{where}.knots: at least two finite points are needed")
    if np.any(np.diff(knots[:, 0]) <= 0):
        raise CalibrationError(f"{where}.knots: inputs must increase from knot to knot")
    slopes = np.diff(knots[:, 1])
    if np.any(slopes < 0) and np.any(slopes > 0):
        raise CalibrationError(f"{where}.knots: outputs must rise or fall all the way (monotone)")
    return column, knots, float(model.sigma)


def _polynomial(
    model: Moments, inputs: Sequence[str], where: str
) -> tuple[NDArray[np.int32], Array, Array, Array, Array]:
    """A polynomial as `edge._moments` takes it."""
    n_out, n_terms = len(model.outputs), len(model.terms)
    if n_out not in (1, 2):
        raise CalibrationError(f"{where}.outputs: one name, or two for x and y")
    terms = term_columns(model.terms, inputs, where).astype(np.int32)
    weights = _complex_rows([model.weights], n_terms, f"{where}.weights").view(np.float64)
    valid = np.array(model.valid, dtype=np.float64).reshape(-1, 2)
    if len(valid) != n_out or not np.all(valid[:, 0] <= valid[:, 1]):
        raise CalibrationError(f"{where}.valid: one range [low, high] for each of {n_out} outputs is needed")
    if len(model.sigma) != n_out:
        raise CalibrationError(f"{where}.sigma: one for each of {n_out} outputs is needed")
    spread = _complex_rows(model.spread, n_terms, f"{where}.spread").view(np.float64)
    return terms, weights, spread, valid, np.array(model.sigma, dtype=np.float64)


class _Models:
    """The models that share their inputs, ready to run.

    outputs  names, in the file's order
    sigmas   each output's, near the data
    """

    def __init__(self, models: Sequence[tuple[Curve | Moments, str]], inputs: Sequence[str]) -> None:
        ready: list[_moments.Curve | _moments.Polynomial] = []
        outputs: list[str] = []
        sigmas: list[float] = []
        for model, where in models:
            if isinstance(model, Curve):
                ready.append(_curve(model, inputs, where))
                outputs.append(model.output)
                sigmas.append(float(model.sigma))
            else:
                ready.append(_polynomial(model, inputs, where))
                outputs += model.outputs
                sigmas += map(float, model.sigma)
        self.outputs, self.sigmas = tuple(outputs), tuple(sigmas)
        self._models = _moments.Models(len(inputs), tuple(ready))

    def run(self, z: Complex) -> Array:
        """Value, sigma, and 1 where out of range, else 0.

        z        (rows, inputs) complex128
        Returns  (rows, outputs, 3)
        """
        out = np.empty((len(z), len(self.outputs), 3))
        self._models.run(z.view(np.float64), out)
        return out


def term_columns(terms: list[list[str]], inputs: Sequence[str], where: str) -> NDArray[np.intp]:
    """Terms as columns of the row (inputs, conjugates of inputs, 1), padded with the 1's column.

    Returns  (n_terms, longest term) intp
    """
    names = (*inputs, *(f"{name}*" for name in inputs))
    order = {name: i for i, name in enumerate(names)}
    table = np.full((len(terms), max([1, *map(len, terms)])), len(names), dtype=np.intp)
    for row, term in zip(table, terms, strict=True):
        for i, name in enumerate(term):
            if name not in order:
                raise CalibrationError(f"{where}: unknown input '{name}'; known: {', '.join(inputs)}")
            row[i] = order[name]
    return table


def evaluate_terms(z: Complex, terms: NDArray[np.intp]) -> Complex:
    """Products of inputs.

    z        (n, k) complex128, one row a frame
    terms    from `term_columns`
    Returns  (n, n_terms) complex128
    """
    row = np.hstack([z, z.conj(), np.ones((len(z), 1))])
    result: Complex = row[:, terms].prod(axis=2)
    return result


def _complex_rows(rows: list[list[Point]], width: int, where: str) -> Complex:
    if any(len(row) != width for row in rows):
        raise CalibrationError(f"{where}: a pair of numbers for each of {width} terms is needed")
    matrix = np.array(rows, dtype=np.float64).reshape(len(rows), width, 2)
    if not np.all(np.isfinite(matrix)):
        raise CalibrationError(f"{where}: every number must be finite")
    result: Complex = matrix.view(np.complex128)[..., 0]
    return result


class Calibration:
    """A validated calibration file, ready to be applied.

    rest       the tip it belongs to, in the file's order of pins
    mm_per_px  scale at the tip's centre; None: not known, places of contact are NaN
    content_id 32 bits of the content's hash; goes over the wire as the calibration's identity
    """

    def __init__(self, content: CalibrationFile, where: str = "calibration") -> None:
        if content.format != FORMAT:
            raise CalibrationError(f"{where}: format is '{content.format}', not '{FORMAT}'")
        if content.version != VERSION:
            raise CalibrationError(
                f"{where}: version {content.version}, this program reads version {VERSION}; fit it again"
            )
        self.content = content
        self.encoded = msgspec.json.encode(content) + b"\n"
        self.content_id = int.from_bytes(hashlib.sha256(msgspec.json.encode(content)).digest()[:4], "little")
        self.mm_per_px = content.mm_per_px
        self.rest = _rest(content.sensor, f"{where}: sensor")
        of_frame: list[tuple[Curve | Moments, str]] = []
        of_contact: list[tuple[Curve | Moments, str]] = []
        seen: set[str] = set()
        for i, model in enumerate(content.models):
            at = f"{where}: models[{i}]"
            names = [model.output] if isinstance(model, Curve) else model.outputs
            per_contact = all(name in CONTACT_OUTPUTS for name in names)
            for name in names:
                if not per_contact and name not in UNTOUCHED:
                    known = ", ".join((*UNTOUCHED, *CONTACT_OUTPUTS))
                    raise CalibrationError(f"{at}: unknown output '{name}'; known: {known}")
                if name in seen:
                    raise CalibrationError(f"{at}: a second model for '{name}'")
                seen.add(name)
            (of_contact if per_contact else of_frame).append((model, at))
        self._frame = _Models(of_frame, FRAME_INPUTS)
        self._contact = _Models(of_contact, CONTACT_INPUTS)
        self._columns = [CONTACT_OUTPUTS.index(name) for name in self._contact.outputs]
        self._placed = seen >= {"contact_x_mm", "contact_y_mm"}
        self._untouched = {name: UNTOUCHED[name] for name in self._frame.outputs}
        self._untouched_sigmas = dict(zip(self._frame.outputs, self._frame.sigmas, strict=True))
        self.outputs = frozenset(seen)

    @classmethod
    def load(cls, path: str | Path) -> Calibration:
        """Read and check a file. Raises CalibrationError, naming the file and the key."""
        path = Path(path)
        try:
            if path.stat().st_size > MAX_BYTES:
                raise CalibrationError(f"{path}: larger than {MAX_BYTES >> 20} MiB, so not a calibration")
            raw = path.read_bytes()
        except OSError as error:
            raise CalibrationError(f"{path}: cannot be read: {error.strerror}") from None
        return cls.parse(raw, str(path))

    @classmethod
    def parse(cls, raw: bytes, where: str) -> Calibration:
        """Check a file's bytes (read from disk, or uploaded over the bus)."""
        try:
            content = msgspec.json.decode(raw, type=CalibrationFile)
        except (msgspec.MsgspecError, UnicodeDecodeError) as error:
            raise CalibrationError(f"{where}: not a calibration file: {error}") from None
        return cls(content, where)

    def save(self, path: str | Path) -> None:
        """Write the file so that a reader, or a loss of power, finds the old or the new one, whole."""
        write_atomically(Path(path), self.encoded)

    def apply(self, features: Features, pattern: PinPattern, interval_s: float | None = None) -> Reading:
        """Values of one frame in mechanical units.

        pattern     of the running tip; gives the place and size of the tip's circle
        interval_s  time since the frame before this one; None: not known, no speed can be given
        """
        saturated: frozenset[str] = frozenset()
        if features.touched:
            rows = self._frame.run(frame_inputs(features, pattern.tip_radius_px)[None])[0]
            ys, spreads, outside = rows.T.tolist()
            names = self._frame.outputs
            values, sigmas = dict(zip(names, ys, strict=True)), dict(zip(names, spreads, strict=True))
            if any(outside):
                beyond = zip(names, ys, outside, strict=True)
                saturated = frozenset(name for name, y, out in beyond if out and math.isfinite(y))
        else:
            values, sigmas = self._untouched.copy(), self._untouched_sigmas.copy()
        self._derive(features, values, sigmas, interval_s)
        contacts = self._places(features, pattern)
        if len(contacts) == 1 and "displacement_mm" in values:
            contacts[0, 2] = values["displacement_mm"]
        return Reading(values, sigmas, contacts, saturated, calibrated=True)

    def frame_values(self, z: Complex) -> Iterator[tuple[str, float, float, bool]]:
        """Name, value, sigma and whether out of range, of every output, from `frame_inputs`."""
        rows = self._frame.run(z[None])[0].tolist()
        for name, (y, sigma, outside) in zip(self._frame.outputs, rows, strict=True):
            yield name, y, sigma, bool(outside)

    def _derive(
        self,
        features: Features,
        values: dict[str, float],
        sigmas: dict[str, float],
        interval_s: float | None,
    ) -> None:
        """Add what follows from other values and the scale; see the file's head."""
        found, scale = features.contacts, self.mm_per_px
        if found is not None:
            if "contact_area_mm2" not in values and scale is not None:
                values["contact_area_mm2"] = sum(c.area_px2 for c in found) * scale * scale
            if found:
                values["orientation_deg"] = math.degrees(found[0].orientation_rad)
        force, area = values.get("force_n"), values.get("contact_area_mm2")
        if force is not None and area is not None:
            if not features.touched:
                values["pressure_kpa"] = 0.0
            elif area > 0.0:
                pressure = 1e3 * force / area
                values["pressure_kpa"] = pressure
                if "contact_area_mm2" in sigmas:
                    parts = (1e3 * sigmas["force_n"] / area, pressure * sigmas["contact_area_mm2"] / area)
                    sigmas["pressure_kpa"] = math.hypot(*parts)
        if features.slip_px is not None and features.slip_probability is not None:
            values["slip_probability"] = features.slip_probability
            if not features.touched:
                values["slip_speed_mm_s"] = 0.0
            elif scale is not None and interval_s is not None and interval_s > 0.0:
                values["slip_speed_mm_s"] = features.slip_px * scale / interval_s

    def _places(self, features: Features, pattern: PinPattern) -> Array:
        contacts = features.contacts
        if not contacts:
            return np.empty((0, 3))
        places = np.full((len(contacts), 3), np.nan)
        if self.mm_per_px is not None and not self._placed:
            for row, contact in zip(places, contacts, strict=True):
                row[:2] = (contact.xy_img - pattern.centre_img) * self.mm_per_px
        if self._columns:
            z = np.array([contact_inputs(contact, features, pattern) for contact in contacts])
            places[:, self._columns] = self._contact.run(z)[:, :, 0]
        return places

    def contact_values(self, z: Complex) -> Iterator[tuple[str, float, float]]:
        """Name, value and sigma of every output of one contact, from `contact_inputs`."""
        rows = self._contact.run(z[None])[0].tolist()
        for name, (y, sigma, _) in zip(self._contact.outputs, rows, strict=True):
            yield name, y, sigma


def uncalibrated(features: Features | None = None) -> Reading:
    """The reading of a tip without a calibration: nothing in mechanical units, but how many contacts.

    features  None: nothing is known of this frame
    """
    contacts = features.contacts if features is not None else None
    return Reading({}, {}, np.full((len(contacts or ()), 3), np.nan))


def sensor_of(rest: Rest, serial: str) -> Sensor:
    """The file's description of a tip, from its rest frame."""
    p = rest.pattern
    return Sensor(
        serial=serial,
        size_px=p.size_px,
        pin_radius_px=p.pin_radius_px,
        pitch_px=p.pitch_px,
        centre_px=(float(p.centre_img[0]), float(p.centre_img[1])),
        tip_radius_px=p.tip_radius_px,
        background=p.background,
        brightness=p.brightness,
        noise=p.noise,
        rest_xy_px=[(round(float(x), 3), round(float(y), 3)) for x, y in rest.xy_img],
    )


def _rest(sensor: Sensor, where: str) -> Rest:
    xy = np.array(sensor.rest_xy_px, dtype=np.float64).reshape(-1, 2)
    if len(xy) < 3 or not np.all(np.isfinite(xy)):
        raise CalibrationError(f"{where}.rest_xy_px: at least three finite points are needed")
    pattern = PinPattern(
        pin_radius_px=sensor.pin_radius_px,
        pitch_px=sensor.pitch_px,
        centre_img=np.array(sensor.centre_px),
        tip_radius_px=sensor.tip_radius_px,
        background=sensor.background,
        brightness=sensor.brightness,
        noise=sensor.noise,
        size_px=sensor.size_px,
    )
    n = len(xy)
    pins = Pins(xy, np.full(n, 0.05), np.full(n, sensor.pin_radius_px), np.full(n, sensor.brightness))
    return Rest(pins, pattern)


def write_atomically(path: Path, content: bytes) -> None:
    """Replace a file as a whole: new content is on the disk before the name points to it."""
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            # A temporary file is its owner's alone; this one is read by whoever runs the edge.
            os.fchmod(file.fileno(), stat.S_IMODE(path.stat().st_mode) if path.exists() else 0o644)
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(temporary).replace(path)
    except BaseException:
        with contextlib.suppress(FileNotFoundError):
            Path(temporary).unlink()
        raise
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
