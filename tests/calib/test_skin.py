"""Whether a skin has dots on its surface, found from presses in known places on a bonded layer."""

from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from calib.dataset import Dataset, RestGroup
from calib.extract import Extract
from calib.skin import extract_of_dots
from calib.targets import Targets
from edge.pins import take_rest
from tests.bench.bonded_layer import LayerPins, SurfaceDots
from tests.bench.flat_gel import FlatGel
from tests.bench.half_space import Ball

PRESSES = 60


class GridPins(LayerPins):
    """Pins in a square grid."""

    LAYOUT = "square"


def presses(gel: FlatGel) -> Dataset:
    rng = np.random.default_rng(1)
    rest = take_rest([gel.picture((), rng) for _ in range(4)])
    x, y, depth = rng.uniform((-8.0, -8.0, 0.5), (8.0, 8.0, 2.5), (PRESSES, 3)).T
    balls = [Ball(*row, radius_mm=2.6) for row in zip(x.tolist(), y.tolist(), depth.tolist(), strict=True)]
    images = [gel.picture([ball], rng) for ball in balls]
    names = ("displacement_mm", "contact_x_mm", "contact_y_mm")
    frames = tuple(Path(f"{i}.png") for i in range(PRESSES))
    targets = Targets("presses", frames, dict(zip(names, (depth, x, y), strict=True)), "")
    return Dataset((RestGroup(rest, targets, lambda: images),))


def measured(data: Dataset) -> Extract:
    with ThreadPoolExecutor(1) as pool:
        return data.extract(pool)


@pytest.mark.parametrize(("gel", "dots"), [(SurfaceDots(144, 1), True), (GridPins(144, 1), False)])
def test_places_show_which_skins_have_dots_on_their_surface(gel: FlatGel, dots: bool) -> None:
    data = presses(gel)
    targets, by_pins = data.targets, measured(data)
    found = extract_of_dots(data, targets, by_pins, measured)
    assert (found is not None) == dots
    depths = {"displacement_mm": targets.values["displacement_mm"]}
    no_places = Targets("presses", targets.frames, depths, "")
    assert extract_of_dots(data, no_places, by_pins, partial(pytest.fail, "measured for nothing")) is None
