"""Plots of errors over the cost of a frame."""

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.colors import TABLEAU_COLORS
from matplotlib.lines import Line2D

COLOURS_TEN = list(TABLEAU_COLORS)


def accuracy_plot(rows: list[dict[str, Any]], errors: dict[str, float], path: Path) -> None:
    """Error over the cost of a frame, a panel for each value; each configuration is a numbered point.

    Costs are the time and, where they were counted, the instructions: a row of panels each.

    errors  name of each value, and an error to compare with: a dashed line
    """
    costs = {"us": "us a frame"}
    if "instructions" in rows[0]:
        costs["instructions"] = "instructions a frame"
    size = (3.3 * len(errors), 0.9 + 3.0 * len(costs))
    figure, axes = plt.subplots(len(costs), len(errors), figsize=size, sharex="row", squeeze=False)
    handles: dict[str, Line2D] = {}
    for panels, (cost, unit) in zip(axes, costs.items(), strict=True):
        for axis, (name, published) in zip(panels, errors.items(), strict=True):
            points = [
                (row[cost], row[name], number) for number, row in enumerate(rows, 1) if row[name] is not None
            ]
            for at, error, number in points:
                label = f"{number}  {rows[number - 1]['name']}"
                (point,) = axis.plot(at, error, "o", color=COLOURS_TEN[number - 1], label=label)
                handles.setdefault(label, point)
            highest = 1.15 * max([published, *(error for _, error, _ in points)])
            axis.axhline(published, color="grey", linestyle="--", linewidth=1.0)
            for at, error, text in _together(points, 0.04 * highest):
                axis.annotate(text, (at, error), (5, 3), textcoords="offset points", fontsize=8)
            axis.set(title=name, xlabel=unit, xscale="log", ylim=(0, highest))
            for side in ("top", "right"):
                axis.spines[side].set_visible(False)
        lowest, highest = min(row[cost] for row in rows), max(row[cost] for row in rows)
        panels[0].set(ylabel="mean absolute error, held-out frames", xlim=(lowest / 2.0, highest * 2.0))
    lines = [*(handles[label] for label in sorted(handles)), Line2D([], [], color="grey", linestyle="--")]
    labels = [*sorted(handles), "a published network's error"]
    figure.legend(lines, labels, frameon=False, loc="lower center", ncol=3, fontsize=8)
    figure.tight_layout(rect=(0, 0.62 / size[1], 1, 1))
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _together(points: list[tuple[float, float, int]], near: float) -> list[tuple[float, float, str]]:
    """Points that lie on each other share a text: their numbers."""
    found: list[tuple[float, float, str]] = []
    for at, error, number in points:
        for i, (at_there, error_there, text) in enumerate(found):
            if abs(error - error_there) < near and 0.7 < at / at_there < 1.4:
                found[i] = max(at, at_there), max(error, error_there), f"{text}, {number}"
                break
        else:
            found.append((at, error, str(number)))
    return found
