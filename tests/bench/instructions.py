"""Instructions and cache misses of a frame, counted: `python -m tests.bench instructions [--json]`.

Time depends on the machine and its load; the number of instructions does not. Valgrind's callgrind (Debian
package valgrind) counts those frames of a recording that the program marks, with the caches of a small board:
neither its start nor its first frames.

Rules
- Frames are rendered beforehand and read from a file; garbage collection is off; one thread.
- A function belongs to the stage whose library holds it: C that is inlined into a kernel has no name of ours.
- BLAS, which only the start uses, computes without fused multiply-add: valgrind emulates it a hundred times
  slower.
"""

from __future__ import annotations

import collections
import json
import os
import platform
import re
import subprocess
import sys
from collections import defaultdict
from dataclasses import asdict, dataclass
from pathlib import Path

import click
import numpy as np
from rich.console import Console
from rich.table import Table

from tests.bench.compiled import compiled
from tests.bench.frames import NARROW, PINS, REST_FRAMES, SIZES, scene
from tests.bench.output import ROOT, writes_results

__all__ = ["Counter", "Counts", "command", "count", "count_child", "of_functions", "record", "stage_of"]

#: First-level instruction and data caches and the last level of a small board: bytes, ways, bytes of a line.
CACHES = ("--I1=49152,12,64", "--D1=32768,8,64", "--LL=1048576,16,64")
#: Scene of the simulator, frames before those that count, demand.
VARIANTS = {
    "contact": ("press", 10, "pipeline"),
    "no_contact": ("nothing", 0, "pipeline"),
    "grasp": ("press", 10, "grasp"),
}
#: Frames that warm the caches, and frames that count.
LENGTHS = {"pipeline": (8, 64), "grasp": (8, 64), "reference": (1, 3)}
TOP = 25  # functions in the table


@dataclass(frozen=True)
class Counts:
    """The cost of one frame.

    instructions, ll_misses  of everything
    functions                (stage, function) -> instructions
    """

    instructions: float
    ll_misses: float
    functions: dict[tuple[str, str], float]

    def stages(self) -> dict[str, float]:
        """Instructions of each stage; `interpreter, libraries` is everything outside of kernels."""
        total: defaultdict[str, float] = defaultdict(float)
        for (stage, _), n in self.functions.items():
            total[stage] += n
        return dict(sorted(total.items(), key=lambda item: -item[1]))


@dataclass(frozen=True)
class Cost:
    """The cost of a frame of so many pins, in an image of width and height `size_px`."""

    pins: int
    size_px: tuple[int, int]
    instructions: int


def count(kind: str, frames: Path, folder: Path, *, caches: bool = True) -> Counts:
    """Count one kind of work (see `instructions_child`) on a recording; caches as of `count_child`."""
    warm, counted = LENGTHS[kind]
    child = ["tests.bench.instructions_child", kind, str(frames), str(warm), str(counted)]
    return count_child(child, counted, folder / f"callgrind.{kind}", caches=caches)


def count_child(child: list[str], frames: int, out: Path, *, caches: bool = True) -> Counts:
    """Count what a module does between its marks (`Counter`).

    frames  that it processes between them
    out     where counts go
    caches  False: instructions alone, in a third of the time; no misses
    """
    simulated = ("--cache-sim=yes", *CACHES) if caches else ("--cache-sim=no",)
    plain = ("--compress-strings=no", "--compress-pos=no", "--instr-atstart=no", "--collect-atstart=no")
    command = ["valgrind", "--tool=callgrind", *simulated, *plain, f"--callgrind-out-file={out}"]
    env = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}
    env["OPENBLAS_CORETYPE"] = "Nehalem" if platform.machine() == "x86_64" else "ARMV8"
    env.pop("PYTHONDONTWRITEBYTECODE", None)  # compiling each import again takes minutes here
    done = subprocess.run(
        [*command, sys.executable, "-m", *child], cwd=ROOT, env=env, capture_output=True, text=True
    )
    if done.returncode:
        raise RuntimeError(f"{' '.join(child)}: {done.stderr[-2000:]}")
    counted, misses = of_functions(out)
    functions = {function: n / frames for function, n in counted.items()}
    return Counts(sum(functions.values()), misses / frames, functions)


class Counter:
    """Marks, within a program that `count_child` runs, what counts: `with counter: ...`.

    From its creation on caches are simulated, so that what comes before a mark warms them.
    """

    def __init__(self) -> None:
        self._library = compiled("counter.c")
        self._library.start()

    def __enter__(self) -> None:
        self._library.toggle()

    def __exit__(self, *_: object) -> None:
        self._library.toggle()


def record(
    variant: str,
    folder: Path,
    pins: int = 331,
    size_px: tuple[int, int] = (640, 480),
    radius_px: float = 0.0,
) -> Path:
    """The frames of a variant, rendered into a file; pins, size and radius as of `scene`."""
    name, skipped, _ = VARIANTS[variant]
    frames = scene(name, pins, size_px, radius_px)
    path = folder / f"{variant}.npz"
    np.savez(path, images=np.stack([frame.image for frame in frames]), contact=REST_FRAMES + skipped)
    return path


def scaling(variant: str, folder: Path) -> dict[str, list[Cost]]:
    """Instructions of a frame over the pins, and over the pixels around the same tip."""
    cases: dict[str, list[tuple[int, tuple[int, int], float]]] = {
        "pins": [(n, (640, 480), 0.0) for n in PINS],
        "pixels, same tip": [(331, size, NARROW) for size in SIZES],
    }
    out: dict[str, list[Cost]] = {}
    for name, cameras in cases.items():
        out[name] = []
        for pins, size, radius in cameras:
            frames = record(variant, folder, pins, size, radius)
            counts = count(VARIANTS[variant][2], frames, folder, caches=False)
            out[name].append(Cost(pins, size, round(counts.instructions)))
    return out


def of_functions(path: Path) -> tuple[collections.Counter[tuple[str, str]], int]:
    """Instructions of each function, by stage and name, and all last-level misses, of callgrind's output."""
    functions: collections.Counter[tuple[str, str]] = collections.Counter()
    events: list[str] = []
    misses = 0
    library = function = ""
    with path.open() as lines:
        for line in lines:
            if line.startswith("ob="):
                library = line[3:].strip()
            elif line.startswith("fn="):
                function = line[3:].strip()
            elif line.startswith("events:"):
                events = line.split()[1:]
            elif line.startswith("calls="):
                next(lines)  # the cost of what is called, which that function has itself
            elif line[0].isdigit():
                counts = dict(zip(events, map(int, line.split()[1:]), strict=False))
                functions[stage_of(library, function)] += counts.get("Ir", 0)
                misses += sum(counts.get(kind, 0) for kind in ("ILmr", "DLmr", "DLmw"))
    return functions, misses


def stage_of(library: str, symbol: str) -> tuple[str, str]:
    """Stage and name of a symbol of a library: in edge/cells/mesh.so __pyx_f_4edge_5cells_4mesh_4Mesh__sweep
    is cells, mesh.Mesh._sweep.
    """
    of = re.search(r"/edge/(?:([a-z_]+)/)?([a-z_]+)\.[^/]*so$", library)
    if not of:
        return "interpreter, libraries", symbol
    stage, module = of[1] or "edge", of[2]
    rest, parts = re.sub(r"^__pyx_[a-z]+_(?=\d)", "", symbol), list[str]()
    while (piece := re.match(r"(\d+)", rest)) and len(parts) < 4:
        size = int(piece[1])
        parts.append(rest[piece.end() : piece.end() + size])
        rest = rest[piece.end() + size :].removeprefix("_")
    rest = rest.lstrip("0123456789")  # Cython's number of a method
    named = [*parts[2:], rest] if parts[:1] == ["edge"] else [module, symbol]
    return stage, ".".join(name for name in named if name)


@click.command("instructions")
@click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout, nothing else.")
@click.option("--variant", type=click.Choice(list(VARIANTS)), default="contact", show_default=True)
@click.option("--reference/--no-reference", default=True, help="Count the paper's method, too.")
@click.option("--growth", "grows", is_flag=True, help="Count over pins and over pixels, instructions alone.")
@writes_results
def command(as_json: bool, variant: str, reference: bool, grows: bool, out: Path) -> None:
    """Instructions and last-level cache misses of a frame of 331 pins, by stage and function."""
    folder = ROOT / "out" / "instructions"
    folder.mkdir(parents=True, exist_ok=True)
    if grows:
        costs = scaling(variant, folder)
        plain = {name: [asdict(row) for row in rows] for name, rows in costs.items()}
        (out / f"growth_{variant}.json").write_text(json.dumps(plain, indent=1) + "\n")
        if as_json:
            click.echo(json.dumps(plain))
        else:
            show_scaling(costs)
        return
    frames = record(variant, folder)
    counts = count(VARIANTS[variant][2], frames, folder)
    result: dict[str, object] = {
        "variant": variant,
        "instructions_331": round(counts.instructions),
        "ll_misses_331": round(counts.ll_misses),
    }
    if reference:
        of_reference = count("reference", frames, folder)
        result["reference_instructions_331"] = round(of_reference.instructions)
        result["reference_ll_misses_331"] = round(of_reference.ll_misses)
    top = sorted(counts.functions.items(), key=lambda item: -item[1])[:TOP]
    result["stages"] = {stage: round(n) for stage, n in counts.stages().items()}
    result["functions"] = [[*name, round(n)] for name, n in top]
    (out / f"instructions_{variant}.json").write_text(json.dumps(result, indent=1) + "\n")
    if as_json:
        click.echo(json.dumps(result))
    else:
        show(result)


def show(result: dict[str, object]) -> None:
    """Tables on the terminal."""
    console = Console()
    whole = Table("a frame", "count", title=f"331 pins, {result['variant']}")
    for name, n in result.items():
        if isinstance(n, int):
            whole.add_row(name, f"{n:,}")
    stages, functions = result["stages"], result["functions"]
    assert isinstance(stages, dict)
    assert isinstance(functions, list)
    table = Table("stage", "function", "instructions")
    for stage, n in stages.items():
        table.add_row(stage, "", f"{n:,}")
    for stage, function, n in functions:
        table.add_row(stage, function[:70], f"{n:,}")
    console.print(whole, table)


def show_scaling(costs: dict[str, list[Cost]]) -> None:
    """Tables on the terminal."""
    for name, rows in costs.items():
        table = Table("pins", "pixels", "instructions a frame", title=f"growth with {name}")
        for row in rows:
            table.add_row(str(row.pins), "x".join(map(str, row.size_px)), f"{row.instructions:,}")
        Console().print(table)
