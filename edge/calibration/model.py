"""The models of a calibration file, ready to run: features of a frame in, mechanical units out.

Rules
- A value outside of the range that the data supported is set to the range's end and named in `saturated`.
- What the file has no model for is NaN: a raw number is never sent in its place.
- An untouched tip reads zero: that is what the tare defines.
- Some values need no model, as they follow from others and the scale: pressure is force over contact area;
  area, if no model gives it, is that of the contacts in the image times the scale squared; slip speed is
  the motion that a load does not explain, times the scale, over the time between two frames; a length that
  a feature's row names (`Feature.scaled`) is that in the image times the scale.
- A single contact's depth is the frame's displacement: all pins contribute to it, and on a ball its error
  is several times smaller than with the contact's own height and size (0.05 against 0.2..0.3 mm rms).
- Of several contacts that were fitted together, place and depth are those of the models of fitted contacts.
- The number of contacts has no unit: it is sent without a calibration too.
- Every value has a standard deviation: the residual of the fit on held-out frames, widened where a frame
  lies far from the data (leverage), as in Bayesian linear regression; that of a process is each frame's own.
- Only the models in demand are evaluated. Processes may need more of a frame than the demand itself
  does (`Calibration.needed`).

A kernel: compiled by Cython (see setup.py), and the same when it is not. A frame is one call of
`Calibration.apply`.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import cython
import numpy as np

from edge.calibration.checks import check, is_of_contact, outputs_of
from edge.calibration.file import (
    CONTACT_OUTPUTS,
    JOINT_OUTPUTS,
    UNTOUCHED,
    CalibrationFile,
    Curve,
    Model,
    Process,
    decode,
    encode,
    read_file,
    rest_of,
    save,
)
from edge.calibration.inputs import CONTACT_INPUTS, FRAME_INPUTS, MODES, MOMENTS
from edge.errors import CalibrationError
from edge.limits import BadContent
from edge.types import Array, Complex, ContactRegion, Feature, Features, PinPattern, Reading

if cython.compiled:
    from cython.cimports.edge.calibration.gaussian_process import ProcessKernel
    from cython.cimports.edge.calibration.polynomial import ModelKernel
    from cython.cimports.libc.math import M_PI, NAN, isfinite, sqrt
else:
    from math import isfinite, sqrt
    from math import nan as NAN  # noqa: N812
    from math import pi as M_PI  # noqa: N812

    from edge.calibration.gaussian_process import ProcessKernel
    from edge.calibration.polynomial import ModelKernel

__all__ = ["OF_FRICTION", "Calibration", "InputRow", "contact_inputs", "frame_inputs", "uncalibrated"]

#: Each output has a value, a sigma, and whether the model is out of its range (0 or 1).
FIELDS = 3
#: Forces along the surface. The torque that a contact can carry depends on its area.
OF_FRICTION = frozenset({"force_x_n", "force_y_n", "torque_z_nmm"})
#: Lengths of `Features`, and the values that the scale makes of them.
SCALED = [(f"{name}_px", f"{name}_mm") for feature in Feature for name in feature.scaled]
#: The features that a process takes its inputs from: modes and volume, the strongest contact.
OF_PROCESS = frozenset({Feature.DISPLACEMENT, Feature.CONTACTS})
#: Features that include contacts: only for these are they passed on.
OF_CONTACTS = frozenset({Feature.CONTACTS, Feature.PRESSURE, Feature.CONTACT_AREA, Feature.ORIENTATION})

Contacts = tuple[ContactRegion, ...]
_NONE: frozenset[str] = frozenset()


@cython.final
@cython.cclass
class InputRow:
    """The inputs of one frame, or of one contact, written into the same memory again and again.

    values  complex128, dimensionless; NaN where a feature was not computed: (28,) of a frame as in
            `FRAME_INPUTS`, (12,) of a contact as in `CONTACT_INPUTS`
    """

    values = cython.declare(object, visibility="readonly")
    numbers = cython.declare(cython.double[::1], visibility="readonly")  # the same memory, real and imaginary
    x0 = cython.declare(cython.double, visibility="readonly")  # the tip's centre, px
    y0 = cython.declare(cython.double, visibility="readonly")
    _n: cython.Py_ssize_t
    _pattern: PinPattern | None  # given last
    _radius: cython.double  # the tip's, px

    def __init__(self, inputs: Sequence[str]) -> None:
        self._n, self._pattern = len(inputs), None
        self.x0 = self.y0 = self._radius = 0.0
        self.values = np.zeros(len(inputs), np.complex128)
        self.numbers = self.values.view(np.float64)

    @cython.ccall
    @cython.exceptval(check=True)
    def write_frame(self, features: Features, pattern: PinPattern) -> cython.void:
        """Those of one frame. Raises ValueError: sizes that do not fit, a tip without a radius."""
        n: cython.Py_ssize_t = len(MODES)
        first: cython.Py_ssize_t = 2 + n
        i: cython.Py_ssize_t
        self._must_have(first + 5, pattern)
        r: cython.double = self._radius
        volume, modes, contacts = features.volume_px2, features.modes_px, features.contacts
        if volume is None:
            self._set(0, NAN, 0.0)
        else:
            self._set(0, volume / (M_PI * r * r), 0.0)
        self._set_vector(1, features.shear_px, r)
        if modes is None:
            for i in range(n):
                self._set(2 + i, NAN, 0.0)
        else:
            modes_px: cython.const[cython.doublecomplex][::1] = modes
            if modes_px.shape[0] != n:
                raise ValueError(f"modes ({n},) are wanted, not {modes.shape}")
            mode: cython.doublecomplex
            for i in range(n):
                mode = modes_px[i]
                self._set(2 + i, mode.real / r, mode.imag / r)
        if contacts:
            self._set_place_peak_size(contacts[0], first, first + 1, first + 2)
        else:
            nothing: cython.double = NAN if contacts is None else 0.0
            for i in range(first, first + 3):
                self._set(i, nothing, 0.0)
        self._set(first + 3, features.gap, 0.0)
        if features.gap_img is None:
            self._set(first + 4, 0.0, 0.0)
        else:
            self._set_place(first + 4, features.gap_img)

    @cython.ccall
    @cython.exceptval(check=True)
    def write_contact(self, contact: ContactRegion, features: Features, pattern: PinPattern) -> cython.void:
        """Those of one contact of a frame. Raises ValueError: as of `write_frame`."""
        i: cython.Py_ssize_t
        self._must_have(12, pattern)
        r: cython.double = self._radius
        self._set_place_peak_size(contact, 0, 1, 3)
        self._set_vector(2, features.shear_px, r)
        self._set_place(4, contact.middle_img)
        self._set_vector(5, contact.divergence_moment_px, r)
        self._set_vector(6, contact.curl_moment_px, r)
        fitted = contact.fitted
        if fitted is None:
            for i in range(7, 12):
                self._set(i, NAN, 0.0)
        else:
            self._set_place(7, fitted.place_img)
            self._set(8, fitted.potential, 0.0)
            self._set(9, fitted.width, 0.0)
            self._set_vector(10, fitted.shear, 1.0)
            self._set_vector(11, fitted.dipole, 1.0)

    @cython.cfunc
    def _must_have(self, n: cython.Py_ssize_t, pattern: PinPattern) -> cython.bint:
        """Raises ValueError: this row has another size; the tip has no radius."""
        if self._n != n:
            raise ValueError(f"{n} inputs are wanted, not {self._n}")
        if pattern is not self._pattern:
            r: cython.double = pattern.tip_radius_px
            if not (r > 0 and r * r > 0):  # areas are shares of its square
                raise ValueError(f"tip_radius_px: above 0 is wanted, not {r}")
            self.x0, self.y0 = pattern.centre_img.tolist()
            self._radius, self._pattern = r, pattern
        return True

    @cython.cfunc
    @cython.exceptval(check=False)
    def _set(self, i: cython.Py_ssize_t, re: cython.double, im: cython.double) -> cython.void:
        self.numbers[2 * i] = re
        self.numbers[2 * i + 1] = im

    @cython.cfunc
    def _set_vector(self, i: cython.Py_ssize_t, xy: Array | None, scale: cython.double) -> cython.bint:
        """(2,) divided by a scale; None: not computed."""
        if xy is None:
            self._set(i, NAN, 0.0)
        else:
            pair: list[float] = xy.tolist()  # to read an array's element costs as much as both so
            x: cython.double = pair[0]
            y: cython.double = pair[1]
            self._set(i, x / scale, y / scale)
        return True

    @cython.cfunc
    def _set_place(self, i: cython.Py_ssize_t, xy_img: Array) -> cython.bint:
        """A place on the tip's unit disc."""
        place: list[float] = xy_img.tolist()
        x: cython.double = place[0]
        y: cython.double = place[1]
        self._set(i, (x - self.x0) / self._radius, (y - self.y0) / self._radius)
        return True

    @cython.cfunc
    def _set_place_peak_size(
        self,
        contact: ContactRegion,
        place: cython.Py_ssize_t,
        peak: cython.Py_ssize_t,
        size: cython.Py_ssize_t,
    ) -> cython.bint:
        self._set_place(place, contact.xy_img)
        self._set(peak, contact.peak, 0.0)
        area_px2: cython.double = contact.area_px2
        self._set(size, sqrt(area_px2) / self._radius, 0.0)
        return True


def frame_inputs(features: Features, pattern: PinPattern) -> Complex:
    """The inputs `FRAME_INPUTS` of one frame, as of `InputRow`; a new array."""
    row = InputRow(FRAME_INPUTS)
    row.write_frame(features, pattern)
    values: Complex = row.values
    return values


def contact_inputs(contact: ContactRegion, features: Features, pattern: PinPattern) -> Complex:
    """The inputs `CONTACT_INPUTS` of one contact of a frame, as of `InputRow`; a new array."""
    row = InputRow(CONTACT_INPUTS)
    row.write_contact(contact, features, pattern)
    values: Complex = row.values
    return values


@cython.final
@cython.cclass
class _Models:
    """The models that share their inputs, ready to run.

    inputs     to be written before `run`
    names      of the outputs: those of curves and polynomials in the file's order, then those of processes
    outputs    (n, FIELDS) float64, of `run`
    sigmas     each output's, near the data
    processes  their part of the models
    """

    inputs = cython.declare(InputRow, visibility="readonly")
    names = cython.declare(tuple, visibility="readonly")
    outputs = cython.declare(cython.double[:, ::1], visibility="readonly")
    sigmas = cython.declare(tuple, visibility="readonly")
    processes = cython.declare(list, visibility="readonly")
    _others: list[Model]
    _kernel: ModelKernel
    _process_kernel: ProcessKernel | None

    def __init__(self, models: Sequence[Model], inputs: Sequence[str]) -> None:
        self._others = [model for model in models if not isinstance(model, Process)]
        self.processes = [model for model in models if isinstance(model, Process)]
        ordered = [*self._others, *self.processes]
        self.names = tuple(name for model in ordered for name in outputs_of(model))
        self.sigmas = tuple(
            sigma for m in ordered for sigma in ([m.sigma] if isinstance(m, Curve) else m.sigma)
        )
        self.inputs, self.outputs = InputRow(inputs), np.zeros((len(self.names), FIELDS))
        self._kernel = ModelKernel(inputs, self._others)
        self._process_kernel = ProcessKernel(inputs, self.processes) if self.processes else None

    def want(self, outputs: frozenset[str] | None) -> None:
        """Select the models to evaluate from now on: those of these outputs; None: all."""
        for kernel, models in ((self._kernel, self._others), (self._process_kernel, self.processes)):
            if kernel is not None:
                flags = [outputs is None or not outputs.isdisjoint(outputs_of(model)) for model in models]
                kernel.want(np.array(flags, np.bool_))

    @cython.ccall
    @cython.exceptval(check=True)
    def run(self) -> cython.void:
        """Write all outputs."""
        n: cython.Py_ssize_t = self._kernel.n_outputs
        self._kernel.run(self.inputs.numbers, self.outputs[:n])
        if self._process_kernel is not None:
            self._process_kernel.run(self.inputs.numbers, self.outputs[n:])

    @cython.ccall
    def by_name(self) -> tuple[dict[str, float], dict[str, float], frozenset[str]]:
        """Values and sigmas, and the names of the known values that are out of range; all new."""
        values: dict[str, float] = {}
        sigmas: dict[str, float] = {}
        outside = _NONE
        i: cython.Py_ssize_t
        for i in range(self.outputs.shape[0]):
            name = self.names[i]
            values[name] = self.outputs[i, 0]
            sigmas[name] = self.outputs[i, 1]
            if self.outputs[i, 2] != 0.0 and isfinite(self.outputs[i, 0]):
                outside |= {name}
        return values, sigmas, outside

    @cython.ccall
    @cython.exceptval(check=True)
    def write_into(self, numbers: list[float], places: list[int]) -> cython.void:
        """Set the value of each output to its place in `numbers`."""
        i: cython.Py_ssize_t
        for i in range(self.outputs.shape[0]):
            numbers[places[i]] = self.outputs[i, 0]


@cython.binding(True)  # With the limited API a class method needs that.
@cython.final
@cython.cclass
class Calibration:
    """A calibration file, ready to be applied. What a file holds is checked by `load` and `parse`, not here.

    rest       the tip it belongs to, in the file's order of pins
    mm_per_px  scale at the tip's centre; None: not known, places of contact are NaN
    content_id 32 bits of the content's hash; goes over the wire as the calibration's identity
    of_moments whether a model depends on a contact's moments
    of_volume  whether a model depends on the volume
    of_fits    whether there are models of contacts fitted together
    """

    content = cython.declare(object, visibility="readonly")
    encoded = cython.declare(bytes, visibility="readonly")
    content_id = cython.declare(object, visibility="readonly")
    mm_per_px = cython.declare(object, visibility="readonly")
    rest = cython.declare(object, visibility="readonly")
    outputs = cython.declare(frozenset, visibility="readonly")
    of_moments = cython.declare(cython.bint, visibility="readonly")
    of_volume = cython.declare(cython.bint, visibility="readonly")
    of_fits = cython.declare(cython.bint, visibility="readonly")
    _frame: _Models
    _contact: _Models
    _joint: _Models
    _of_place: list[int]
    _of_joint: list[int]
    _scale: float | None
    _untouched: dict[str, float]
    _untouched_sigmas: dict[str, float]
    _demand: frozenset[Feature] | None
    _gives_contacts: cython.bint  # the demand includes them

    def __init__(self, content: CalibrationFile) -> None:
        self.content = content
        self.encoded = encode(content)
        self.content_id = int.from_bytes(hashlib.sha256(self.encoded[:-1]).digest()[:4], "little")
        self.mm_per_px = content.mm_per_px
        self.rest = rest_of(content.sensor)
        self._frame = _Models([m for m in content.models if not is_of_contact(m)], FRAME_INPUTS)
        of_contact = [m for m in content.models if is_of_contact(m)]
        joint = [m for m in of_contact if not set(JOINT_OUTPUTS).isdisjoint(outputs_of(m))]
        self._contact = _Models([m for m in of_contact if m not in joint], CONTACT_INPUTS)
        self._joint = _Models(joint, CONTACT_INPUTS)
        self.of_fits = bool(joint)
        self.outputs = frozenset((*self._frame.names, *self._contact.names, *self._joint.names))
        read = frozenset().union(*map(_inputs_of, content.models))
        self.of_moments = not read.isdisjoint(MOMENTS)
        self.of_volume = "volume" in read
        self._of_place = [CONTACT_OUTPUTS.index(name) for name in self._contact.names]
        self._of_joint = [JOINT_OUTPUTS.index(name) for name in self._joint.names]
        # A place that no model gives is computed with this.
        self._scale = None if self.outputs >= set(CONTACT_OUTPUTS[:2]) else content.mm_per_px
        self._untouched = {name: UNTOUCHED[name] for name in self._frame.names}
        self._untouched_sigmas = dict(zip(self._frame.names, self._frame.sigmas, strict=True))
        self._demand, self._gives_contacts = None, True

    def __reduce__(self) -> tuple[type[Calibration], tuple[CalibrationFile]]:
        return Calibration, (self.content,)

    @classmethod
    def load(cls, path: str | Path) -> Calibration:
        """Read and check a file. Raises CalibrationError: one line with file and place in it."""
        return cls.of(read_file(Path(path)), str(path))

    @classmethod
    def parse(cls, raw: bytes, where: str) -> Calibration:
        """Check a file's bytes (read from disk, or uploaded over the bus). Raises CalibrationError."""
        return cls.of(decode(raw, where), where)

    @classmethod
    def of(cls, content: CalibrationFile, where: str) -> Calibration:
        """A decoded file, checked and ready. Raises CalibrationError."""
        try:
            check(content)
        except BadContent as error:
            raise CalibrationError(f"{where}: {error}") from None
        return cls(content)

    def save(self, path: str | Path, through_link: bool = True) -> None:
        """Write the file so that a reader, or a loss of power, finds either the old file or the new one,
        complete.

        through_link  as of `hostlink.output_file.writing`
        Raises  hostlink.output_file.OutputError: cannot be written
        """
        save(Path(path), self.encoded, through_link)

    def needed(self, demand: frozenset[Feature]) -> frozenset[Feature]:
        """The demand, and the other features that its models take their inputs from."""
        outputs = _outputs_in(demand)
        needed = demand
        if any(not outputs.isdisjoint(model.outputs) for model in self._frame.processes):
            needed |= OF_PROCESS
        if Feature.FORCE in demand and not OF_FRICTION.isdisjoint(self.outputs):
            needed |= {Feature.CONTACT_AREA}
        return needed

    def apply(
        self,
        features: Features,
        pattern: PinPattern,
        interval_s: float | None = None,
        demand: frozenset[Feature] | None = None,
    ) -> Reading:
        """Values of one frame in mechanical units.

        pattern     of the running tip; gives the place and size of the tip's circle
        interval_s  time since the frame before this one; None: not known, no speed can be given
        demand      what is wanted; None: everything
        """
        if demand is not self._demand:
            self._demand = demand
            self._frame.want(None if demand is None else _outputs_in(demand))
            self._gives_contacts = demand is None or not demand.isdisjoint(OF_CONTACTS)
        saturated = _NONE
        if features.in_contact:
            self._frame.inputs.write_frame(features, pattern)
            self._frame.run()
            values, sigmas, saturated = self._frame.by_name()
        else:
            values, sigmas = self._untouched.copy(), self._untouched_sigmas.copy()
        found = features.contacts if self._gives_contacts else None
        self._derive(features, found, values, sigmas, interval_s)
        contacts = self._places(features, found, pattern, values.get("displacement_mm"))
        return Reading(values, sigmas, contacts, saturated, True)

    def frame_values(self, z: Complex) -> Iterator[tuple[str, float, float, bool]]:
        """Name, value, sigma and whether out of range, of every output, from `frame_inputs`."""
        self._frame.inputs.values[:] = z
        self._frame.run()
        rows = np.asarray(self._frame.outputs).tolist()
        for name, (y, sigma, outside) in zip(self._frame.names, rows, strict=True):
            yield name, y, sigma, bool(outside)

    def area_mm2(self, features: Features, values: Mapping[str, float]) -> float | None:
        """Area of all contacts: a model's, else that of the contacts in the image; None: not known."""
        return self._area_mm2(features.contacts, values)

    @cython.cfunc
    def _area_mm2(self, found: Contacts | None, values: Mapping[str, float]) -> float | None:
        if "contact_area_mm2" in values:
            return values["contact_area_mm2"]
        if found is None or self.mm_per_px is None:
            return None
        return sum(c.area_px2 for c in found) * self.mm_per_px**2

    @cython.cfunc
    def _derive(
        self,
        features: Features,
        found: Contacts | None,
        values: dict[str, float],
        sigmas: dict[str, float],
        interval_s: float | None,
    ) -> object:
        """Add the values that follow from others and the scale; see the head of the file."""
        scale = self.mm_per_px
        force: float | None = values.get("force_n")
        area: float | None = self._area_mm2(found, values)
        if area is not None:
            values["contact_area_mm2"] = area
        if found:
            values["orientation_deg"] = found[0].orientation_rad * (180.0 / M_PI)
        if force is not None and area is not None:
            if not features.in_contact:
                values["pressure_kpa"] = 0.0
            elif area > 0.0:
                pressure = 1e3 * force / area
                values["pressure_kpa"] = pressure
                if "contact_area_mm2" in sigmas:
                    parts = (1e3 * sigmas["force_n"] / area, pressure * sigmas["contact_area_mm2"] / area)
                    sigmas["pressure_kpa"] = math.hypot(*parts)
        if features.slip_px is not None and features.slip_probability is not None:
            values["slip_probability"] = features.slip_probability
            if not features.in_contact:
                values["slip_speed_mm_s"] = 0.0
            elif scale is not None and interval_s is not None and interval_s > 0.0:
                values["slip_speed_mm_s"] = features.slip_px * scale / interval_s
        for length, name in SCALED:
            length_px = getattr(features, length)
            if length_px is not None and scale is not None:
                values[name] = length_px * scale
        return None

    @cython.cfunc
    def _places(
        self, features: Features, found: Contacts | None, pattern: PinPattern, depth_mm: float | None
    ) -> Array:
        """`Reading.contacts`; the depth of a single one is that of the frame, if it is known."""
        if not found:
            return np.empty((0, 3))
        places = [self._place(contact, features, pattern, len(found) > 1) for contact in found]
        if len(found) == 1 and depth_mm is not None:
            places[0][2] = depth_mm
        return np.array(places, np.float64)

    @cython.cfunc
    def _place(
        self, contact: ContactRegion, features: Features, pattern: PinPattern, joint: bool
    ) -> list[float]:
        """x, y and depth of a contact, NaN where not known; joint: it is one of several."""
        place = [NAN, NAN, NAN]
        if self._scale is not None:
            (x, y), (x0, y0) = contact.xy_img.tolist(), pattern.centre_img.tolist()
            place[:2] = (x - x0) * self._scale, (y - y0) * self._scale
        if self._of_place:
            self._contact.inputs.write_contact(contact, features, pattern)
            self._contact.run()
            self._contact.write_into(place, self._of_place)
        if joint and self.of_fits and contact.fitted is not None:
            self._joint.inputs.write_contact(contact, features, pattern)
            self._joint.run()
            self._joint.write_into(place, self._of_joint)
        return place

    def contact_values(self, z: Complex) -> Iterator[tuple[str, float, float]]:
        """Name, value and sigma of every output of one contact, from `contact_inputs`."""
        self._contact.inputs.values[:] = z
        self._contact.run()
        rows = np.asarray(self._contact.outputs).tolist()
        for name, (y, sigma, _) in zip(self._contact.names, rows, strict=True):
            yield name, y, sigma


def _inputs_of(model: Model) -> frozenset[str]:
    """Names of a model's inputs; of a process, those that its demand does not include by itself."""
    if isinstance(model, Curve):
        return frozenset({model.input})
    if isinstance(model, Process):
        return frozenset({"volume"})
    return frozenset(name.rstrip("*") for term in model.terms for name in term)


def _outputs_in(demand: frozenset[Feature]) -> frozenset[str]:
    return frozenset().union(*(feature.outputs for feature in demand))


def uncalibrated(features: Features | None = None) -> Reading:
    """The reading of a tip without a calibration: nothing in mechanical units but the number of contacts.

    features  None: nothing is known of this frame
    """
    contacts = features.contacts if features is not None else None
    return Reading({}, {}, np.full((len(contacts or ()), 3), np.nan))
