"""Warnings of a fit, found from the truth: presses that were not felt, and drags that slid."""

from collections.abc import Iterable, Iterator

import numpy as np

from calib.extract import Extract
from calib.fit import Choice
from calib.ridge import error_of_mean
from calib.targets import Targets
from calib.unloaded import LOADS


def fit_warnings(targets: Targets, extract: Extract, choices: Iterable[Choice]) -> Iterator[str]:
    """A sentence for each thing that the frames do not show."""
    yield from _not_felt(targets, extract)
    for choice in choices:
        if choice.outputs == ("shear_x_mm", "shear_y_mm"):
            yield from _direction_alone(choice)


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
