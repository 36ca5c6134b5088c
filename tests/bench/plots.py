"""Plots of the time per frame over pins and over pixels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

__all__ = ["scaling_plots"]

STAGES = ("pins", "track", "tessellate", "features")
COLOURS = ("#3b6fb6", "#e08a3c", "#5a9e5a", "#b04a5a")


def scaling_plots(scaling: dict[str, list[dict[str, Any]]], folder: Path) -> list[Path]:
    """One picture with a panel for pins and one for pixels."""
    figure, axes = plt.subplots(1, len(scaling), figsize=(4.2 * len(scaling), 3.6), sharey=False)
    for axis, (name, rows) in zip(axes, scaling.items(), strict=True):
        over_pins = name == "pins"
        x = [row["pins_found"] if over_pins else row["size_px"][0] * row["size_px"][1] / 1e3 for row in rows]
        below = [0.0] * len(rows)
        for stage, colour in zip(STAGES, COLOURS, strict=True):
            top = [b + row[f"{stage}_us"] for b, row in zip(below, rows, strict=True)]
            axis.fill_between(x, below, top, color=colour, alpha=0.75, linewidth=0, label=stage)
            below = top
        axis.plot(x, below, color="black", linewidth=1.0, marker="o", markersize=3)
        axis.set(
            title="640x480" if over_pins else f"331 pins, {name.partition(', ')[2]}",
            xlabel="pins" if over_pins else "1000 pixels", ylabel="us a frame",
            xlim=(0, None), ylim=(0, None),
        )  # fmt: skip
        for side in ("top", "right"):
            axis.spines[side].set_visible(False)
    axes[0].legend(frameon=False, loc="upper left")
    figure.tight_layout()
    path = folder / "growth.png"
    figure.savefig(path, dpi=110)
    plt.close(figure)
    return [path]
