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
  is several times smaller than with the contact's own height and size (0.05 against 0.2..0.3 mm rms). Dots on
  the surface say more of the contact's own depth: a fit of their motion weighs them all.
- Of several contacts that were fitted together, place and depth are those of the models of fitted contacts.
- The number of contacts has no unit: it is sent without a calibration too.
- Every value has a standard deviation: the residual of the fit on held-out frames, widened where a frame
  lies far from the data (leverage), as in Bayesian linear regression; that of a process is each frame's own.
- A touched frame in which no contact is found has models of its own, without the place: a light touch's.
- Only the models in demand are evaluated. Processes may need more of a frame than the demand itself
  does (`Calibration.needed`).
"""

from __future__ import annotations

import hashlib
import math
from pathlib import Path

import numpy as np
from msgspec.structs import replace

from edge.calibration.checks import check, is_of_contact, is_of_place, outputs_of
from edge.calibration.evaluation import ModelKernel, Places, derive
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
)
from edge.calibration.inputs import CONTACT_INPUTS, FRAME_INPUTS, MOMENTS
from edge.errors import CalibrationError
from edge.geometry.parts import of_parts
from edge.limits import BadContent
from edge.types import NOWHERE, Feature, Features, PinPattern, Reading
from hostlink.output_file import writing

#: Forces along the surface. The torque that a contact can carry depends on its area.
OF_FRICTION = frozenset({"force_x_n", "force_y_n", "torque_z_nmm"})
#: The features that a process takes its inputs from: modes and volume, the strongest contact.
OF_PROCESS = frozenset({Feature.DISPLACEMENT, Feature.CONTACTS})
#: Features that include contacts: only for these are they passed on.
OF_CONTACTS = frozenset({Feature.CONTACTS, Feature.PRESSURE, Feature.CONTACT_AREA, Feature.ORIENTATION})
#: Features of which a touched frame derives values.
OF_DERIVED = OF_CONTACTS | {Feature.FORCE, Feature.SLIP} | {row for row in Feature if row.scaled}


class Calibration:
    """A calibration file, ready to be applied. What a file holds is checked by `load` and `parse`, not here.

    rest       the tip it belongs to, in the file's order of pins; its parts are the views
    mm_per_px  scale at the tip's centre; None: not known, places of contact are NaN
    content_id 32 bits of the content's hash; goes over the wire as the calibration's identity
    frame_models, contact_models  of a frame, and of one contact
    light_models  of a touched frame without a contact
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
        of_frame = [m for m in content.models if not is_of_contact(m)]
        self.frame_models = self.light_models = ModelKernel(FRAME_INPUTS, of_frame)
        if content.without_contact is not None:
            others = [*content.without_contact, *(m for m in of_frame if not is_of_place(m))]
            known = {tuple(outputs_of(m)): m for m in reversed(others)}
            self.light_models = ModelKernel(FRAME_INPUTS, list(known.values()))
        of_contact = [m for m in content.models if is_of_contact(m)]
        joint = [m for m in of_contact if not set(JOINT_OUTPUTS).isdisjoint(outputs_of(m))]
        self.contact_models = ModelKernel(CONTACT_INPUTS, [m for m in of_contact if m not in joint])
        self._joint = ModelKernel(CONTACT_INPUTS, joint)
        self._processes = [model for model in of_frame if isinstance(model, Process)]
        self.of_fits = bool(joint)
        self.outputs = frozenset((*self.frame_models.names, *self.contact_models.names, *self._joint.names))
        models = *content.models, *(content.without_contact or ())
        read = frozenset().union(*map(_inputs_of, models))
        self.of_moments = not read.isdisjoint(MOMENTS)
        self.of_volume = "volume" in read
        scale = None if self.outputs >= set(CONTACT_OUTPUTS[:2]) else content.mm_per_px
        models = self.contact_models, self._joint
        self._places = Places(models, math.nan if scale is None else scale, self.rest.pattern.on_surface)
        self._unknown = dict.fromkeys(self.frame_models.names, math.nan)
        self._untouched = {name: UNTOUCHED[name] for name in self.frame_models.names}
        self._untouched_sigmas = dict(zip(self.frame_models.names, self.frame_models.sigmas, strict=True))
        self._views: tuple[Calibration, ...] = ()
        if content.views:
            self._views = tuple(map(Calibration, (replace(content, views=[]), *content.views)))
            self.rest = of_parts([view.rest for view in self._views], self.rest.pattern)
            self.outputs = frozenset().union(*(view.outputs for view in self._views))
            self.of_fits = any(view.of_fits for view in self._views)
            self.of_moments = any(view.of_moments for view in self._views)
            self.of_volume = any(view.of_volume for view in self._views)
            self._processes = [process for view in self._views for process in view._processes]
        self._demand: frozenset[Feature] | None = None
        self._gives_contacts = self._derives = True  # the demand includes them, and what is derived
        self._at_rest: tuple[object, Reading] | None = None  # what is known of an untouched frame gives that

    def __reduce__(self) -> tuple[type[Calibration], tuple[CalibrationFile]]:
        return Calibration, (self.content,)

    @property
    def views(self) -> tuple[Calibration, ...]:
        """That of each view of the skin, in the order of `rest.views`; it alone, where there is one."""
        return self._views or (self,)

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
        """Write the file so that a reader, or a loss of power, finds the old one or the new one, complete.

        through_link, Raises  as of `hostlink.output_file.writing`
        """
        with writing(path, overwrite=True, through_link=through_link) as unfinished:
            unfinished.write_bytes(self.encoded)

    def needed(self, demand: frozenset[Feature]) -> frozenset[Feature]:
        """The demand, and the other features that its models take their inputs from."""
        outputs = _outputs_in(demand)
        needed = demand
        if any(not outputs.isdisjoint(model.outputs) for model in self._processes):
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
        """Values of one frame in mechanical units; without a touch the same object in frame after frame.

        pattern     of the running tip; gives the place and size of the tip's circle
        interval_s  time since the frame before this one; None: not known, no speed can be given
        demand      what is wanted; None: everything
        """
        if demand is not self._demand:
            self._demand = demand
            for kernel in (self.frame_models, self.light_models):
                kernel.want(None if demand is None else _outputs_in(demand))
            self._gives_contacts = demand is None or not demand.isdisjoint(OF_CONTACTS)
            self._derives = demand is None or not demand.isdisjoint(OF_DERIVED)
            self._at_rest = None
        if features.in_contact or features.contacts:
            return self._reading_of(features, pattern, interval_s)
        f = features
        known = f.contacts, f.slip_px, f.slip_probability, f.twist_slip_probability, f.vibration_px
        if self._at_rest is None or self._at_rest[0] != known:
            self._at_rest = known, self._reading_of(features, pattern, interval_s)
        return self._at_rest[1]

    def _reading_of(self, features: Features, pattern: PinPattern, interval_s: float | None) -> Reading:
        if features.in_contact:
            # None: not looked for, as nothing in demand depends on them.
            is_light = features.contacts == () and self.light_models is not self.frame_models
            kernel = self.light_models if is_light else self.frame_models
            values, sigmas, saturated = kernel.of_frame(features, pattern)
            if is_light:
                values, sigmas = self._unknown | values, self._unknown | sigmas
        else:
            values, sigmas, saturated = self._untouched.copy(), self._untouched_sigmas.copy(), frozenset()
        found = features.contacts if self._gives_contacts else None
        if self._derives or not features.in_contact:
            derive(features, found, values, sigmas, interval_s, self.mm_per_px)
        if not found:
            return Reading(values, sigmas, NOWHERE, saturated, True)
        contacts, beyond = self._places.of_frame(found, features, pattern, values.get("displacement_mm"))
        if beyond:
            saturated |= {name for i, name in enumerate(CONTACT_OUTPUTS) if beyond >> i & 1}
        return Reading(values, sigmas, contacts, saturated, True)


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
    """The reading of a tip without a calibration: the number of contacts alone.

    features  None: nothing is known of this frame
    """
    contacts = features.contacts if features is not None else None
    return Reading({}, {}, np.full((len(contacts or ()), 3), np.nan))
