"""Errors of a calibration on frames with known truth; frames without values are counted."""

from typing import Any

import numpy as np

from calib.extract import Extract
from calib.targets import Targets
from edge.calibration import Calibration
from edge.calibration.file import UNTOUCHED, Curve
from edge.calibration.inputs import FRAME_INPUTS
from edge.types import Array, Complex, Mask

_SIZE = FRAME_INPUTS.index("size")
#: The direction of a smaller shear is meaningless; the published network is evaluated on the same frames.
DIRECTION_MIN_MM = 1.5


def predict(calibration: Calibration, extract: Extract) -> tuple[dict[str, Array], dict[str, Array]]:
    """Values and sigmas of every frame and its strongest contact.

    Returns  two tables, name -> (n,) float64; NaN where there is none
    """
    n = len(extract.inputs)
    values = {name: np.full(n, np.nan) for name in sorted(calibration.outputs)}
    sigmas = {name: np.full(n, np.nan) for name in values}
    for i, z in enumerate(extract.inputs):
        models = calibration.light_models if z[_SIZE] == 0 else calibration.frame_models
        for name, (value, sigma, _) in zip(models.names, models.of_inputs(z).tolist(), strict=True):
            # A frame without a result has no value, like in `Calibration.apply`.
            known = extract.in_contact[i] or not np.isfinite(z).any()
            values[name][i], sigmas[name][i] = (value if known else UNTOUCHED[name]), sigma
    models = calibration.contact_models
    for i, z in enumerate(extract.contact):
        for name, (value, sigma, _) in zip(models.names, models.of_inputs(z).tolist(), strict=True):
            values[name][i], sigmas[name][i] = value, sigma
    of_own = calibration.rest.pattern.on_surface
    if {"contact_depth_mm", "displacement_mm"} <= values.keys() and not of_own:
        single = extract.counts == 1  # as in `Calibration.apply`
        for table in (values, sigmas):
            table["contact_depth_mm"][single] = table["displacement_mm"][single]
    return values, sigmas


def evaluate(calibration: Calibration, targets: Targets, extract: Extract) -> dict[str, Any]:
    """Errors as one JSON-able object.

    n_refused         frames whose pins were not identified with certainty: the edge sends no values
    n_read_untouched  pressed frames in which the edge saw no touch: it sends zeros, and no tilt
    n_without_value   of the frames with truth, those without a value; by name of the value
    n_beyond_range    frames whose truth is beyond what was calibrated: the edge sends its end, `SATURATED`
    *_mae_*, ...      mean errors over all frames that have a value, including refused ones
    accepted          the same over the frames whose values the edge would have sent

    None if the calibration or the table lacks the quantity, or no frame has a value.
    """
    values, sigmas = predict(calibration, extract)
    everything = np.ones(len(targets), dtype=np.bool_)
    return {
        "n_frames": len(targets),
        "n_refused": int((~extract.trusted).sum()),
        "n_read_untouched": int((extract.trusted & ~extract.in_contact & pressed(targets)).sum()),
        "n_without_value": {
            name: int((np.isfinite(truth) & ~np.isfinite(values[name])).sum())
            for name, truth in targets.values.items()
            if name in values
        },
        "n_beyond_range": _beyond_range(calibration, targets, extract.in_contact),
        **_errors(values, sigmas, targets, everything),
        "frame_time_us_median": round(float(np.median(extract.time_us)), 1),
        "accepted": _errors(values, sigmas, targets, extract.trusted),
    }


def _beyond_range(calibration: Calibration, targets: Targets, touched: Mask) -> dict[str, int]:
    """Touched frames by the value whose truth is further beyond its calibrated range than sigma."""
    found = {}
    for model in calibration.content.models:
        if isinstance(model, Curve):
            continue
        for name, (low, high), sigma in zip(model.outputs, model.valid, model.sigma, strict=True):
            truth = targets.values.get(name, np.zeros(len(targets)))[touched]
            found[name] = int(((truth < low - sigma) | (truth > high + sigma)).sum())
    return {name: n for name, n in found.items() if n and name in targets.values}


def pressed(targets: Targets) -> Mask:
    """(n,) bool: frames that are pressed according to their truth; by the depth if the table has it."""
    for name in ("displacement_mm", "contact_depth_mm", "force_n"):
        if name in targets.values:
            return np.asarray(np.nan_to_num(targets.values[name]) > 0.0)
    truth = np.column_stack(list(targets.values.values()))
    return np.asarray((np.nan_to_num(truth) != 0.0).any(axis=1))


def _errors(
    values: dict[str, Array], sigmas: dict[str, Array], targets: Targets, chosen: Mask
) -> dict[str, Any]:
    """Errors over the chosen frames that have truth and value."""
    rows = {
        name: chosen & np.isfinite(truth) & np.isfinite(values[name])
        for name, truth in targets.values.items()
        if name in values
    }
    error = {name: (values[name] - targets.values[name])[use] for name, use in rows.items()}

    def mae(name: str) -> float | None:
        return _mean(np.abs(error[name])) if name in error else None

    read, true = _vectors(values, targets, rows, "contact_x_mm", "contact_y_mm")
    inside = {name: np.abs(e) <= sigmas[name][rows[name]] for name, e in error.items()}
    return {
        "displacement_mae_mm": mae("displacement_mm"),
        "tilt_mae_deg": [mae("tilt_x_deg"), mae("tilt_y_deg")],
        "shear_mae_mm": [mae("shear_x_mm"), mae("shear_y_mm")],
        **_shear_errors(values, targets, rows),
        "torsion_mae_deg": mae("torsion_deg"),
        "force_mae_n": mae("force_n"),
        "force_xy_mae_n": [mae("force_x_n"), mae("force_y_n")],
        "torque_mae_nmm": mae("torque_z_nmm"),
        "contact_area_mae_mm2": mae("contact_area_mm2"),
        "contact_place_mean_mm": _mean(np.abs(read - true)),
        "contact_depth_mae_mm": mae("contact_depth_mm"),
        "sigma_coverage_68": _mean(np.concatenate([np.empty(0), *inside.values()])),
        "sigma_coverage_68_each": {name: _mean(part) for name, part in inside.items() if len(part)},
    }


def _vectors(
    values: dict[str, Array], targets: Targets, rows: dict[str, Mask], x: str, y: str
) -> tuple[Complex, Complex]:
    """Measured and true values, as x + i y, of the frames that have both."""
    if not {x, y} <= rows.keys():
        return np.empty(0, np.complex128), np.empty(0, np.complex128)
    both = rows[x] & rows[y]
    read, true = values[x] + 1j * values[y], targets.values[x] + 1j * targets.values[y]
    return read[both], true[both]


def _shear_errors(
    values: dict[str, Array], targets: Targets, rows: dict[str, Mask]
) -> dict[str, float | None]:
    """Errors of the shear's magnitude, and of its direction if it is large enough to have one."""
    read, true = _vectors(values, targets, rows, "shear_x_mm", "shear_y_mm")
    large = np.abs(true) > DIRECTION_MIN_MM
    off = np.degrees(np.abs(np.angle(read[large] * true[large].conj())))
    return {
        "shear_magnitude_mae_mm": _mean(np.abs(np.abs(read) - np.abs(true))),
        "shear_direction_mean_deg": _mean(off),
        "shear_direction_median_deg": _rounded(float(np.median(off))) if off.size else None,
    }


def _mean(column: Any) -> float | None:
    return _rounded(float(np.mean(column))) if len(column) else None


def _rounded(value: float) -> float:
    return round(value, 4)


#: Figures of a report: name, key, index in a list, unit, the value whose sigma is for it.
_FIGURES = (
    ("depth", "displacement_mae_mm", None, "mm", "displacement_mm"),
    ("tilt about x", "tilt_mae_deg", 0, "deg", "tilt_x_deg"),
    ("tilt about y", "tilt_mae_deg", 1, "deg", "tilt_y_deg"),
    ("shear along x", "shear_mae_mm", 0, "mm", "shear_x_mm"),
    ("shear along y", "shear_mae_mm", 1, "mm", "shear_y_mm"),
    ("shear, magnitude", "shear_magnitude_mae_mm", None, "mm", ""),
    ("shear, direction, mean", "shear_direction_mean_deg", None, "deg", ""),
    ("shear, direction, median", "shear_direction_median_deg", None, "deg", ""),
    ("torsion", "torsion_mae_deg", None, "deg", "torsion_deg"),
    ("normal force", "force_mae_n", None, "N", "force_n"),
    ("force along x", "force_xy_mae_n", 0, "N", "force_x_n"),
    ("force along y", "force_xy_mae_n", 1, "N", "force_y_n"),
    ("torque", "torque_mae_nmm", None, "Nmm", "torque_z_nmm"),
    ("contact area", "contact_area_mae_mm2", None, "mm2", "contact_area_mm2"),
    ("place of contact", "contact_place_mean_mm", None, "mm", ""),
    ("depth of contact", "contact_depth_mae_mm", None, "mm", "contact_depth_mm"),
    ("share of errors within sigma", "sigma_coverage_68", None, "", ""),
)


def error_rows(report: dict[str, Any]) -> list[tuple[str, str, str, str, str]]:
    """A report of `evaluate` as a table.

    Returns  figure, error over all frames, over the accepted ones, share of these within sigma, unit
    """
    rows, within = [], report["accepted"]["sigma_coverage_68_each"]
    for name, key, place, unit, value in _FIGURES:
        both = (report[key], report["accepted"][key])
        every, accepted = both if place is None else (both[0][place], both[1][place])
        if every is not None:
            share = f"{within[value]:.0%}" if value in within else ""
            rows.append((name, f"{every:.4g}", "-" if accepted is None else f"{accepted:.4g}", share, unit))
    return rows


def counts_line(report: dict[str, Any]) -> str:
    """The number of frames of a report, and of those without values, or with zeros."""
    return (
        f"{report['n_frames']} frames; {report['n_refused']} refused (no values sent), "
        f"{report['n_read_untouched']} pressed but read as untouched (zeros sent)"
    )
