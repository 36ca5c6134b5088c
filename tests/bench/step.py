"""One step of the loop, counted from the image to the CAN FD frame: `python -m tests.bench step [--json]`.

Four steps of a tip with 331 pins in an image of 640x480: in contact, without, with two contacts, and in
contact with displacement and shear alone. Counted are instructions of all threads, misses of a small board's
last-level cache, calls of our own Python functions and calls from Python into our compiled ones.
`tests.bench.counter` says how, `tests.bench.step_child` what.

The images repeat after ten frames, and so does the focus; noise is learnt from one of seven untouched frames,
after the first 64. The mean does not depend on where it begins.
"""

import json
import os
import platform
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np

from calib.sim.script import REST_FRAMES
from edge.cells.missing import LostPins
from edge.config import FeaturesTable
from edge.frame import Pipeline
from edge.pins import take_rest
from edge.pins.detect import detect
from edge.tracking.tracker import Tracker
from edge.types import Feature
from tests.bench.arm64 import Board
from tests.bench.counter import ENVIRONMENT, Counts, counted, run
from tests.bench.frames import GRASP, calibration_of, scene
from tests.bench.output import show, write_json, writes_results

Size = tuple[int, int]  # of an image, px


@dataclass(frozen=True)
class Variant:
    """Frames of the simulator, and what is computed.

    skipped  frames after the tip was untouched that do not count
    """

    scene: str
    skipped: int
    demand: frozenset[Feature] = frozenset(FeaturesTable().demand)


VARIANTS = {
    "contact": Variant("press", 10),
    "no_contact": Variant("nothing", 0),
    "two": Variant("two", 10),
    "grasp": Variant("press", 10, GRASP),
}


class BoardModel(NamedTuple):
    """What a board's processor is taken to do; no board was measured.

    per_cycle  instructions that it usually completes in a cycle of code like this
    miss_ns    time of a miss of its last-level cache
    """

    board: str
    cores: int
    ghz: float
    per_cycle: float
    miss_ns: float

    def step_s(self, instructions: float, misses: float) -> float:
        """Time of one step on one core."""
        return instructions / self.per_cycle / self.ghz * 1e-9 + misses * self.miss_ns * 1e-9

    def fingers(self, step_s: float, rate_hz: int) -> int:
        """How many fingers keep the board's cores busy for less than BUSY of their time."""
        return self.cores * int(BUSY / (step_s * rate_hz))


BOARDS = (
    BoardModel("Cortex-A53 at 1.4 GHz (Raspberry Pi 3B+, Zero 2 W)", 4, 1.4, 0.6, 150.0),
    BoardModel("Cortex-A72 at 1.5 GHz (Raspberry Pi 4)", 4, 1.5, 1.1, 130.0),
    BoardModel("Cortex-A76 at 2.4 GHz (Raspberry Pi 5)", 4, 2.4, 1.8, 110.0),
)
BUSY = 0.7  # the rest is the camera's driver, the network and other programs
RATES_HZ = (60, 120, 240, 500, 1000)
IMAGES = 6  # that are shown forwards and backwards
WARM, COUNTED = 80, 70
#: Only a start uses OpenCV; valgrind takes a hundred times as long for its fused multiply-add.
PLAIN_START = ENVIRONMENT | {"OPENCV_CPU_DISABLE": "AVX2,FMA3"}
MACHINES = ("x86_64", "aarch64")


class Step:
    """The frames of one variant in files in an empty folder, and what is counted of them."""

    def __init__(self, variant: Variant, folder: Path, pins: int = 331, size_px: Size = (640, 480)) -> None:
        self._folder = folder
        frames = scene(variant.scene, pins, size_px)
        first = REST_FRAMES + variant.skipped
        images, calibration = folder / "images.npz", folder / "tip.json"
        np.savez(
            images, images=np.stack([frame.image for frame in frames[: first + IMAGES]]), first=first,
            warm=WARM, counted=COUNTED, features=sorted(variant.demand),
        )  # fmt: skip
        calibration_of(frames).save(calibration)
        self.inputs = [str(images), str(calibration)]
        self._child = ["tests.bench.step_child", *self.inputs]

    def native(self) -> Counts:
        """Instructions and misses on this machine."""
        return counted([*self._child, "instructions"], COUNTED, self._folder, environment=PLAIN_START)

    def emulated(self, board: Board) -> Counts:
        """Instructions on an emulated board."""
        return board.counted([*self._child, "instructions"], COUNTED, self._folder)

    def calls(self) -> dict[str, dict[str, float]]:
        """Calls of a frame, by function: `python` ours, `kernel` those that are compiled."""
        printed = json.loads(run([sys.executable, "-m", *self._child, "calls"], ENVIRONMENT))
        return {kind: {name: n / COUNTED for name, n in found.items()} for kind, found in printed.items()}


def measure(name: str, board: Board | None, pins: int, size_px: Size) -> dict[str, Any]:
    """The figures of one variant, on this machine and on an emulated board."""
    with tempfile.TemporaryDirectory() as folder:
        step = Step(VARIANTS[name], Path(folder), pins, size_px)
        counts = {platform.machine(): step.native()}
        calls = step.calls()
        if board is not None:
            counts["aarch64"] = step.emulated(board)
    native = counts[platform.machine()]
    return {
        **{machine: counts[machine].instructions if machine in counts else None for machine in MACHINES},
        "libraries": {machine: found.libraries for machine, found in counts.items()},
        "ll_misses": round(native.ll_misses),
        **{f"{kind}_calls": round(sum(found.values())) for kind, found in calls.items()},
        "counts": counts,
        "calls": calls,
    }


@click.command("step")
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout, nothing else.")
@click.option("--top", type=click.IntRange(min=0), default=0, help="Show so many functions, parts and calls.")
@click.option("--arch", type=click.Choice(["arm64"]), help="Count on an emulated board, too.")
@click.option("--start", is_flag=True, help="Count a start instead, to the first values.")
@click.option("--once", is_flag=True, help="Time instead what is done once: a search, the tables.")
@click.option("--rings", default=10, show_default=True, type=click.IntRange(2, 31), help="Of pins.")
@click.option(
    "--size", "size_px", default=(640, 480), show_default=True, type=(int, int), help="Of the image."
)
@writes_results
def command(
    as_json: bool, top: int, arch: str | None, start: bool, once: bool, rings: int, size_px: Size, out: Path
) -> None:
    """Instructions, cache misses and calls of one step of the loop, from the image to the CAN FD frame."""
    pins = 1 + 3 * rings * (rings + 1)
    if once:
        click.echo(json.dumps(once_of(pins, size_px)))
        return
    workers = ThreadPoolExecutor(len(os.sched_getaffinity(0)))  # they wait for valgrind alone
    with tempfile.TemporaryDirectory() as folder, workers as pool:
        board = Board(Path(folder)) if arch else None
        if start:
            write_json(out / "start.json", found_start := start_of(Path(folder), board))
            click.echo(json.dumps(found_start))
            return
        found = dict(
            zip(VARIANTS, pool.map(lambda name: measure(name, board, pins, size_px), VARIANTS), strict=True)
        )
    details = {name: {kind: row.pop(kind) for kind in ("counts", "calls")} for name, row in found.items()}
    result = {f"step_{name}": row for name, row in found.items()}
    write_json(out / "step.json", result)
    if as_json:
        click.echo(json.dumps(result))
    else:
        show_steps(found, f"{pins} pins at {size_px[0]}x{size_px[1]}, from the image to the CAN FD frame")
        if arch:
            show_boards(found["contact"])
        for name in found if top else ():
            show_top(name, details[name], top)


def once_of(pins: int, size_px: Size) -> dict[str, float]:
    """Processor time in ms of the search of all pins, the tables, and the first lost pin's rows of them."""
    frames = scene("press", pins, size_px)
    rest = take_rest([frame.image for frame in frames[:REST_FRAMES]])
    blobs = detect(frames[REST_FRAMES + 10].image, rest.pattern)
    pipeline, tracker, lost = Pipeline(rest), Tracker(rest), LostPins(rest.xy_img, rest.pattern.pitch_px)
    works: dict[str, Callable[[], object]] = {
        "search": lambda: tracker.identify(blobs),
        "tables": lambda: pipeline.prepare(frozenset(FeaturesTable().demand)),
        "of these, of lost pins": lambda: lost.precision,
        "first lost pin": lambda: lost.update(np.arange(len(rest)) > 0),
    }
    found = {"pins": float(len(rest))}
    for name, work in works.items():
        begun_s = time.process_time()
        work()
        found[name] = round(1e3 * (time.process_time() - begun_s), 1)
    return found


def start_of(folder: Path, board: Board | None) -> dict[str, int]:
    """Instructions of `tests.bench.start_child`, which runs once before, so that bytecode is there."""
    child = ["tests.bench.start_child", *Step(VARIANTS["contact"], folder).inputs]
    for _ in range(2):
        found = {platform.machine(): counted(child, 1, folder / "own", environment=PLAIN_START).instructions}
        if board is not None:
            found["aarch64"] = board.counted(child, 1, folder).instructions
    return found


def show_steps(found: dict[str, dict[str, Any]], title: str) -> None:
    """A row for each variant."""
    show(
        [
            {
                "a step": name,
                **{f"instructions, {machine}": row[machine] for machine in row["libraries"]},
                **{f"interpreter, libraries, {machine}": n for machine, n in row["libraries"].items()},
                **{key: row[key] for key in ("ll_misses", "python_calls", "kernel_calls")},
            }
            for name, row in found.items()
        ],
        title,
    )


def show_boards(contact: dict[str, Any]) -> None:
    """The time of a step in contact, and how many fingers run at once, by the model of each board."""
    rows = []
    for board in BOARDS:
        step_s = board.step_s(contact["aarch64"], contact["ll_misses"])
        fingers = {f"{rate_hz} Hz": board.fingers(step_s, rate_hz) for rate_hz in RATES_HZ}
        rows.append({"model of": board.board, "ms a step": round(1e3 * step_s, 2), **fingers})
    show(rows, f"fingers in contact at once, by a model; cores busy for at most {BUSY:.0%} of the time")


def show_top(name: str, details: dict[str, Any], top: int) -> None:
    """The parts, functions and calls that count most."""
    for machine, counts in details["counts"].items():
        parts = [("", part, n) for part, n in list(counts.parts().items())[:top]]
        parts += [(f[:70], part, n) for (part, f), n in Counter(counts.functions).most_common(top)]
        rows = [{"part": part, "function": f, "instructions": round(n)} for f, part, n in parts]
        show(rows, f"{name}, {machine}")
    for kind, calls in details["calls"].items():
        rows = [{"function": f, f"{kind} calls": n} for f, n in Counter(calls).most_common(top)]
        show(rows, name)
