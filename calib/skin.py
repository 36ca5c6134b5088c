"""Pins under the skin, or dots on its surface? Found from presses in known places, unless a file says it.

A press moves dots on the surface of a bonded gel over a distance of about the gel's thickness, and the few
dots under the tool by what the camera sees of their depth. Where cells grow says little of the place then:
errors of a calibrated place are twice those of a fit of the dots' motion. With pins they are alike.

Only a square grid is asked: that is how dots are printed, and a table is measured twice for the answer.
"""

from collections.abc import Callable
from dataclasses import replace

from calib.dataset import Dataset
from calib.errors import FitError
from calib.extract import Extract
from calib.fit import ModelKind, Search, fit
from calib.targets import Targets
from edge.rest.sensor_match import layout_of
from edge.types import Rest

#: The error of places read as of dots over that as of pins, below which the skin has dots: of 60 presses it
#: was 0.45 on dots, and 0.83 on pins in a grid.
CLEARLY = 0.65
_PLACE = ("contact_x_mm", "contact_y_mm")


def extract_of_dots(
    data: Dataset, targets: Targets, by_pins: Extract, measured: Callable[[Dataset], Extract]
) -> Extract | None:
    """The frames read as of dots, if places say that the skin has dots on its surface; None: it has pins.

    by_pins   the frames, read as of pins
    measured  reads the frames of a data set as it says
    """
    found = layout_of(data.rest) if set(_PLACE) <= targets.values.keys() else None
    if found is None or found[0] != "square":
        return None
    dots = data.read_as(on_surface=True)
    by_dots = measured(dots)
    is_clear = _place_error(dots.rest, targets, by_dots) < CLEARLY * _place_error(data.rest, targets, by_pins)
    return by_dots if is_clear else None


def _place_error(rest: Rest, targets: Targets, extract: Extract) -> float:
    """mm, rms error of places on held-out frames by the best polynomial; infinite: none can be fitted."""
    places = replace(targets, values={name: targets.values[name] for name in _PLACE})
    search = Search(kinds=frozenset({ModelKind.PLAIN, ModelKind.POLYNOMIAL}))
    try:
        choices = fit(rest, places, extract, mm_per_px=None, search=search)[1]
    except FitError:
        return float("inf")
    return min((choice.chosen.rms for choice in choices), default=float("inf"))
