"""The report's pictures: PNG, as large as the page shows them, units on every axis."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

from calib.report.study import Row
from edge.types import Array, Complex, Mask
from hostlink.output_file import writing

matplotlib.use("Agg")
from matplotlib import pyplot as plt

DPI = 110
INK, TRUE, LINE, MARK = "#20242c", "#9aa3b2", "#1f6feb", "#d1495b"
plt.rcParams.update(
    {
        "font.size": 9.5,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.edgecolor": "#8a93a3",
        "axes.grid": True,
        "grid.color": "#e6e9ee",
        "axes.axisbelow": True,
        "text.color": INK,
        "axes.labelcolor": INK,
    }
)


def _save(figure: Any, path: Path) -> None:
    with writing(path, overwrite=True) as unfinished:
        figure.savefig(unfinished, dpi=DPI, bbox_inches="tight")
    plt.close(figure)


def curves(
    path: Path, volume: Array, depth: Array, knots: Array, motion_px: Array, shear: Array
) -> dict[str, float]:
    """The paper's two calibration curves (Fig. 10): sensor output over the rig's motion.

    volume     (n,) share of the tip's disc; depth (n,) mm
    knots      (k, 2) volume, depth: the monotone curve
    motion_px  (m,) px, size of the mean motion; shear (m,) mm
    Returns    the line's slope px/mm, its offset px without the unsheared frames, and the mean of those
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4))
    left.plot(depth, 100 * volume, ".", color=TRUE, ms=4, label="frames")
    left.plot(knots[:, 1], 100 * knots[:, 0], "-", color=LINE, lw=1.8, label="monotone curve")
    left.set(xlabel="displacement of the rig, mm", ylabel="volume of deformation, % of the tip's disc")
    left.set_title("Displacement", loc="left")
    left.legend(frameon=False)
    moved = shear > 1e-6
    slope, offset = np.polyfit(shear[moved], motion_px[moved], 1)
    line = np.array([0.0, float(shear.max())])
    right.plot(shear, motion_px, ".", color=TRUE, ms=4, label="frames")
    right.plot(
        line, slope * line + offset, "-", color=LINE, lw=1.8, label=f"{slope:.2f} px/mm, {offset:+.2f} px"
    )
    right.set(xlabel="shear of the rig, mm", ylabel="mean motion of the pins, px")
    right.set_title("Shear", loc="left")
    right.legend(frameon=False)
    _save(figure, path)
    return {
        "slope_px_per_mm": float(slope),
        "offset_px": float(offset),
        "at_rest_px": float(motion_px[~moved].mean()) if (~moved).any() else math.nan,
    }


def directions(path: Path, true: Complex, read: Complex) -> float:
    """Inferred against true direction (Fig. 11), and the error, of complex shears.

    Returns  the mean error, deg
    """
    off = np.degrees(np.angle(read * true.conj()))
    angle = np.degrees(np.angle(true)) % 360.0
    figure = plt.figure(figsize=(10, 4.2))
    round_: Any = figure.add_subplot(1, 2, 1, projection="polar")
    round_.plot(np.angle(true), np.abs(true), "o", mfc="none", mec=TRUE, ms=8, label="rig")
    round_.plot(np.angle(read), np.abs(read), ".", color=LINE, ms=4, label="read")
    round_.set_title("Shear, circles every 0.5 mm", loc="left")
    round_.set_rticks(np.arange(0.5, float(np.abs(true).max()) + 0.3, 0.5))
    round_.set_yticklabels([])
    round_.legend(frameon=False, loc="lower left", bbox_to_anchor=(-0.15, -0.1))
    flat = figure.add_subplot(1, 2, 2)
    flat.axhline(0.0, color=TRUE, lw=1)
    flat.plot(angle, off, ".", color=LINE, ms=4)
    flat.set(xlabel="true direction, deg", ylabel="error, deg", xticks=range(0, 361, 60))
    flat.set_title(f"Error: {np.abs(off).mean():.3f} deg in the mean (paper: 2.3)", loc="left")
    figure.subplots_adjust(wspace=0.3)
    _save(figure, path)
    return float(np.abs(off).mean())


def place_map(path: Path, true: Complex, raw: Complex, read: Complex) -> None:
    """Error of the place of a single contact over the tip, before and after calibration; (n,) complex mm."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4.4), sharey=True)
    top = float(np.nanmax(np.abs(raw - true)))
    for axis, at, name in ((axes[0], raw, "scale alone"), (axes[1], read, "calibrated")):
        off = at - true
        shown = axis.scatter(true.real, true.imag, c=np.abs(off), s=70, cmap="YlOrRd", vmin=0.0, vmax=top)
        axis.quiver(
            true.real, true.imag, off.real, off.imag,
            angles="xy", scale_units="xy", scale=0.25, width=0.004, color=INK,
        )  # fmt: skip
        axis.set_title(f"{name}: {np.nanmean(np.abs(off)):.3f} mm in the mean", loc="left")
        axis.set(xlabel="x, mm", aspect="equal")
    axes[0].set(ylabel="y, mm (down in the image)")
    axes[0].invert_yaxis()
    figure.colorbar(shown, ax=axes, label="error, mm (arrows: four times as long)", shrink=0.85)
    _save(figure, path)


def apart(path: Path, rows: list[tuple[float, float, float, float]]) -> None:
    """Share of pairs of probes found as one, two, more, over their distance; rows of `pairs.shares`."""
    distance, *found = np.array(rows).T
    figure, axes = plt.subplots(figsize=(6, 3.6))
    for share, name in zip(found, ("one", "two", "more"), strict=True):
        axes.plot(distance, share, "o-", label=f"found as {name}")
    axes.set(xlabel="distance of the two probes, mm", ylabel="% of frames")
    axes.legend(frameon=False)
    _save(figure, path)


#: Value, title, unit, and the published network's mean absolute error.
REAL = (
    ("displacement_mm", "depth", "mm", 0.148),
    ("tilt_x_deg", "tilt x", "deg", 1.27),
    ("tilt_y_deg", "tilt y", "deg", 1.45),
    ("shear_x_mm", "shear x", "mm", 1.22),
    ("shear_y_mm", "shear y", "mm", 1.19),
    ("torsion_deg", "torsion", "deg", 1.60),
)


def real_scatter(path: Path, true: dict[str, Array], read: dict[str, Array], sigma: dict[str, Array]) -> None:
    """Held-out frames of the published set: read against true, with one sigma, and the network's figures."""
    figure, axes = plt.subplots(2, 3, figsize=(10, 6.6))
    for axis, (name, title, unit, network) in zip(axes.flat, REAL, strict=True):
        if name not in true or name not in read:
            axis.set_axis_off()
            continue
        x, y = true[name], read[name]
        ends = np.array([min(x.min(), np.nanmin(y)), max(x.max(), np.nanmax(y))])
        axis.plot(ends, ends, "-", color=TRUE, lw=1)
        axis.errorbar(x, y, sigma[name], fmt=".", color=LINE, ms=4, elinewidth=0.6, alpha=0.75)
        axis.set_title(
            f"{title}: {np.nanmean(np.abs(x - y)):.3g} {unit}  (network {network})", loc="left", fontsize=9.5
        )
        axis.set(xlabel=f"true, {unit}", ylabel=f"read, {unit}")
    figure.tight_layout()
    _save(figure, path)


def trade(path: Path, rows: Sequence[Row]) -> None:
    """Speed against error, one panel a stage; the Pareto front is joined, the choice is marked."""
    stages = list(dict.fromkeys(row.stage for row in rows))
    columns = 2
    lines = math.ceil(len(stages) / columns)
    figure, axes = plt.subplots(lines, columns, figsize=(10, 4.3 * lines), squeeze=False)
    for axis, stage in zip(axes.flat, stages, strict=False):
        here = [row for row in rows if row.stage == stage]
        x, y = np.array([r.time_us for r in here]), np.array([r.error for r in here])
        best = _front(x, y)
        order = np.argsort(x[best])
        axis.plot(x[best][order], y[best][order], "-", color=TRUE, lw=1.2, zorder=1)
        for i, row in enumerate(here):
            color = MARK if row.chosen else LINE if best[i] else TRUE
            axis.plot(x[i], y[i], "*" if row.chosen else "o", color=color, ms=13 if row.chosen else 6)
            axis.annotate(
                f"{i + 1}", (x[i], y[i]), textcoords="offset points", xytext=(6, 5), fontsize=8.5, color=INK
            )
        names = "\n".join(f"{i + 1}  {row.choice}" for i, row in enumerate(here))
        axis.text(
            0.99, 0.99, names, transform=axis.transAxes, ha="right", va="top", fontsize=7,
            bbox={"fc": "white", "ec": "none", "alpha": 0.8},
        )  # fmt: skip
        axis.set_xscale("log")
        # A decade at least, so that there is a labelled tick; and space above for the names.
        axis.set_xlim(float(x.min()) / 2.0, max(2.0 * float(x.max()), 5.0 * float(x.min())))
        low, high = float(y.min()), float(y.max())
        if low > 0.0 and high > 20.0 * low:
            axis.set_yscale("log")
            axis.set_ylim(low / 2.0, high * (high / low) ** 0.9)
        else:
            axis.set_ylim(0.0, (1.2 + 0.09 * len(here)) * high + 1e-12)
        axis.set(xlabel="time per frame, us", ylabel=f"error, {here[0].unit}")
        axis.set_title(stage, loc="left")
    for axis in axes.flat[len(stages) :]:
        axis.set_axis_off()
    figure.tight_layout()
    _save(figure, path)


def _front(x: Array, y: Array) -> Mask:
    """Whether it is on the Pareto front: nothing is both faster and more exact."""
    better = (
        (x[None] <= x[:, None]) & (y[None] <= y[:, None]) & ((x[None] < x[:, None]) | (y[None] < y[:, None]))
    )
    return np.asarray(~better.any(axis=1))
