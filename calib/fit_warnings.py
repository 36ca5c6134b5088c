"""Warnings of a fit, found from the truth: presses that were not felt, and drags that slid."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from calib.extract import Extract
from calib.fit import Choice
from calib.ridge import error_of_mean
from calib.targets import Targets
from calib.unloaded import LOADS
from hostlink.wire.fields import FIELDS


def fit_warnings(targets: Targets, extract: Extract, choices: Sequence[Choice]) -> Iterator[str]:
    """A sentence for each thing that the frames do not show."""
    yield from _odd_truth(targets, extract, choices)
    yield from _not_felt(targets, extract)
    for choice in choices:
        if choice.outputs == ("shear_x_mm", "shear_y_mm"):
            yield from _direction_alone(choice)


def _odd_truth(targets: Targets, extract: Extract, choices: Sequence[Choice]) -> Iterator[str]:
    """Columns in another unit or place, it seems, and those that are not fitted because nothing varies."""
    fitted = {name for choice in choices for name in choice.outputs}
    most = {field.name: field.high for field in FIELDS if field.unit == "N"}
    sizes = {name: float(np.nanmax(np.abs(values))) for name, values in targets.values.items()}
    for name, values in targets.values.items():
        size, limit = sizes[name], most.get(name, math.inf)
        if size > limit:
            yield f"{name} reaches {size:.3g} N, a sample holds {limit:g} N; is the table in N, not in g?"
        if name not in fitted and size > 0.0 and np.nanmin(values) == np.nanmax(values):
            yield f"{name} is not fitted: it is {values[0]:.3g} in all frames; take several values"
    for name in targets.values.keys() & LOADS:
        touched = targets.values[name][extract.in_contact]
        low, high = float(np.nanmin(touched, initial=0.0)), float(np.nanmax(touched, initial=0.0))
        if low < -0.5 * high:
            yield f"{name} is {low:.3g} to {high:.3g} in touched frames; are columns exchanged?"
    for name in ("tilt", "torsion"):
        angle = max((size for full, size in sizes.items() if full.startswith(name)), default=0.0)
        if 0.0 < angle < math.radians(45.0):
            yield f"no {name} of the table exceeds {angle:.2g} deg; is it in degrees, not in radians?"


def _not_felt(targets: Targets, extract: Extract) -> Iterator[str]:
    """Frames that are pressed according to the table, and read as untouched."""
    name = next((name for name in LOADS if name in targets.values), None)
    if name is None:
        return
    load = targets.values[name]
    pressed = extract.trusted & (load > 0)
    missed = pressed & ~extract.in_contact
    if missed.any():
        deepest = int(np.argmax(np.where(missed, load, 0.0)))
        yield (
            f"{missed.sum()} of {pressed.sum()} pressed frames read as untouched, so zeros are sent, up to "
            f"{name} = {load[deepest]:.3g} ({targets.frames[deepest].name})"
        )


def _direction_alone(choice: Choice) -> Iterator[str]:
    """Whether one magnitude for all frames, along the direction that was read, is as good as the model.

    So it is where the tip slid: the pins then follow the drag no further, and tell only where it goes. A set
    whose drags are all of one length cannot tell the magnitude either.
    """
    read, true, share = choice.held_out, choice.truth, choice.share
    length = np.abs(read)
    direction = np.where(length > 0, read / np.where(length > 0, length, 1.0), 0.0)
    magnitude = float(np.average((direction.conj() * true).real, weights=share))
    squares = [np.abs(values - true) ** 2 for values in (magnitude * direction, read)]
    constant, model = (float(np.average(each, weights=share)) for each in squares)
    if constant - model <= error_of_mean(squares[0] - squares[1], share):
        yield (
            f"shear is read as a direction: {magnitude:.2g} mm in every frame errs by {constant**0.5:.3g} "
            f"mm, the model by {model**0.5:.3g} mm (rms, held out). The tip slid, or all drags are of one "
            "length; take shorter ones of several lengths"
        )
