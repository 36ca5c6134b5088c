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
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

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
from edge.calibration.gaussian_process import ProcessKernel, wanted_models
from edge.calibration.inputs import CONTACT_INPUTS, FRAME_INPUTS, MOMENTS, InputRow
from edge.calibration.polynomial import ModelKernel, OutputRow
from edge.errors import CalibrationError
from edge.limits import BadContent
from edge.types import Array, Complex, ContactRegion, Feature, Features, PinPattern, Reading

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


class _Models:
    """The models that share their inputs, ready to run.

    inputs     to be written before `run`
    outputs    to be read after it: those of curves and polynomials in the file's order, then those of
               processes
    sigmas     each output's, near the data
    processes  their part of the models
    """

    def __init__(self, models: Sequence[Model], inputs: Sequence[str]) -> None:
        self._others = others = [model for model in models if not isinstance(model, Process)]
        self.processes = [model for model in models if isinstance(model, Process)]
        ordered = [*others, *self.processes]
        self.outputs = OutputRow([name for model in ordered for name in outputs_of(model)])
        self.sigmas = tuple(
            sigma for m in ordered for sigma in ([m.sigma] if isinstance(m, Curve) else m.sigma)
        )
        self.inputs = InputRow(inputs)
        # The same memory. A kernel need not look at arrays again that stay the same objects.
        row = self.inputs.values
        self._row, self._rows = row.view(np.float64), row[None].view(np.float64)
        self._kernel = ModelKernel(inputs, others)
        n_others = sum(len(outputs_of(model)) for model in others)
        rows = self.outputs.rows
        self._of_others, self._of_processes = rows[None, :n_others], rows[n_others:]
        self._process_kernel = ProcessKernel(inputs, self.processes) if self.processes else None
        self._wanted = wanted_models(self.processes, None)

    def want(self, outputs: frozenset[str] | None) -> None:
        """Select the models to evaluate from now on: those of these outputs; None: all."""
        self._wanted = wanted_models(self.processes, outputs)
        self._kernel.want(
            np.array(
                [outputs is None or not outputs.isdisjoint(outputs_of(m)) for m in self._others], np.bool_
            )
        )

    def run(self) -> None:
        """Write all outputs."""
        self._kernel.run(self._rows, self._of_others)
        if self._process_kernel is not None:
            self._process_kernel.run(self._row, self._wanted, self._of_processes)


class Calibration:
    """A calibration file, ready to be applied. What a file holds is checked by `load` and `parse`, not here.

    rest       the tip it belongs to, in the file's order of pins
    mm_per_px  scale at the tip's centre; None: not known, places of contact are NaN
    content_id 32 bits of the content's hash; goes over the wire as the calibration's identity
    of_moments whether a model depends on a contact's moments
    of_volume  whether a model depends on the volume
    of_fits    whether there are models of contacts fitted together
    """

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
        self.outputs = frozenset(
            (*self._frame.outputs.names, *self._contact.outputs.names, *self._joint.outputs.names)
        )
        read = frozenset().union(*map(_inputs_of, content.models))
        self.of_moments = not read.isdisjoint(MOMENTS)
        self.of_volume = "volume" in read
        self._of_place = [CONTACT_OUTPUTS.index(name) for name in self._contact.outputs.names]
        self._of_joint = [JOINT_OUTPUTS.index(name) for name in self._joint.outputs.names]
        # A place that no model gives is computed with this.
        self._scale = None if self.outputs >= set(CONTACT_OUTPUTS[:2]) else content.mm_per_px
        self._untouched = {name: UNTOUCHED[name] for name in self._frame.outputs.names}
        self._untouched_sigmas = dict(zip(self._frame.outputs.names, self._frame.sigmas, strict=True))
        self._demand: frozenset[Feature] | None = None
        self._gives_contacts = True  # the demand includes them

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
            values, sigmas, saturated = self._frame.outputs.by_name()
        else:
            values, sigmas = self._untouched.copy(), self._untouched_sigmas.copy()
        found = features.contacts if self._gives_contacts else None
        self._derive(features, found, values, sigmas, interval_s)
        contacts = self._places(features, found, pattern, values.get("displacement_mm"))
        return Reading(values, sigmas, contacts, saturated, calibrated=True)

    def frame_values(self, z: Complex) -> Iterator[tuple[str, float, float, bool]]:
        """Name, value, sigma and whether out of range, of every output, from `frame_inputs`."""
        self._frame.inputs.values[:] = z
        self._frame.run()
        outputs = self._frame.outputs
        for name, (y, sigma, outside) in zip(outputs.names, outputs.rows.tolist(), strict=True):
            yield name, y, sigma, bool(outside)

    def area_mm2(self, features: Features, values: Mapping[str, float]) -> float | None:
        """Area of all contacts: a model's, else that of the contacts in the image; None: not known."""
        return self._area_mm2(features.contacts, values)

    def _area_mm2(self, found: Contacts | None, values: Mapping[str, float]) -> float | None:
        if "contact_area_mm2" in values:
            return values["contact_area_mm2"]
        if found is None or self.mm_per_px is None:
            return None
        return sum(c.area_px2 for c in found) * self.mm_per_px**2

    def _derive(
        self,
        features: Features,
        found: Contacts | None,
        values: dict[str, float],
        sigmas: dict[str, float],
        interval_s: float | None,
    ) -> None:
        """Add the values that follow from others and the scale; see the head of the file."""
        scale = self.mm_per_px
        force, area = values.get("force_n"), self._area_mm2(found, values)
        if area is not None:
            values["contact_area_mm2"] = area
        if found:
            values["orientation_deg"] = math.degrees(found[0].orientation_rad)
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

    def _places(
        self, features: Features, found: Contacts | None, pattern: PinPattern, depth_mm: float | None
    ) -> Array:
        """`Reading.contacts`; the depth of a single one is that of the frame, if it is known."""
        if not found:
            return np.empty((0, 3))
        contacts = np.empty((len(found), 3))
        cell: Any = contacts.data  # in which numbers are set in a fifth of the time
        for i, contact in enumerate(found):
            x, y, z = self._place(contact, features, pattern, joint=len(found) > 1)
            cell[i, 0], cell[i, 1], cell[i, 2] = x, y, z
        if len(found) == 1 and depth_mm is not None:
            cell[0, 2] = depth_mm
        return contacts

    def _place(
        self, contact: ContactRegion, features: Features, pattern: PinPattern, *, joint: bool
    ) -> list[float]:
        """x, y and depth of a contact, NaN where not known; joint: it is one of several."""
        place = [math.nan, math.nan, math.nan]
        if self._scale is not None:
            place[:2] = ((contact.xy_img - pattern.centre_img) * self._scale).tolist()
        if self._of_place:
            self._contact.inputs.write_contact(contact, features, pattern)
            self._contact.run()
            self._contact.outputs.write_into(place, self._of_place)
        if joint and self.of_fits and contact.fitted is not None:
            self._joint.inputs.write_contact(contact, features, pattern)
            self._joint.run()
            self._joint.outputs.write_into(place, self._of_joint)
        return place

    def contact_values(self, z: Complex) -> Iterator[tuple[str, float, float]]:
        """Name, value and sigma of every output of one contact, from `contact_inputs`."""
        self._contact.inputs.values[:] = z
        self._contact.run()
        outputs = self._contact.outputs
        for name, (y, sigma, _) in zip(outputs.names, outputs.rows.tolist(), strict=True):
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
