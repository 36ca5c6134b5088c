"""Numerical-stability report: every hard case of the tessellation, its error, its bound, a verdict.

The truth is rational arithmetic (`tests.support.exact`), a triangulation from scratch, or an invariance.
Everything comes from seeds; the table is the same on every run, the times are not.
"""

from __future__ import annotations

import csv
import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.spatial import Delaunay, Voronoi

from edge.cells import Tessellator, cell_polygons
from edge.cells.mesh import Mesh
from edge.types import Cells
from tests.bench.output import writes_results
from tests.support import exact
from tests.support.cell_checks import (
    Points,
    bounded_polygon_area,
    points_of,
    polygon_area,
    random_walks,
    worst_relative,
)
from tests.support.layouts import HARD_SETS, TIPS, bounded, hexagonal, moved, pressed, rest_of, tracks_of

SCALES = (1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9)
OFFSETS = (0.0, 1e6)
WALK_STEPS = 10
WALKS_AT_ONCE = 100


@dataclass(frozen=True)
class Row:
    """One line of the table. The case holds if error <= bound."""

    case: str
    measured: str
    error: float
    bound: float

    @property
    def holds(self) -> bool:
        return bool(self.error <= self.bound)


def cells_of(rest: Points, now: Points) -> Cells:
    return Tessellator(rest_of(rest)).cells(tracks_of(now))


def hard_sets(seeds: int) -> Iterator[Row]:
    """Each hard set at every scale and offset, against rational arithmetic."""
    for name, make in HARD_SETS.items():
        worst = 0.0
        for seed in range(seeds):
            pins = make(np.random.default_rng(seed))
            n = len(pins)
            for scale in SCALES:
                for offset in OFFSETS:
                    points = bounded(pins) * scale + offset * np.array([1.0, -0.7])
                    areas = np.empty(n)
                    Mesh(n, len(points) - n).update(points, areas)
                    worst = max(worst, float(exact.relative_errors(areas, exact.cell_areas(points, n)).max()))
        yield Row(
            f"{name}, scales 1e-9..1e9, offsets 0 and 1e6", "area against rational arithmetic", worst, 1e-10
        )


def degenerate_motion(seeds: int) -> Iterator[Row]:
    """Pins that jump about on a coarse grid: cocircular, collinear, merged and parted in every frame."""
    worst = 0.0
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        mesh = Mesh(20, 40)
        for _ in range(10):
            points = bounded(rng.integers(-4, 5, (20, 2)) / 6.0)
            areas = np.empty(20)
            mesh.update(points, areas)
            worst = max(worst, float(exact.relative_errors(areas, exact.cell_areas(points, 20)).max()))
    yield Row("20 pins jumping on a 9x9 grid, kept mesh", "area against rational arithmetic", worst, 1e-10)


def through_a_circle(seeds: int) -> Iterator[Row]:
    """Four pins pass through a common circle in steps of 1e-15."""
    worst = 0.0
    for seed in range(seeds):
        angle = np.sort(np.random.default_rng(seed).uniform(0, 2 * np.pi, 4))
        base = 0.5 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        mesh, rows = Mesh(4, 40), []
        for k in range(-50, 51):
            pins = base.copy()
            pins[2] *= 1 + k * 1e-15
            areas = np.empty(4)
            mesh.update(bounded(pins), areas)
            rows.append(areas)
        worst = max(worst, float((np.abs(np.diff(rows, axis=0)) / rows[0]).max()))
    yield Row("4 pins through a common circle, steps of 1e-15", "largest step of an area", worst, 1e-12)


def tips() -> Iterator[Row]:
    """Whole tips, at rest and pressed: areas, sum, drawings, invariances."""
    for name, make in TIPS.items():
        rest = make()
        now = pressed(rest)
        for state, xy in (("at rest", rest), ("pressed", now)):
            cells = cells_of(rest, xy)
            error = exact.relative_errors(cells.area_px2, exact.cell_areas(points_of(cells), len(rest))).max()
            yield Row(f"{name} tip, {state}", "area against rational arithmetic", float(error), 1e-10)
            polygon = float(bounded_polygon_area(cells))
            yield Row(
                f"{name} tip, {state}",
                "sum of areas against the bounded polygon",
                abs(float(cells.area_px2.sum()) - polygon) / polygon,
                1e-12,
            )
        cells = cells_of(rest, now)
        drawn = np.array([polygon_area(p) for p in cell_polygons(cells)])
        yield Row(
            f"{name} tip, pressed",
            "drawn polygons against areas",
            worst_relative(drawn, cells.area_px2),
            1e-9,
        )
        order = np.random.default_rng(0).permutation(len(rest))
        error = worst_relative(cells_of(rest[order], now[order]).area_px2, cells.area_px2[order])
        yield Row(f"{name} tip, pressed", "pins in another order", error, 1e-10)
        changes = [("image turned by 1 rad", 1.0, 1.0, 0.0), ("image shifted by 1e6 px", 0.0, 1.0, 1e6)]
        changes += [(f"image scaled by {s:g}", 0.0, s, 0.0) for s in (1e-9, 1e9)]
        for what, angle, scale, shift in changes:
            other = cells_of(moved(rest, angle, scale, shift), moved(now, angle, scale, shift))
            error = worst_relative(other.area_px2, cells.area_px2 * scale**2)
            yield Row(f"{name} tip, pressed", what, error, 1e-10)
        turned = cells_of(rest, moved(rest, 0.3, 1.05, 20.0))
        error = worst_relative(turned.area_px2, turned.rest_area_px2 * 1.05**2)
        yield Row(
            f"{name} tip, turned, scaled, shifted", "area change against the scale's square", error, 1e-10
        )


def lost_pins(seeds: int) -> Iterator[Row]:
    """Pins that blink: at rest nothing changes, under load the neighbours hardly notice."""
    for name, make in TIPS.items():
        rest = make()
        now = pressed(rest)
        tessellator = Tessellator(rest_of(rest))
        whole = tessellator.cells(tracks_of(now)).area_px2
        signal = np.abs(whole / tessellator.rest_area_px2 - 1).max()
        still, loaded = 0.0, 0.0
        for seed in range(seeds):
            lost = np.random.default_rng(seed).random(len(rest)) < 0.3
            cells = tessellator.cells(tracks_of(np.where(lost[:, None], np.nan, rest)))
            still = max(still, float(np.nanmax(np.abs(cells.area_px2 / cells.rest_area_px2 - 1))))
            lost = np.random.default_rng(seed).random(len(rest)) < 0.05
            cells = tessellator.cells(tracks_of(np.where(lost[:, None], np.nan, now)))
            error = np.abs(cells.area_px2 - whole)[~lost] / cells.rest_area_px2[~lost]
            loaded = max(loaded, float(error.max() / signal))
        yield Row(f"{name} tip at rest, 30 % of the pins lost", "area change of the others", still, 1e-10)
        yield Row(
            f"{name} tip pressed, 5 % of the pins lost",
            "area change that this adds, over the largest signal",
            loaded,
            0.1,
        )


def walks(count: int) -> Iterator[Row]:
    """331 pins on random walks through flips, against fresh triangulations and against the motion."""
    difference = share = 0.0
    flips = builds = 0
    for seed in track(range(-(-count // WALKS_AT_ONCE)), description="walks", transient=True):
        some = random_walks(min(WALKS_AT_ONCE, count - seed * WALKS_AT_ONCE), WALK_STEPS, 0.5, seed)
        difference, share = max(difference, some.worst_difference), max(share, some.worst_share)
        flips, builds = flips + some.flips, builds + some.builds
    case = f"{count} walks of 331 pins, {WALK_STEPS} steps of 0.5 px, {flips} flips, {builds} rebuilds"
    yield Row(case, "kept against fresh triangulation", difference, 1e-10)
    yield Row(case, "largest area change over what the motion explains", share, 1.0)
    jumps = random_walks(max(1, count // 20), WALK_STEPS, 6.0, seed=0, explain=False)
    case = (
        f"{jumps.walks} walks of 331 pins, {WALK_STEPS} steps of 6 px, {jumps.flips} flips, "
        f"{jumps.builds} rebuilds"
    )
    yield Row(case, "kept against fresh triangulation", jumps.worst_difference, 1e-10)


def median_us(call: Callable[[], object], repeats: int) -> float:
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return 1e6 * statistics.median(times)


def cost() -> list[tuple[str, float]]:
    """Median time of a call in us, 331 pins: (what, us)."""
    rest = hexagonal()
    now = rest + np.random.default_rng(0).normal(0, 1.0, rest.shape)
    tessellator = Tessellator(rest_of(rest))
    still = tracks_of(now)
    points = points_of(tessellator.cells(still))
    n = len(rest)
    frames = [tracks_of(now + np.random.default_rng(k).normal(0, 0.3, rest.shape)) for k in range(64)]
    endless = iter(frames * 40)
    hidden = now.copy()
    hidden[::20] = np.nan
    blinking = tracks_of(hidden)
    areas = np.empty(n)
    kept = [
        ("Tessellator.cells, nothing flips", median_us(lambda: tessellator.cells(still), 2000)),
        ("Tessellator.cells, 0.3 px noise, flips", median_us(lambda: tessellator.cells(next(endless)), 2000)),
        ("Tessellator.cells, 17 pins lost", median_us(lambda: tessellator.cells(blinking), 500)),
    ]
    return [
        *kept,
        ("Mesh from nothing", median_us(lambda: Mesh(n, len(points) - n).update(points, areas), 300)),
        ("scipy.spatial.Delaunay", median_us(lambda: Delaunay(points), 200)),
        ("scipy.spatial.Voronoi", median_us(lambda: Voronoi(points), 200)),
    ]


def write(rows: list[Row], costs: list[tuple[str, float]], folder: Path) -> None:
    """The table as stability.csv and stability.md."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "stability.csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["case", "measured", "error", "bound", "verdict"])
        writer.writerows(
            [r.case, r.measured, f"{r.error:.2e}", f"{r.bound:.0e}", "holds" if r.holds else "FAILS"]
            for r in rows
        )
    lines = [
        "# Numerical stability of the tessellation",
        "",
        "Made by `python -m tests.bench stability`. Errors are relative, the worst of all pins and seeds.",
        "",
        "| case | measured | error | bound | verdict |",
        "|---|---|---|---|---|",
        *(
            f"| {r.case} | {r.measured} | {r.error:.1e} | {r.bound:.0e} | "
            f"{'holds' if r.holds else '**FAILS**'} |"
            for r in rows
        ),
        "",
        "Cost in the same run, 331 pins with their boundary, median of one call:",
        "",
        "| call | us | of scipy's Voronoi |",
        "|---|---|---|",
        *(f"| {what} | {us:.0f} | 1/{costs[-1][1] / us:.0f} |" for what, us in costs),
        "",
    ]
    (folder / "stability.md").write_text("\n".join(lines))


@click.command(name="stability", help="Hard cases of the geometry against exact arithmetic.")
@click.option("--walks", "n_walks", default=10_000, show_default=True, help="Random walks of 331 pins.")
@click.option("--seeds", default=10, show_default=True, help="Random sets of each kind.")
@writes_results
def command(n_walks: int, seeds: int, out: Path) -> None:
    """Exit code 1 if a case fails."""
    console = Console()
    rows: list[Row] = []
    for part in (
        hard_sets(seeds),
        degenerate_motion(seeds),
        through_a_circle(seeds),
        tips(),
        lost_pins(seeds),
        walks(n_walks),
    ):
        rows.extend(part)
    costs = cost()
    table = Table("case", "measured", "error", "bound", "verdict")
    for r in rows:
        verdict = "[green]holds" if r.holds else "[red]FAILS"
        table.add_row(r.case, r.measured, f"{r.error:.1e}", f"{r.bound:.0e}", verdict)
    console.print(table)
    for what, us in costs:
        console.print(f"{what:42s} {us:8.0f} us")
    write(rows, costs, out)
    failed = sum(not r.holds for r in rows)
    console.print(f"{len(rows) - failed} of {len(rows)} cases hold; written to {out}")
    if failed:
        raise SystemExit(1)
