"""Checks of a calibration file beyond its structure: models that fit together, a tip that can exist.

Structure, lengths and ranges are checked by the types of `edge.calibration.file`. Nothing is built from the
file before it has passed, and every message names the place in the file.
"""

import operator
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from edge.calibration.file import (
    CONTACT_OUTPUTS,
    JOINT_OUTPUTS,
    UNTOUCHED,
    CalibrationFile,
    Curve,
    Model,
    Polynomial,
    Process,
    Sensor,
)
from edge.calibration.inputs import CONTACT_INPUTS, FRAME_INPUTS, OF_PLACE
from edge.geometry.neighbours import nearest_of
from edge.limits import IMAGE_PIXELS, PINS_MAX, BadContent, quote
from edge.types import Array


@dataclass(frozen=True, slots=True)
class TipLimits:
    """Limits of a plausible description of a tip. Evidence: docs/tuning.md, "Calibration"."""

    stated_ratio_max: float = 1.25  # a length that is stated over what the pins show of it, or the inverse
    fill_min: float = 0.25  # share of the tip's circle that pins of this pitch cover


LIMITS = TipLimits()
#: Area of a pin's cell, in squared pitches: hexagons.
_CELL_AREA = 0.866
_POSITIVE = {"displacement_mm", "force_n", "contact_area_mm2", "contact_depth_mm", "joint_depth_mm"}


def check(content: CalibrationFile) -> None:
    """Raises  BadContent: place in the file, what is wrong, what would be right"""
    _check_view(content)
    shared = operator.attrgetter("format", "version", "sensor.size_px", "sensor.lens")
    for i, view in enumerate(content.views):
        try:
            _check_view(view)
        except BadContent as error:
            raise BadContent(f"views[{i}].{error}") from None
        if view.views or shared(view) != shared(content):
            raise BadContent(f"views[{i}]: give one view, of the format, version, size and lens of the first")
    pins_n = sum(len(view.sensor.rest_xy_px) for view in (content, *content.views))
    if pins_n > PINS_MAX:
        raise BadContent(f"views: {pins_n} pins in all; {PINS_MAX} at most are wanted")


def _check_view(content: CalibrationFile) -> None:
    _check_sensor(content.sensor)
    _check_models(content.models, "models")
    known = [outputs_of(model) for model in content.models]
    for i, model in enumerate(content.without_contact or ()):
        if outputs_of(model) not in known or is_of_contact(model) or is_of_place(model):
            raise BadContent(
                f"without_contact[{i}]: give a model without p, peak and size, of values of a frame that "
                "'models' has together too"
            )
    _check_models(content.without_contact or (), "without_contact")


def _check_models(models: Sequence[Model], where: str) -> None:
    seen: set[str] = set()
    for i, model in enumerate(models):
        _check_outputs(model, f"{where}[{i}]", seen)
        if isinstance(model, Curve):
            _check_curve(model, f"{where}[{i}]")
        elif isinstance(model, Polynomial):
            _check_polynomial(model, f"{where}[{i}]")
        else:
            _check_process(model, f"{where}[{i}]")


def outputs_of(model: Model) -> list[str]:
    """Names of the values that a model gives."""
    return [model.output] if isinstance(model, Curve) else model.outputs


def is_of_contact(model: Model) -> bool:
    """Whether a model is evaluated once a contact; else once a frame."""
    return all(name in CONTACT_OUTPUTS or name in JOINT_OUTPUTS for name in outputs_of(model))


def is_of_place(model: Model) -> bool:
    """Whether a frame's model depends on its strongest contact, which a light touch has not."""
    terms = [[model.input]] if isinstance(model, Curve) else model.terms
    if isinstance(model, Process):
        terms = [*terms, *model.noise_terms, *(model.lost.terms if model.lost else ())]
    return any(name.rstrip("*") in OF_PLACE for term in terms for name in term)


def _check_outputs(model: Model, where: str, seen: set[str]) -> None:
    for name in outputs_of(model):
        if name not in UNTOUCHED and not is_of_contact(model):
            known = ", ".join((*UNTOUCHED, *CONTACT_OUTPUTS, *JOINT_OUTPUTS))
            raise BadContent(f"{where}: unknown output {quote(name)}; known: {known}")
        if name in seen:
            raise BadContent(f"{where}: a second model for '{name}'")
        seen.add(name)


def _known_inputs(model: Model) -> Sequence[str]:
    return CONTACT_INPUTS if is_of_contact(model) else FRAME_INPUTS


def _check_curve(model: Curve, where: str) -> None:
    if model.input not in _known_inputs(model):
        known = ", ".join(_known_inputs(model))
        raise BadContent(f"{where}.input: unknown input {quote(model.input)}; known: {known}")
    steps = np.diff(np.array(model.knots), axis=0)
    rounding = np.finfo(float).eps * float(np.abs(np.array(model.knots)[:, 0]).max())
    if not np.all(steps[:, 0] > rounding):
        k = int(np.argmin(steps[:, 0])) + 1
        raise BadContent(f"{where}.knots[{k}]: the input must increase from knot to knot")
    if np.any(steps[:, 1] < 0) and np.any(steps[:, 1] > 0):
        raise BadContent(f"{where}.knots: the output must be monotone: only increase or only decrease")
    _check_positive(model.output, max(y for _, y in model.knots), f"{where}.knots")


def _check_polynomial(model: Polynomial, where: str) -> None:
    inputs = _known_inputs(model)
    _check_terms(model.terms, inputs, f"{where}.terms")
    spread = [(f"spread[{r}]", row) for r, row in enumerate(model.spread)]
    _check_rows([("weights", model.weights), *spread], len(model.terms), where)
    _check_outputs_of(model, where)


def _check_process(model: Process, where: str) -> None:
    if is_of_contact(model):
        raise BadContent(f"{where}: a process for '{model.outputs[0]}'; only values of a frame can have one")
    _check_terms(model.terms, FRAME_INPUTS, f"{where}.terms")
    _check_terms(model.noise_terms, FRAME_INPUTS, f"{where}.noise_terms")
    factor = [(f"factor[{r}]", row) for r, row in enumerate(model.factor)]
    _check_rows([("weights", model.weights), *factor], len(model.terms), where)
    _check_weights(model.noise_weights, model.noise_terms, f"{where}.noise_weights")
    if model.across_weights:
        _check_weights(model.across_weights, model.noise_terms, f"{where}.across_weights")
        if len(model.outputs) != 2:
            raise BadContent(f"{where}.across_weights: one output has no direction; leave them away")
    for name, (low, high) in (("noise", model.noise_range), ("across", model.across_range)):
        if low > high:
            raise BadContent(f"{where}.{name}_range: give [low, high]")
    if len(model.own) not in (0, len(model.outputs)) or any(low > high for low, high in model.own):
        raise BadContent(f"{where}.own: give a range [low, high] for each of {len(model.outputs)} outputs")
    if model.lost is not None:
        _check_terms(model.lost.terms, FRAME_INPUTS, f"{where}.lost.terms")
        _check_weights(model.lost.weights, model.lost.terms, f"{where}.lost.weights")
    _check_outputs_of(model, where)


def _check_weights(weights: Sequence[float], terms: Sequence[object], where: str) -> None:
    if len(weights) != len(terms):
        raise BadContent(f"{where}: {len(weights)} numbers for {len(terms)} terms; give one for each")


def _check_terms(terms: Sequence[Sequence[str]], inputs: Sequence[str], where: str) -> None:
    known = {name for one in inputs for name in (one, f"{one}*")}
    for k, term in enumerate(terms):
        for name in term:
            if name not in known:
                raise BadContent(
                    f"{where}[{k}]: unknown input {quote(name)}; known: {', '.join(inputs)}, "
                    "and each with a star (complex conjugate)"
                )


def _check_rows(rows: Sequence[tuple[str, Sequence[object]]], n: int, where: str) -> None:
    for name, row in rows:
        if len(row) != n:
            raise BadContent(f"{where}.{name}: {len(row)} pairs of numbers for {n} terms; give one for each")


def _check_outputs_of(model: Polynomial | Process, where: str) -> None:
    """A range and a sigma for each output."""
    outputs = len(model.outputs)
    if len(model.valid) != outputs or any(low > high for low, high in model.valid):
        raise BadContent(f"{where}.valid: give a range [low, high] for each of {outputs} outputs")
    if len(model.sigma) != outputs:
        raise BadContent(f"{where}.sigma: give one for each of {outputs} outputs")
    _check_positive(model.outputs[0], model.valid[0][1], f"{where}.valid")


def _check_positive(output: str, most: float, where: str) -> None:
    """A press is a positive depth and force: of another sign they drive a hand into what it touches."""
    if output in _POSITIVE and most <= 0:
        raise BadContent(
            f"{where}: '{output}' is never above 0; a press is positive: is the truth's sign wrong?"
        )


def _check_sensor(sensor: Sensor) -> None:
    """A tip as the camera could see it: the pins in the image, apart, spread over the tip's circle."""
    if not sensor.serial.isprintable():
        raise BadContent(f"sensor.serial: {quote(sensor.serial)} has characters that cannot be printed")
    width, height = sensor.size_px
    if width * height > IMAGE_PIXELS:
        raise BadContent(
            f"sensor.size_px: {width}x{height} pixels are too many; at most {IMAGE_PIXELS} in all"
        )
    if sensor.brightness <= 0 or sensor.noise < 0:
        raise BadContent("sensor: brightness must be more than 0, noise at least 0")
    xy = np.array(sensor.rest_xy_px)
    _check_inside(sensor, xy)
    distance = nearest_of(xy, xy, 2)[0][:, 1]
    pitch = float(np.median(distance))
    worst = int(distance.argmin())
    if distance[worst] <= min(sensor.pin_radius_px, pitch / 2):  # the middle of one is on the other
        raise BadContent(
            f"sensor.rest_xy_px[{worst}]: {distance[worst]:.3g} px from another pin, where the others are "
            f"{pitch:.3g} px apart"
        )
    if not _plausible(sensor.pitch_px, pitch):
        raise BadContent(f"sensor.pitch_px: {sensor.pitch_px:g}, but the rest pins are {pitch:.3g} px apart")
    if 2 * sensor.pin_radius_px > LIMITS.stated_ratio_max * pitch:
        raise BadContent(
            f"sensor.pin_radius_px: {sensor.pin_radius_px:g}, too large for pins {pitch:.3g} px apart"
        )
    _check_circle(sensor, xy, pitch)


def _plausible(stated: float, measured: float) -> bool:
    return 1 / LIMITS.stated_ratio_max <= stated / measured <= LIMITS.stated_ratio_max


def _check_inside(sensor: Sensor, xy: Array) -> None:
    margin = sensor.pin_radius_px + 0.5  # the border cuts some
    outside = np.any((xy < -margin) | (xy > np.array(sensor.size_px) - 1 + margin), axis=1)
    if outside.any():
        k = int(outside.argmax())
        width, height = sensor.size_px
        raise BadContent(
            f"sensor.rest_xy_px[{k}]: ({xy[k, 0]:g}, {xy[k, 1]:g}) is outside of the image ({width}x{height})"
        )


def _check_circle(sensor: Sensor, xy: Array, pitch: float) -> None:
    reach = float(np.hypot(*(xy - sensor.centre_px).T).max())
    if not _plausible(sensor.tip_radius_px, reach):
        raise BadContent(
            f"sensor.tip_radius_px: {sensor.tip_radius_px:g}, but the outermost pin is {reach:.4g} px from "
            "centre_px"
        )
    fill = len(xy) * _CELL_AREA * pitch**2 / (np.pi * sensor.tip_radius_px**2)
    if fill < LIMITS.fill_min:
        raise BadContent(
            f"sensor.rest_xy_px: {len(xy)} pins {pitch:.3g} px apart cover {fill:.0%} of the tip's circle; "
            "are most of the tip's pins missing, or all on one line?"
        )
