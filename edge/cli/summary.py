"""Summary at the end of a run or replay: the loop's counters; pins, shear and contacts."""

import cmath
import json
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, get_type_hints

import click
import numpy as np

from edge.link.sinks import Sink
from edge.runtime.statistics import LoopStatistics
from edge.sources.files import FileSource
from edge.sources.paced import Paced
from edge.types import FrameSource, Result
from hostlink.web import plain
from hostlink.wire import State

_COUNTED = get_type_hints(LoopStatistics, include_extras=True)
#: Keys of the JSON, and their text for people; the last word is the unit.
LABELS = {
    **{name: label for name, hint in _COUNTED.items() for label in hint.__metadata__},
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
    recorded = source.source if isinstance(source, Paced) else source
    if not isinstance(recorded, FileSource):
        return ""
    found = [what if n == 1 else f"{what} {n} times" for what, n in recorded.faults.items() if n]
    found[3:] = [f"{len(found) - 3} more"] if len(found) > 3 else []
    listed = ", ".join(found).replace("truncated", "cut off at its end")
    rest = "what could be read was taken, copy or record it again for the rest"
    return f"not whole ({listed}); {rest}" if found else ""


class Summary:
    """Numbers over all frames, in bounded memory. `add` is a result callback of the loop."""

    def __init__(self, source: FrameSource) -> None:
        self._source = source
        self.skipped_n: int | None = None  # images that passed before the first result; None: there was none
        self._held: Counter[int] = Counter()
        self._confidence: Counter[float] = Counter()  # rounded as it is shown
        self._shear_n = 0
        self._shear_sum = self._shear_peak = 0j
        self._contacts_max = 0
        self._displacement_mm = -math.inf

    def add(self, result: Result, state: State) -> None:
        if self.skipped_n is None:
            self.skipped_n = self._source.dropped_n
        self._held[result.tracks.n_seen] += 1
        self._confidence[round(result.tracks.confidence, 3)] += 1
        features = result.features
        if features is not None and features.shear_px is not None:
            shear = complex(*features.shear_px)
            self._shear_n += 1
            self._shear_sum += shear
            self._shear_peak = max(self._shear_peak, shear, key=abs)
            self._contacts_max = max(self._contacts_max, state.contact_n)
        if state.displacement_mm > self._displacement_mm:  # not of NaN: there is no calibration
            self._displacement_mm = state.displacement_mm

    def report(self) -> dict[str, Any]:
        """Numbers over all frames. Shear is the pins' mean motion, px; its angle from x right to y down."""
        if not self._held:
            return {"pins_held_median": 0}
        table: dict[str, Any] = {
            "pins_held_min": min(self._held),
            "pins_held_median": int(np.median([*self._held.elements()])),
            "confidence_min": min(self._confidence),
            "confidence_median": round(float(np.median([*self._confidence.elements()])), 3),
            "contacts_max": self._contacts_max,
        }
        if self._shear_n:
            for name, shear in (("mean", self._shear_sum / self._shear_n), ("peak", self._shear_peak)):
                table[f"shear_{name}_px"] = [round(shear.real, 3), round(shear.imag, 3)]
                table[f"shear_{name}_deg"] = round(math.degrees(cmath.phase(shear)), 1)
        if math.isfinite(self._displacement_mm):
            table["displacement_max_mm"] = round(self._displacement_mm, 3)
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
    return json.dumps(plain(table))
