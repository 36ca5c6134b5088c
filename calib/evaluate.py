"""How far a calibration is off on frames with known truth, refused frames counted."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from calib.extract import Extract
from calib.targets import Targets
from edge.calibration import UNTOUCHED, Calibration
from edge.types import Array

__all__ = ["evaluate", "predict"]

#: Below this true shear its direction means little; the published network is judged over the same frames.
DIRECTION_MIN_MM = 1.5


def predict(calibration: Calibration, extract: Extract) -> tuple[dict[str, Array], dict[str, Array]]:
    """Values and sigmas of every frame and its strongest contact.

    Returns  two tables, name -> (n,) float64; NaN where there is none
    """
    n = len(extract.inputs)
    values = {name: np.full(n, np.nan) for name in sorted(calibration.outputs)}
    sigmas = {name: np.full(n, np.nan) for name in values}
    for i, z in enumerate(extract.inputs):
        for name, value, sigma, _ in calibration.frame_values(z):
            # As `Calibration.apply` has it; a frame without any result stays without a value.
            known = extract.touched[i] or not np.isfinite(z).any()
            values[name][i], sigmas[name][i] = (value if known else UNTOUCHED[name]), sigma
    for i, z in enumerate(extract.contact):
        for name, value, sigma in calibration.contact_values(z):
            values[name][i], sigmas[name][i] = value, sigma
    if {"contact_depth_mm", "displacement_mm"} <= values.keys():
        single = extract.counts == 1  # as `Calibration.apply` has it
        for table in (values, sigmas):
            table["contact_depth_mm"][single] = table["displacement_mm"][single]
    return values, sigmas


def evaluate(calibration: Calibration, targets: Targets, extract: Extract) -> dict[str, Any]:
    """Errors as one JSON-able object.

    At the top level over all frames, whatever the edge thought of them; under `accepted` over those whose
    values the edge would have sent. None where the calibration or the table lacks the quantity, or a
    single frame gave no value at all.
    """
    values, sigmas = predict(calibration, extract)
    everything = np.ones(len(targets), dtype=np.bool_)
    report: dict[str, Any] = {
        "n_frames": len(targets),
        "n_refused": int((~extract.sure).sum()),
        **_errors(values, sigmas, targets, everything),
        "frame_time_us_median": round(float(np.median(extract.time_us)), 1),
        "accepted": _errors(values, sigmas, targets, extract.sure),
    }
    return report


def _errors(
    values: dict[str, Array], sigmas: dict[str, Array], targets: Targets, chosen: Any
) -> dict[str, Any]:
    """Over the chosen frames whose truth is known; a value that is missing there spoils the mean."""
    rows = {name: chosen & np.isfinite(truth) for name, truth in targets.values.items() if name in values}
    error = {name: (values[name] - targets.values[name])[use] for name, use in rows.items()}

    def mae(name: str) -> float | None:
        return _number(np.abs(error[name]).mean()) if name in error and error[name].size else None

    def place() -> float | None:
        x, y = error.get("contact_x_mm"), error.get("contact_y_mm")
        return _number(np.hypot(x, y).mean()) if x is not None and y is not None and x.size else None

    report: dict[str, Any] = {
        "displacement_mae_mm": mae("displacement_mm"),
        "tilt_mae_deg": [mae("tilt_x_deg"), mae("tilt_y_deg")],
        "shear_mae_mm": [mae("shear_x_mm"), mae("shear_y_mm")],
        "shear_magnitude_mae_mm": None,
        "shear_direction_mean_deg": None,
        "shear_direction_median_deg": None,
        "torsion_mae_deg": mae("torsion_deg"),
        "force_mae_n": mae("force_n"),
        "contact_area_mae_mm2": mae("contact_area_mm2"),
        "contact_place_mean_mm": place(),
        "contact_depth_mae_mm": mae("contact_depth_mm"),
        "sigma_coverage_68": None,
    }
    if {"shear_x_mm", "shear_y_mm"} <= error.keys():
        both = rows["shear_x_mm"] & rows["shear_y_mm"]
        true = (targets.values["shear_x_mm"] + 1j * targets.values["shear_y_mm"])[both]
        read = (values["shear_x_mm"] + 1j * values["shear_y_mm"])[both]
        if both.any():
            report["shear_magnitude_mae_mm"] = _number(np.abs(np.abs(read) - np.abs(true)).mean())
        large = np.abs(true) > DIRECTION_MIN_MM
        if large.any():
            off = np.degrees(np.abs(np.angle(read[large] * true[large].conj())))
            report["shear_direction_mean_deg"] = _number(off.mean())
            report["shear_direction_median_deg"] = _number(np.median(off))
    inside = [np.abs(e) <= sigmas[name][rows[name]] for name, e in error.items()]
    if any(len(part) for part in inside):
        report["sigma_coverage_68"] = _number(np.concatenate(inside).mean())
        report["sigma_coverage_68_each"] = {
            name: _number(part.mean()) for name, part in zip(error, inside, strict=True) if len(part)
        }
    return report


def _number(value: Any) -> float | None:
    return round(float(value), 4) if math.isfinite(value) else None
