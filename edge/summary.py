"""What a whole recording showed: pins held, global shear, contacts; printed at the end of a replay."""

from __future__ import annotations

from typing import Any

import numpy as np

from edge.pipeline import Result
from edge.types import FrameSource
from hostlink.wire import State


def damage_of(source: FrameSource) -> str:
    """What of a recording could not be read, in words; known once it has been read. Empty: nothing."""
    recorded = getattr(source, "source", source)  # of a paced one
    found = {_WORDS.get(what, what): n for what, n in getattr(recorded, "faults", {}).items() if n}
    if not found:
        return ""
    listed = ", ".join(what if n == 1 else f"{what} {n} times" for what, n in found.items())
    return f"not whole ({listed}); what could be read was taken, copy or record it again for the rest"


_WORDS = {"truncated": "cut off at its end"}


class Summary:
    """Collects a few numbers a frame. `add` is a watcher of the app."""

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
