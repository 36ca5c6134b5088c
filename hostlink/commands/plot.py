"""`python -m hostlink plot`: a recording's values over time, as a picture for print.

Rules
- A recording of the bus (.log, .blf, .asc), of a line (.serial) or with Foxglove's topics (.mcap,
  `/finger_1/sample`) gives the same picture, because it holds the same samples.
- One panel a quantity with its unit, one line a finger; an unknown value leaves a gap, a known one between
  two gaps is a dot, and a quantity that is never known has no panel.
- Times count from the recording's first sample, on the sensor's clock: capture, not arrival.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from math import isnan, nan
from pathlib import Path
from typing import Any

import click

from hostlink.cli_types import WholeNumber, channel_option, counted
from hostlink.decoder import Sample
from hostlink.errors import LogError, UsageError
from hostlink.output_file import check_output, writing
from hostlink.recording import decode_recording
from hostlink.wire.fields import FIELDS, Shown, field_named
from hostlink.wire.shown import Chart, charts_of

__all__ = ["PANELS", "Series", "draw", "plot", "read_series"]

log = logging.getLogger(__name__)

_WITH_SAMPLES = "give what `hostlink record`, `hostlink bridge --record` or `edge run --record` wrote"
PICTURES = (".png", ".pdf", ".svg")
_WIDTH_IN = 7.16  # both columns of an IEEE page
_PANEL_IN = 1.15
_WRAP_US = 1 << 32
#: A silence longer than this is drawn as a gap: lost samples must not look measured.
_GAP_S = 0.25


PANELS = (
    *charts_of(FIELDS),
    Chart(("contact_n",), "number", Shown("contacts")),
    Chart(("latency_us",), "ms", Shown("latency")),
)
#: Factors of the axes that have another unit than the wire.
_SCALES = {"latency_us": 1e-3}
_COLUMNS = tuple(dict.fromkeys(f for p in PANELS for f in (*p.fields, p.how.sigma) if f))


@dataclass(slots=True)
class Series:
    """One finger's samples: times from the recording's start, and a column for each field of `PANELS`.

    samples_n  of them; a row more for each gap
    """

    samples_n: int = 0
    time_s: list[float] = field(default_factory=list)
    values: dict[str, list[float]] = field(default_factory=lambda: {name: [] for name in _COLUMNS})
    _last_us: int | None = None

    def add(self, capture_us: int, start_us: int, state: Any) -> None:
        """A sample; `state` has the fields as attributes or keys."""
        # The wire's microseconds wrap after 71 minutes.
        if self._last_us is not None:
            capture_us = (
                self._last_us + (capture_us - self._last_us + _WRAP_US // 2) % _WRAP_US - _WRAP_US // 2
            )
        self._last_us = capture_us
        at_s = (capture_us - start_us) * 1e-6
        if self.time_s and at_s - self.time_s[-1] > _GAP_S:
            self._append((self.time_s[-1] + at_s) / 2, {})
        self._append(at_s, state)
        self.samples_n += 1

    def _append(self, at_s: float, state: dict[str, Any]) -> None:
        self.time_s.append(at_s)
        for name, column in self.values.items():
            value = state.get(name)
            column.append(nan if value is None else float(value))

    def known(self, name: str) -> bool:
        return not all(isnan(value) for value in self.values[name])


def read_series(path: Path, channel: str | None = None) -> dict[int, Series]:
    """Each finger's samples in a recording.

    Raises  LogError: unreadable, unknown format, or without samples; UsageError: a channel must be chosen
    """
    series: dict[int, Series] = {}
    start_us: dict[int, int] = {}
    first_s: float | None = None
    for node, arrival_s, capture_us, values in _samples(path, channel):
        if node not in series:
            # Fingers have separate clocks; they are aligned by the arrival of their first samples, if known.
            first_s = arrival_s if first_s is None else first_s
            later_us = 0 if isnan(arrival_s) else round((arrival_s - first_s) * 1e6)
            series[node], start_us[node] = Series(), capture_us - later_us
        series[node].add(capture_us, start_us[node], values)
    if not series:
        raise LogError(f"{path}: holds no samples of a fingertip; {_WITH_SAMPLES}")
    return series


def _samples(path: Path, channel: str | None) -> Iterator[tuple[int, float, int, dict[str, Any]]]:
    """(finger, arrival s, capture us, values by field)."""
    samples_n = 0
    try:
        for event in decode_recording(path, channel=channel):
            if isinstance(event, Sample):
                values = {name: getattr(event.state, name) for name in _COLUMNS}
                samples_n += 1
                yield event.node, event.arrival_s, event.state.capture_time_us, values
    except LogError as error:
        if not samples_n:
            raise
        log.warning("%s; only the samples before that are drawn", error)


def draw(series: dict[int, Series], out: Path, title: str = "") -> tuple[str, ...]:
    """Write the picture; the panels that it has.

    Raises  UsageError: no matplotlib; OSError: the file cannot be written
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise UsageError(f"plot: {error}; install voronoi-touch[plot] or -e .[plot]") from error
    panels = [p for p in PANELS if any(s.known(name) for s in series.values() for name in p.fields)]
    if not panels:
        raise LogError(f"{title or out}: every value of every sample is unknown; was the tip calibrated?")
    figure = Figure(figsize=(_WIDTH_IN, _PANEL_IN * len(panels) + 0.6), layout="constrained")
    FigureCanvasAgg(figure)
    rows = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, panel in zip(rows, panels, strict=True):
        _panel(axes, panel, series)
    rows[-1].set_xlabel("time since the first sample (s)", fontsize=8)
    figure.align_ylabels()
    if title:
        figure.suptitle(title, fontsize=9)
    figure.savefig(out, dpi=200)
    return tuple(p.how.title for p in panels)


#: Okabe and Ito, without the yellow, which is invisible on paper; dashes show the axis in grey print too.
_COLOURS = ("#0060a8", "#c24a00", "#007a5a", "#b0609a", "#000000", "#4aa3d8")
_DASHES: tuple[Any, ...] = ("-", (0, (4, 2)))


def _panel(axes: Any, panel: Chart, series: dict[int, Series]) -> None:
    several = len(series) > 1
    sigma_name, counts = panel.how.sigma, field_named(panel.fields[0]).plain
    for k, (node, one) in enumerate(sorted(series.items())):
        for i, name in enumerate(panel.fields):
            if not one.known(name):
                continue
            # One finger: a colour an axis. Several: a colour a finger, dashes distinguish the axes.
            colour = _COLOURS[(k if several else i) % len(_COLOURS)]
            which = panel.names[i] if panel.names else ""
            label = f"finger {node} {which}".rstrip() if several else which or None
            values = [v * _SCALES.get(name, 1.0) for v in one.values[name]]
            style = "steps-post" if counts else "default"
            axes.plot(
                one.time_s,
                values,
                color=colour,
                linestyle=_DASHES[i],
                linewidth=1.0,
                label=label,
                drawstyle=style,
            )
            alone = _alone(values)
            axes.plot(
                [one.time_s[j] for j in alone], [values[j] for j in alone], ".", color=colour, markersize=3
            )
            if sigma_name and one.known(sigma_name):
                sigma = one.values[sigma_name]
                low, high = ([v + sign * s for v, s in zip(values, sigma, strict=True)] for sign in (-1, 1))
                axes.fill_between(one.time_s, low, high, color=colour, alpha=0.18, linewidth=0)
    axes.set_ylabel(panel.how.title + (f"\n({panel.unit})" if panel.unit else ""), fontsize=8)
    if counts:
        axes.yaxis.get_major_locator().set_params(integer=True)
    axes.tick_params(labelsize=7)
    axes.grid(linewidth=0.4, color="#dddddd")
    axes.margins(x=0.01)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    if axes.get_legend_handles_labels()[0]:
        # It stands above the axes, where it hides nothing.
        at = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.0}
        axes.legend(fontsize=7, ncols=6, frameon=False, **at)


def _alone(values: Sequence[float]) -> list[int]:
    """Which values are known between two that are not: no line passes through them, so each gets a dot."""
    around = [nan, *values, nan]
    return [i for i, v in enumerate(values) if not isnan(v) and isnan(around[i]) and isnan(around[i + 2])]


def _only(series: dict[int, Series], fingers: Sequence[int], path: Path) -> dict[int, Series]:
    missing = sorted(set(fingers) - series.keys())
    if missing:
        raise UsageError(f"{path}: no finger {_list(missing)}; it holds {_list(sorted(series))}")
    return {node: series[node] for node in fingers} if fingers else series


def _list(numbers: Iterable[int]) -> str:
    return ", ".join(map(str, numbers))


@click.command()
@click.argument("file", type=click.Path(path_type=Path, dir_okay=False))
@click.option("-o", "--out", type=click.Path(path_type=Path), help="PNG, PDF or SVG; else FILE.png.")
@click.option("--overwrite", is_flag=True, help="Replace the picture if it exists.")
@click.option(
    "--finger", "fingers", type=WholeNumber(1, 127), multiple=True, help="Only this one; may be given again."
)
@channel_option
@click.option("--json", "as_json", is_flag=True, help="Say what was drawn as JSON.")
@click.option("-q", "--quiet", is_flag=True, help="Say nothing.")
def plot(
    file: Path,
    out: Path | None,
    overwrite: bool,
    fingers: Sequence[int],
    channel: str | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Draw what FILE holds over time.

    FILE is a recording of a bus (.log, .blf, .asc), of a serial line (.serial) or of the edge (.mcap).
    """
    series = _only(read_series(file, channel), fingers, file)
    out = check_output(out or file.with_suffix(".png"), PICTURES, inputs=(file,), overwrite=overwrite)
    with writing(out, overwrite) as unfinished:
        panels = draw(series, unfinished, file.name)
    samples_n = {node: one.samples_n for node, one in series.items()}
    if as_json:
        click.echo(json.dumps({"out": str(out), "panels": panels, "samples": samples_n}))
    elif not quiet:
        click.echo(f"{out}: {', '.join(panels)}; {counted(sum(samples_n.values()), 'sample')}")
