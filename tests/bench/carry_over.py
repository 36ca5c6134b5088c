"""`python -m tests.bench carry_over`: how far a calibration carries over to another tip.

A first tip is fitted to many frames. Each other tip is fitted to a few frames of its own: alone, and with the
first tip's calibration as prior; the same other frames judge. Simulated tips differ in the number, places and
length of their pins, in dome, gel, skin and friction, in the camera's distance, lens, zoom, place and turn.

    --real  the published 331-pin set as first tip; the other one is the grey 331-pin set, 50 frames with the
            truth of depth and tilt, and without a picture of the untouched tip
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
from rich.progress import track

from calib.carry_over import known_models
from calib.dataset import open_dataset
from calib.errors import FitError
from calib.evaluate import evaluate
from calib.extract import Extract, executor, extract
from calib.fit import ModelKind, Prefer, Search, fit
from calib.protocols import SURFACE_HIGH, SURFACE_LOW, sheared
from calib.rig.simulated import CameraTable, SimulatedRig, Simulation
from calib.sim import Tip, Tool
from calib.targets import Targets
from edge.calibration import Calibration
from edge.pins import take_rest
from edge.types import Image, Rest
from tests.bench.output import writes_results
from tests.bench.real import COLUMNS, row, table
from tests.bench.recordings import REAL, TIP_331

FIRST = Simulation()
OTHERS = {
    "soft gel, thin skin, other lens": Simulation(
        tip=Tip(skin_mm=1.0, reach_mm=14.0, layer_mm=0.6, closed=0.8, friction=0.7),
        camera=CameraTable(roll_deg=10.0, centre_px=(12.0, -9.0), pins_radius_px=160.0, k1=-0.03),
        seed=5,
    ),
    "127 long pins, near camera": Simulation(
        tip=Tip(
            n_pins=127, kind="hex", pin_length_mm=2.5, pin_radius_mm=0.8, dome_radius_mm=19.0, pins_deg=64.0,
            camera_distance_mm=34.0,
        ),
        camera=CameraTable(roll_deg=-25.0, centre_px=(-15.0, 6.0)),
        seed=6,
    ),
    "217 pins, large dome, camera turned": Simulation(
        tip=Tip(
            n_pins=217, dome_radius_mm=24.0, pins_deg=60.0, camera_distance_mm=48.0, skin_mm=2.2,
            reach_mm=26.0, pin_length_mm=1.6,
        ),
        camera=CameraTable(roll_deg=90.0, pins_radius_px=200.0, k1=-0.12),
        seed=7,
    ),
}  # fmt: skip
OUTPUTS = ("displacement_mm", "tilt_x_deg", "tilt_y_deg", "shear_x_mm", "shear_y_mm", "torsion_deg")
SIZES = (10, 25, 50)
TEST, TEST_REAL = 150, 25
DRAWS = 3
REST_FRAMES = 10


@dataclass(frozen=True)
class Seen:
    """Frames of one tip."""

    rest: Rest
    targets: Targets
    extract: Extract


def simulated(name: str, simulation: Simulation, count: int, seed: int, pool: Executor) -> Seen:
    """Random poses in the range of protocol `surface`."""
    rig = SimulatedRig(simulation)
    rig.mount(Tool("flat"))
    rest = take_rest([rig.frame().image for _ in range(REST_FRAMES)])
    values = np.random.default_rng(seed).uniform(SURFACE_LOW, SURFACE_HIGH, (count, len(SURFACE_LOW)))

    def images() -> Iterator[Image]:
        for one in track(values.tolist(), name):
            for step in sheared(*one):
                rig.move(step.pose)
            yield rig.frame().image

    frames = tuple(Path(f"pose-{i}") for i in range(count))
    targets = Targets(name, frames, dict(zip(OUTPUTS, values.T, strict=True)), "")
    return Seen(rest, targets, extract(rest, images(), pool))


def recorded(folder: Path, rest: Path | None, pool: Executor) -> Seen:
    data = open_dataset([folder / "targets.csv"], folder / "frames", rest)
    return Seen(data.rest, data.targets, data.extract(pool))


def errors(
    seen: Seen, rows: Sequence[int], search: Search, test_targets: Targets, test: Extract, pool: Executor
) -> list[float | None]:
    """Of a fit to some rows, on the frames that judge; None: too few of the rows can be used."""
    try:
        return list(row(evaluate(fitted(seen, rows, search, pool), test_targets, test)))
    except FitError:
        return [None] * len(COLUMNS)


def fitted(seen: Seen, rows: Sequence[int], search: Search, pool: Executor) -> Calibration:
    targets, inputs = seen.targets.rows(rows), seen.extract.rows(rows)
    return fit(seen.rest, targets, inputs, mm_per_px=None, search=search, pool=pool)[0]


def compared(prior: Calibration, other: Seen, held: int, pool: Executor) -> str:
    """The other tip's table as Markdown: each row a mean over draws of the frames that are fitted."""
    known = known_models(prior.content)
    ways = {"alone": Search(Prefer.ACCURACY), "with the first tip": Search(Prefer.ACCURACY, known=known)}
    n = len(other.targets)
    orders = [np.random.default_rng(draw).permutation(n).tolist() for draw in range(DRAWS)]
    judges = [(other.targets.rows(order[:held]), other.extract.rows(order[:held])) for order in orders]
    drawn: dict[str, list[list[float | None]]] = {}
    drawn["first tip's, unchanged"] = [list(row(evaluate(prior, *judge))) for judge in judges]
    for size in (size for size in SIZES if size <= n - held):
        for way, search in ways.items():
            drawn[f"{size}, {way}"] = [
                errors(other, order[held : held + size], search, *judge, pool)
                for order, judge in zip(orders, judges, strict=True)
            ]
    means = {label: np.mean(np.array(found, float), axis=0) for label, found in drawn.items()}
    return table([(label, list(mean)) for label, mean in means.items()])  # NaN: not fitted in each draw


@click.command()
@click.option("--real", "on_real", is_flag=True, help="Published recordings of two tips.")
@click.option("--folder", type=click.Path(path_type=Path), default=REAL, help="Of the recordings.")
@click.option("--frames", "size", type=click.IntRange(24, 600), default=300, help="Of the first tip.")
@writes_results
@click.option("--workers", type=click.IntRange(min=1), help="Processes; default: one a core.")
def command(on_real: bool, folder: Path, size: int, out: Path, workers: int | None) -> None:
    """Errors on another tip with 10, 25, 50 frames: alone, and with a first tip's calibration."""
    lines = [f"# Another tip: fitted to few frames, alone and with a first tip's calibration ({size} frames)"]
    with executor(workers=workers) as pool:
        if on_real:
            binary = folder / TIP_331
            first = recorded(binary, binary / "rest.png", pool)
            others = {"the grey 331-pin set": recorded(folder / "tactip331_gray", None, pool)}
        else:
            first = simulated("first tip", FIRST, size, 1, pool)
            count = max(SIZES) + TEST
            others = {
                name: simulated(name, one, count, seed, pool)
                for seed, (name, one) in enumerate(OTHERS.items(), start=2)
            }
        rows = np.random.default_rng(0).permutation(len(first.targets))[:size].tolist()
        prior = fitted(first, rows, Search(kinds=frozenset({ModelKind.PROCESS})), pool)
        for name, other in others.items():
            lines.append(f"\n{name}\n\n{compared(prior, other, TEST_REAL if on_real else TEST, pool)}")
            click.echo(lines[-1])
    path = out / f"carry_over_{'real' if on_real else 'simulated'}.md"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
