"""Summary at the end of a run or replay: the loop's counters; pins, shear and contacts."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from edge.link.sinks import Sink
    from edge.pipeline import Result
    from edge.runtime.statistics import LoopStatistics
    from edge.types import FrameSource
    from hostlink.wire import State

__all__ = ["LABELS", "Summary", "damage_of", "json_line", "print_summary"]

#: Keys of the JSON, and their text for people; the last word is the unit.
LABELS = {
    "frames_n": "images processed",
    "lost_by_camera_n": "images lost before they reached this process",
    "dropped_n": "images replaced by a newer one",
    "full_searches_n": "searches of the whole image",
    "unidentified_n": "images without values: pins not identified",
    "failed_n": "images that could not be processed",
    "keepalives_n": "samples sent while no image came",
    "sent_n": "samples sent, all sinks",
    "pins_n": "pins of the rest frame",
    "pins_seen_min_n": "pins seen, least",
    "pins_seen_median_n": "pins seen, median",
    "drift_px": "largest drift subtracted, px",
    "rate_hz": "images a second",
    "compute_us": "computing, median / 99 % / 99.9 %, us",
    "latency_us": "capture to sample, median / 99 % / 99.9 %, us",
    "faults": "faults, how often each",
    "sinks": "sinks",
    "pins_held_min": "pins seen in the recording, least",
    "pins_held_median": "pins seen in the recording, median",
    "confidence_min": "confidence of identities, least",
    "confidence_median": "confidence of identities, median",
    "contacts_max": "contacts at once, most",
    "shear_mean_px": "mean shear x, y, px",
    "shear_mean_deg": "its direction, deg",
    "shear_peak_px": "largest shear x, y, px",
    "shear_peak_deg": "its direction, deg",
    "displacement_max_mm": "largest depth, mm",
}


def damage_of(source: FrameSource) -> str:
    """Message on the unreadable part of a recording; known once it has been read. Empty: none."""
    from edge.sources import Paced
    from edge.types import RecordedSource

    recorded = source.source if isinstance(source, Paced) else source
    if not isinstance(recorded, RecordedSource):
        return ""
    found = {_DAMAGE.get(what, what): n for what, n in recorded.faults.items() if n}
    if not found:
        return ""
    listed = ", ".join(what if n == 1 else f"{what} {n} times" for what, n in found.items())
    return f"not whole ({listed}); what could be read was taken, copy or record it again for the rest"


_DAMAGE = {"truncated": "cut off at its end"}


class Summary:
    """Collects a few numbers a frame. `add` is a result callback of the loop."""

    def __init__(self) -> None:
        self._held: list[int] = []
        self._confidence: list[float] = []
        self._shear_px: list[tuple[float, float]] = []
        self._contacts: list[int] = []
        self._displacement_mm: list[float] = []

    def add(self, result: Result, state: State) -> None:
        """Note one frame."""
        self._held.append(result.tracks.n_seen)
        self._confidence.append(result.tracks.confidence)
        features = result.features
        if features is not None and features.shear_px is not None:
            self._shear_px.append((float(features.shear_px[0]), float(features.shear_px[1])))
            self._contacts.append(state.contact_n)
        self._displacement_mm.append(state.displacement_mm)

    def report(self) -> dict[str, Any]:
        """Numbers over all frames. Shear is the pins' mean motion, px; its angle from x right to y down.

        shear_mean_px, shear_mean_deg    mean over the frames, and its direction
        shear_peak_px, shear_peak_deg    in the frame with the largest
        """
        import numpy as np

        if not self._held:
            return {"pins_held_median": 0}
        table: dict[str, Any] = {
            "pins_held_min": min(self._held),
            "pins_held_median": int(np.median(self._held)),
            "confidence_min": round(min(self._confidence), 3),
            "confidence_median": round(float(np.median(self._confidence)), 3),
            "contacts_max": max(self._contacts, default=0),
        }
        if self._shear_px:
            shear = np.array(self._shear_px)
            for name, vector in (
                ("mean", shear.mean(axis=0)),
                ("peak", shear[np.argmax(np.hypot(*shear.T))]),
            ):
                table[f"shear_{name}_px"] = [round(float(v), 3) for v in vector]
                table[f"shear_{name}_deg"] = round(float(np.degrees(np.arctan2(vector[1], vector[0]))), 1)
        depth = np.array(self._displacement_mm)
        if np.isfinite(depth).any():
            table["displacement_max_mm"] = round(float(np.nanmax(depth)), 3)
        return table


def print_summary(
    statistics: LoopStatistics, sinks: Sequence[Sink], as_json: bool, more: dict[str, Any] | None = None
) -> None:
    """Print the summary: JSON with the names of the fields, or lines of text."""
    table = {**asdict(statistics), **(more or {})}
    table["sinks"] = {
        f"{i} {sink.name}": {"sent": sink.counters.sent, "dropped": sink.counters.dropped}
        for i, sink in enumerate(sinks)
    }
    if as_json:
        click.echo(json_line(table))
        return
    for key, value in table.items():
        click.echo(f"{LABELS[key]:46s} {_shown(value)}")


def _shown(value: Any) -> str:
    match value:
        case tuple():
            return " / ".join(f"{v:.0f}" for v in value)
        case list():
            return ", ".join(f"{v:g}" for v in value)
        case dict():
            return ", ".join(f"{k} {_shown(v)}" for k, v in value.items()) or "none"
        case float():
            return f"{value:.3g}"
    return str(value)


def json_line(table: dict[str, Any]) -> str:
    """One line of JSON; NaN, which JSON does not have, is null."""

    def plain(value: Any) -> Any:
        if isinstance(value, float):
            return value if math.isfinite(value) else None
        if isinstance(value, dict):
            return {k: plain(v) for k, v in value.items()}
        if isinstance(value, list | tuple):
            return [plain(v) for v in value]
        return value

    return json.dumps(plain(table))
