"""Numerical-stability report: every hard case of the tessellation, its error, its bound, a verdict.

The truth is rational arithmetic (`tests.support.exact`), a triangulation from scratch, or an invariance.
Everything comes from seeds; the table is the same on every run.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
from rich.progress import track

from edge.cells import Tessellator, cell_polygons
from edge.cells.mesh import Mesh
from edge.types import Cells
from tests.bench.output import markdown, show, writes_results
from tests.support import exact
from tests.support.cell_checks import Points, points_of, polygon_area, random_walks, worst_relative
from tests.support.layouts import HARD_SETS, TIPS, bounded, moved, pressed, rest_of, tracks_of

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


def worst_error(areas: Points, points: Points) -> float:
    """Largest relative error of the areas of the first points, exactly."""
    return float(exact.relative_errors(areas, exact.cell_areas(points, len(areas))).max())


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
                    worst = max(worst, worst_error(areas, points))
        case = f"{name}, scales 1e-9..1e9, offsets 0 and 1e6"
        yield Row(case, "area against rational arithmetic", worst, 1e-13)


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
    """Whole tips, at rest and pressed: areas, drawings, invariances."""
    for name, make in TIPS.items():
        rest = make()
        now = pressed(rest)
        for state, xy in (("at rest", rest), ("pressed", now)):
            cells = cells_of(rest, xy)
            error = worst_error(cells.area_px2, points_of(cells))
            yield Row(f"{name} tip, {state}", "area against rational arithmetic", error, 1e-13)
        cells = cells_of(rest, now)
        drawn = np.array([polygon_area(p) for p in cell_polygons(cells)])
        error = worst_relative(drawn, cells.area_px2)
        yield Row(f"{name} tip, pressed", "drawn polygons against areas", error, 1e-9)
        order = np.random.default_rng(0).permutation(len(rest))
        error = worst_relative(cells_of(rest[order], now[order]).area_px2, cells.area_px2[order])
        yield Row(f"{name} tip, pressed", "pins in another order", error, 1e-10)
        changes = [("image turned by 1 rad", 1.0, 1.0, 0.0), ("image shifted by 1e6 px", 0.0, 1.0, 1e6)]
        changes += [(f"image scaled by {s:g}", 0.0, s, 0.0) for s in (1e-9, 1e-3, 1e9)]
        for what, angle, scale, shift in changes:
            other = cells_of(moved(rest, angle, scale, shift), moved(now, angle, scale, shift))
            error = worst_relative(other.area_px2, cells.area_px2 * scale**2)
            yield Row(f"{name} tip, pressed", what, error, 1e-10)
        turned = cells_of(rest, moved(rest, 0.3, 1.05, 20.0))
        error = worst_relative(turned.area_px2, turned.rest_area_px2 * 1.05**2)
        case = f"{name} tip, turned, scaled, shifted"
        yield Row(case, "area change against the scale's square", error, 1e-10)


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
        yield Row(f"{name} tip at rest, 30 % of the pins lost", "area change of the others", still, 1e-12)
        case = f"{name} tip pressed, 5 % of the pins lost"
        yield Row(case, "area change that this adds, over the largest signal", loaded, 0.1)


def walks(count: int) -> Iterator[Row]:
    """331 pins on random walks through flips, against fresh triangulations."""
    difference, flips, builds = 0.0, 0, 0
    for seed in track(range(-(-count // WALKS_AT_ONCE)), description="walks", transient=True):
        some = random_walks(min(WALKS_AT_ONCE, count - seed * WALKS_AT_ONCE), WALK_STEPS, 0.5, seed)
        difference = max(difference, some.worst_difference)
        flips, builds = flips + some.flips, builds + some.builds
    case = f"{count} walks of 331 pins, {WALK_STEPS} steps of 0.5 px, {flips} flips, {builds} rebuilds"
    yield Row(case, "kept against fresh triangulation", difference, 1e-12)
    jumps = random_walks(max(1, count // 20), WALK_STEPS, 6.0, seed=0)
    counts = f"{jumps.flips} flips, {jumps.builds} rebuilds"
    case = f"{jumps.walks} walks of 331 pins, {WALK_STEPS} steps of 6 px, {counts}"
    yield Row(case, "kept against fresh triangulation", jumps.worst_difference, 1e-12)


@click.command(name="stability", help="Hard cases of the geometry against exact arithmetic.")
@click.option("--walks", "n_walks", default=10_000, show_default=True, help="Random walks of 331 pins.")
@click.option("--seeds", default=10, show_default=True, help="Random sets of each kind.")
@writes_results
def command(n_walks: int, seeds: int, out: Path) -> None:
    """Exit code 1 if a case fails."""
    parts = hard_sets(seeds), through_a_circle(seeds), tips(), lost_pins(seeds), walks(n_walks)
    rows = [row for part in parts for row in part]
    failed = sum(not row.holds for row in rows)
    cells: list[dict[str, object]] = [
        {
            "case": row.case, "measured": row.measured, "error": f"{row.error:.1e}",
            "bound": f"{row.bound:.0e}", "verdict": "holds" if row.holds else "FAILS",
        }
        for row in rows
    ]  # fmt: skip
    show(cells, f"{len(rows) - failed} of {len(rows)} cases hold")
    (out / "stability.md").write_text(
        "# Numerical stability of the tessellation\n\n"
        "Made by `python -m tests.bench stability`. Errors are relative, the worst of all pins and seeds.\n\n"
        f"{markdown(cells)}\n"
    )
    if failed:
        raise SystemExit(1)
