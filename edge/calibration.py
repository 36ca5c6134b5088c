"""From geometry to mechanical units: the calibration file, and its application to one frame.

The file is JSON, versioned, validated on load against the structures below, and replaced atomically. A
calibration belongs to one tip: it holds the rest pins it was made with, and the tare must find them again.
It holds models as data, never code:

    Curve        y = piecewise linear in one input              the paper's displacement curve
    Regression   y_o = sum_k weight_ok * prod_j input[term_kj]  several outputs from the same terms

Rules
- Inputs are named and dimensionless (`input_names`): lengths are divided by the tip's radius, areas by
  its square, so that a weight does not depend on the camera's resolution.
- A value outside of the range that the data supported is set to the range's end and named in `saturated`.
- What the file has no model for is NaN: no raw number goes out in disguise.
- An untouched tip reads zero: that is what the tare defines.
- Every value has a standard deviation: the residual of the fit on held-out frames, widened where a frame
  lies far from the data (leverage), as in Bayesian linear regression.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

from edge.errors import CalibrationError
from edge.types import Array, ContactRegion, Features, PinPattern, Pins, Reading, Rest

FORMAT = "voronoi-touch-calibration"
VERSION = 1
MAX_BYTES = 8 << 20  # a 1000-pin tip with every model takes about 0.5 MB
N_MODES = 10  # terms of a cubic polynomial in two variables

Positive = Annotated[float, msgspec.Meta(gt=0)]
Point = tuple[float, float]

#: Value names a model may have as output, and what an untouched tip reads.
UNTOUCHED: dict[str, float] = {
    "displacement_mm": 0.0,
    "force_n": 0.0,
    "pressure_kpa": 0.0,
    "contact_area_mm2": 0.0,
    "shear_x_mm": 0.0,
    "shear_y_mm": 0.0,
    "torsion_deg": 0.0,
    "tilt_x_deg": math.nan,  # nothing under the tip has no tilt
    "tilt_y_deg": math.nan,
    "orientation_deg": math.nan,
}
#: Outputs of models that are evaluated once a contact, from the contact's own inputs.
CONTACT_OUTPUTS = ("contact_x_mm", "contact_y_mm", "contact_depth_mm")

_MODE = [f"{i}" for i in range(N_MODES)]
#: Inputs made of a frame's features; the order is that of `frame_inputs`.
FRAME_INPUTS: tuple[str, ...] = (
    "volume",
    "shear_x",
    "shear_y",
    *(f"mx{k}" for k in _MODE),
    *(f"my{k}" for k in _MODE),
    *(f"a{k}" for k in _MODE),
)
#: Inputs made of one contact: place on the tip's unit disc, height of the maximum.
CONTACT_INPUTS: tuple[str, ...] = ("u", "v", "peak")


class Curve(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="curve"):
    """A monotone curve through knots (input, output); flat beyond its ends."""

    output: str
    input: str
    knots: list[Point]
    sigma: Positive


class Regression(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="regression"):
    """A polynomial regression of several outputs on the same terms.

    terms     each a list of input names, multiplied; [] is the constant
    weights   one row an output, one column a term
    valid     [low, high] of each output in the data it was fitted to
    sigma     residual of each output on held-out frames
    leverage  (r, n_terms) factor L with variance = sigma^2 (1 + |L psi|^2); empty: none known
    """

    outputs: list[str]
    terms: list[list[str]]
    weights: list[list[float]]
    valid: list[Point]
    sigma: list[Positive]
    leverage: list[list[float]] = []


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
    mm_per_px: Positive
    models: list[Curve | Regression]
    data: Data


def frame_inputs(features: Features, tip_radius_px: float) -> Array:
    """The inputs `FRAME_INPUTS` of one frame, NaN where a feature was not computed.

    Returns  (33,) float64, dimensionless
    """
    z = np.full(len(FRAME_INPUTS), np.nan)
    r = tip_radius_px
    if features.volume_px2 is not None:
        z[0] = features.volume_px2 / (math.pi * r * r)
    if features.shear_px is not None:
        z[1:3] = features.shear_px / r
    if features.modes_px is not None:
        z[3 : 3 + 2 * N_MODES] = features.modes_px.ravel() / r
    if features.area_modes is not None:
        z[3 + 2 * N_MODES :] = features.area_modes
    return z


def contact_inputs(contact: ContactRegion, centre_img: Array, tip_radius_px: float) -> Array:
    """The inputs `CONTACT_INPUTS` of one contact.

    Returns  (3,) float64, dimensionless
    """
    u, v = (contact.xy_img - centre_img) / tip_radius_px
    return np.array([u, v, contact.peak])


class _Compiled:
    """A model ready to run: names resolved to columns, lists to arrays."""

    def __init__(self, model: Curve | Regression, inputs: Sequence[str], where: str) -> None:
        self.outputs: tuple[str, ...]
        if isinstance(model, Curve):
            self.outputs = (model.output,)
            self._column = _columns([[model.input]], inputs, where)[0, 0]
            knots = np.array(model.knots, dtype=np.float64).reshape(-1, 2)
            if len(knots) < 2 or not np.all(np.isfinite(knots)):
                raise CalibrationError(f"{where}.knots: at least two finite points are needed")
            if np.any(np.diff(knots[:, 0]) <= 0):
                raise CalibrationError(f"{where}.knots: inputs must increase from knot to knot")
            slopes = np.diff(knots[:, 1])
            if np.any(slopes < 0) and np.any(slopes > 0):
                raise CalibrationError(f"{where}.knots: outputs must rise or fall all the way (monotone)")
            self._x, self._y = knots[:, 0].copy(), knots[:, 1].copy()
            self.sigma = np.array([model.sigma])
            self._psi = None
            return
        self.outputs = tuple(model.outputs)
        n_out, n_terms = len(model.outputs), len(model.terms)
        self._psi = _columns(model.terms, inputs, where)
        self._weights = _matrix(model.weights, (n_out, n_terms), f"{where}.weights")
        valid = _matrix([list(v) for v in model.valid], (n_out, 2), f"{where}.valid")
        if np.any(valid[:, 0] > valid[:, 1]):
            raise CalibrationError(f"{where}.valid: each range must be [low, high]")
        self._low, self._high = valid[:, 0], valid[:, 1]
        self.sigma = _matrix([model.sigma], (1, n_out), f"{where}.sigma")[0]
        self._leverage = (
            _matrix(model.leverage, (len(model.leverage), n_terms), f"{where}.leverage")
            if model.leverage
            else None
        )

    def run(self, z: Array) -> tuple[Array, Array, Array]:
        """Values, sigmas and whether each lies outside of the calibrated range."""
        if self._psi is None:
            x = z[self._column]
            outside = np.array([not self._x[0] <= x <= self._x[-1]])
            return np.interp([x], self._x, self._y), self.sigma, outside
        psi = np.append(z, 1.0)[self._psi].prod(axis=1)
        y = self._weights @ psi
        sigma = self.sigma
        if self._leverage is not None:
            spread = self._leverage @ psi
            sigma = sigma * math.sqrt(1.0 + float(spread @ spread))
        outside = (y < self._low) | (y > self._high)
        return np.clip(y, self._low, self._high), sigma, outside


def _columns(terms: list[list[str]], inputs: Sequence[str], where: str) -> NDArray[np.intp]:
    """Terms as columns of the input vector; the column behind the last is the constant 1."""
    order = {name: i for i, name in enumerate(inputs)}
    width = max([1, *map(len, terms)])
    table = np.full((len(terms), width), len(inputs), dtype=np.intp)
    for row, term in enumerate(terms):
        for col, name in enumerate(term):
            if name not in order:
                raise CalibrationError(f"{where}: unknown input '{name}'; known: {', '.join(inputs)}")
            table[row, col] = order[name]
    return table


def _matrix(rows: list[list[float]], shape: tuple[int, int], where: str) -> Array:
    if len(rows) != shape[0] or any(len(row) != shape[1] for row in rows):
        raise CalibrationError(f"{where}: {shape[0]} rows of {shape[1]} numbers are needed")
    matrix = np.array(rows, dtype=np.float64).reshape(shape)
    if not np.all(np.isfinite(matrix)):
        raise CalibrationError(f"{where}: every number must be finite")
    return matrix


class Calibration:
    """A validated calibration file, ready to be applied.

    rest       the tip it belongs to, in the file's order of pins
    mm_per_px  scale at the tip's centre
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
        self.encoded = msgspec.json.format(msgspec.json.encode(content), indent=1)
        self.content_id = int.from_bytes(hashlib.sha256(msgspec.json.encode(content)).digest()[:4], "little")
        self.mm_per_px = content.mm_per_px
        self.rest = _rest(content.sensor, f"{where}: sensor")
        self._frame: list[_Compiled] = []
        self._contact: list[_Compiled] = []
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
            inputs = CONTACT_INPUTS if per_contact else FRAME_INPUTS
            (self._contact if per_contact else self._frame).append(_Compiled(model, inputs, at))
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

    def apply(self, features: Features, pattern: PinPattern) -> Reading:
        """Values of one frame in mechanical units.

        pattern  of the running tip; gives the place and size of the tip's circle
        """
        values: dict[str, float] = {}
        sigmas: dict[str, float] = {}
        saturated: set[str] = set()
        z = frame_inputs(features, pattern.tip_radius_px) if features.touched else None
        for model in self._frame:
            if z is None:
                for name, spread in zip(model.outputs, model.sigma, strict=True):
                    values[name], sigmas[name] = UNTOUCHED[name], float(spread)
                continue
            y, sigma, outside = model.run(z)
            for name, value, spread, over in zip(model.outputs, y, sigma, outside, strict=True):
                values[name], sigmas[name] = float(value), float(spread)
                if over and math.isfinite(value):
                    saturated.add(name)
        contacts = self._places(features.contacts or (), pattern)
        return Reading(values, sigmas, contacts, frozenset(saturated), calibrated=True)

    def _places(self, contacts: Sequence[ContactRegion], pattern: PinPattern) -> Array:
        places = np.full((len(contacts), 3), np.nan)
        for row, contact in zip(places, contacts, strict=True):
            row[:2] = (contact.xy_img - pattern.centre_img) * self.mm_per_px
            z = contact_inputs(contact, pattern.centre_img, pattern.tip_radius_px)
            for model in self._contact:
                y, _, _ = model.run(z)
                for name, value in zip(model.outputs, y, strict=True):
                    row[CONTACT_OUTPUTS.index(name)] = value
        return places


def uncalibrated() -> Reading:
    """The reading of a tip without a calibration: nothing in mechanical units."""
    return Reading({}, {}, np.empty((0, 3)))


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
