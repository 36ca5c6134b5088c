"""Sensors are recognised by the layout of their pins, simulated and real; what is none of them is not."""

from dataclasses import replace
from functools import lru_cache
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from calib.sim.camera import Camera
from calib.sim.of_sensor import appearance_of, camera_of
from calib.sim.render import Appearance
from calib.sim.simulator import Simulator
from calib.sim.tip import Tip
from calib.simulated_calibration import mm_per_px as true_mm_per_px
from edge.frame import Pipeline
from edge.pins import take_rest
from edge.rest.sensor_match import CLEAR, layout_of, match_layout, mm_per_px, recognise
from edge.rest.symmetry import symmetry_of
from edge.sensors import known_sensors, load_sensor, missing_pins
from edge.sources import open_source
from edge.sources.files import read_image
from edge.types import Image, Rest
from tests.support.layouts import only, pins_at

SIMULATED = ("gelsight-mini", "square-grid", "tactip-127", "tactip-331")
KNOWN = known_sensors()


@lru_cache
def simulator(name: str) -> Simulator:
    sensor = load_sensor(name)
    return Simulator(camera_of(sensor), appearance_of(sensor, Appearance()))


@lru_cache
def rest_of(name: str) -> Rest:
    return take_rest([simulator(name).frame().image])


@pytest.mark.parametrize("name", SIMULATED)
def test_a_simulated_sensor_is_recognised(name: str) -> None:
    found = recognise(rest_of(name), KNOWN)
    assert found is not None
    assert found.sensor.name == name
    assert found.match.pins_on == 1.0


@pytest.mark.parametrize(
    ("sensor", "seen", "known"),
    [
        ("gelsight-mini", "gelsight-mini", True),
        ("tactip-127", "tactip-127", True),
        ("tactip-331", "tactip-331", False),  # its pitch is not known
        ("digitac", "tactip-331", False),
        ("tactip-127", "tactip-331", False),  # it is another one
    ],
)
def test_a_known_pitch_gives_the_scale_without_a_ruler(sensor: str, seen: str, known: bool) -> None:
    scale = mm_per_px(load_sensor(sensor), rest_of(seen))
    assert scale == (pytest.approx(true_mm_per_px(simulator(seen)), rel=0.003) if known else None)


def test_the_same_pins_in_another_layout_are_another_tip() -> None:
    """127 pins in rings are no hexagonal lattice of 127; and a lattice is a square grid, sheared."""
    rings = take_rest([Simulator(Camera(Tip(127, "rings"), size_px=(320, 320))).frame().image])
    assert recognise(rings, KNOWN) is None
    found = layout_of(rings)
    assert found is not None
    assert found[0] == "rings"
    hexagonal = rest_of("tactip-127")
    assert recognise(hexagonal, [load_sensor("square-grid")]) is None
    assert match_layout(hexagonal, "square").pins_on < 0.1
    assert match_layout(rest_of("square-grid"), "hex", 127).pins_on < 0.1


@pytest.mark.parametrize(
    ("columns", "rows", "size_px", "pitch_px"),
    [
        (10, 7, (320, 240), 31.4),  # the sensor itself
        (10, 7, (640, 480), 62.8),  # from a larger image
        (15, 12, (640, 480), 38.0),
        (23, 23, (427, 320), 13.0),
        (9, 7, (640, 480), 31.0),  # as many pins that leave the borders free
        (8, 8, (240, 240), 29.0),  # as many in another view
    ],
)
def test_dark_square_grids_of_others_are_not_named(
    columns: int, rows: int, size_px: tuple[int, int], pitch_px: float
) -> None:
    own = (columns, rows) == (10, 7)
    xy = pitch_px * np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)
    xy += (np.array(size_px) - 1 - xy.max(axis=0)) / 2
    pattern = rest_of("gelsight-mini").pattern
    pattern = replace(pattern, size_px=size_px, pitch_px=pitch_px, centre_img=np.array(size_px) / 2)
    rest = Rest(pins_at(xy.astype(np.float64), 5.0), pattern)
    assert (recognise(rest, KNOWN) is not None) == own
    assert (mm_per_px(load_sensor("gelsight-mini"), rest) is not None) == own


def test_pins_in_no_layout_are_no_sensor() -> None:
    """A dart-throwing pattern: even spacing, no order."""
    rng, placed = np.random.default_rng(19), [np.array([200.0, 200.0])]
    while len(placed) < 127:
        xy = rng.uniform(20, 380, 2)
        if np.hypot(*(np.array(placed) - xy).T).min() > 22:
            placed.append(xy)
    rest = Rest(pins_at(np.array(placed), 5.0), rest_of("tactip-127").pattern)
    assert recognise(rest, KNOWN) is None
    assert layout_of(rest) is None


def test_the_polarity_counts() -> None:
    sensor = load_sensor("gelsight-mini")
    image = 255 - simulator("gelsight-mini").frame().image
    found = recognise(take_rest([image]), KNOWN)
    assert found is not None
    assert found.sensor.name == "square-grid"
    assert recognise(take_rest([image]), [sensor]) is None


@pytest.mark.parametrize("lost_n", [5, 30])
def test_a_few_missing_pins_are_counted_and_many_make_it_unknown(lost_n: int) -> None:
    sensor = load_sensor("tactip-127")
    fewer = only(rest_of("tactip-127"), np.sort(np.random.default_rng(7).permutation(127)[lost_n:]))
    assert (recognise(fewer, [sensor]) is not None) == (lost_n == 5)
    assert missing_pins(sensor, len(fewer)) == f"{127 - lost_n} pins found, TacTip, 127 pins has 127"
    assert missing_pins(sensor, 127) == ""


def test_a_grid_behind_a_fisheye_is_still_a_grid() -> None:
    """Pins at the border half as far apart as in the middle."""
    line = np.arange(-8.0, 9.0)
    xy = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    far = np.hypot(*xy.T)
    bent = xy * (np.arctan(0.09 * far) / np.maximum(0.09 * far, 1e-9))[:, None]
    pattern = replace(rest_of("square-grid").pattern, centre_img=np.array([320.0, 320.0]), pitch_px=25.0)
    match = match_layout(Rest(pins_at(320 + 30 * bent, 5.0), pattern), "square")
    assert match.pins_on == 1.0
    assert match.residual < 0.5 * CLEAR


def _first_images(video: Path) -> list[Image]:
    return [frame.image for frame in islice(open_source(str(video)), 8)]


@pytest.mark.real
def test_real_sensors_are_recognised_and_home_made_tips_are_none(real_dir: Path) -> None:
    binary = recognise(take_rest([read_image(real_dir / "tactip331_binary" / "rest.png")]), KNOWN)
    assert binary is not None
    assert binary.sensor.name == "tactip-331"
    mini = take_rest(_first_images(real_dir / "gelsight_mini" / "press.avi"))
    found = recognise(mini, KNOWN)
    assert found is not None
    assert found.sensor.name == "gelsight-mini"
    # The maker writes 0.0625 and, elsewhere, 0.0634 mm a pixel.
    assert mm_per_px(found.sensor, mini) == pytest.approx(0.063, abs=0.001)
    for name in ("north", "west", "Movement4"):
        assert recognise(take_rest(_first_images(real_dir / "video" / f"{name}.avi")), KNOWN) is None


@pytest.mark.parametrize("name", SIMULATED)
def test_every_simulated_sensor_holds_its_pins_through_a_press(name: str) -> None:
    frames = list(open_source(f"sim:press?sensor={name}&paced=0"))
    rest = take_rest([frame.image for frame in frames[:8]])
    assert bool(rest.pattern.dark) == (name == "gelsight-mini")
    symmetry = symmetry_of(rest)
    assert symmetry.asymmetry < 0.02
    assert not symmetry.in_contact
    pipeline = Pipeline(rest)
    results = [pipeline.process(frame) for frame in frames]
    assert min(result.tracks.n_seen for result in results) >= 0.95 * len(rest)
    touched = [result.features is not None and result.features.in_contact for result in results]
    assert touched[-1]
    assert not any(touched[:8])
