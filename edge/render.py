"""A recording as the paper's video: every frame through the pipeline and into a picture.

Rules
- The rest frame is the recording's first frames, as in a replay; they are in the video, too.
- With a calibration the scale bar is in mm and the caption has the calibrated values with their errors.
- A frame whose pins are in doubt is shown with its image and without cells, and the caption says so.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, islice
from math import hypot, isnan, nan
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from edge.app import TARE_FRAMES
from edge.calibration import Calibration
from edge.draw import PAPER, SAFE, View, picture
from edge.draw import render as write_video
from edge.errors import NoPins, SourceError
from edge.pipeline import Pipeline, Result, tare
from edge.progress import bar
from edge.sources import open_source
from edge.summary import damage_of
from edge.tessellate import cell_polygons
from edge.types import Feature, Reading

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

log = logging.getLogger(__name__)

__all__ = ["Made", "caption", "render_recording"]

PALETTES = {"paper": PAPER, "safe": SAFE}
#: What a picture shows; the surface is not drawn.
DRAWN = frozenset(Feature) - {Feature.SURFACE}


@dataclass(frozen=True, slots=True)
class Made:
    """frames_n  in the video
    unsure_n  of them without values, because the pins were in doubt
    pins_n    of the rest frame
    rate_hz   pictures a second
    """

    frames_n: int
    unsure_n: int
    pins_n: int
    rate_hz: float


def render_recording(
    recording: str,
    out: Path,
    calibration: Calibration | None = None,
    palette: str = "paper",
    rate_hz: float | None = None,
    height: int = 640,
    progress: bool = False,
) -> Made:
    """Write the video.

    rate_hz   pictures a second; None: the recording's own
    height    of a panel, px
    progress  show a bar on stderr
    Raises    SourceError: no such recording, or no pins in its first frames; SinkError: cannot be written;
              CalibrationError: of another tip
    """
    source = open_source(recording)
    if source.live:
        source.close()
        raise SourceError(f"source {recording}: is live; record it first, then render the recording")
    frames = iter(source)
    first = list(islice(frames, TARE_FRAMES))
    if not first:
        raise SourceError(f"source {recording}: no images")
    try:
        rest = tare([frame.image for frame in first], np.inf, calibration)
    except NoPins as error:
        raise SourceError(f"source {recording}: {error}") from None
    mm_per_px = (calibration.mm_per_px if calibration else None) or 0.0
    view = View.of(rest.xy_img, rest.pattern.pitch_px, height, mm_per_px)
    pipeline = Pipeline(rest, calibration, DRAWN)
    rate_hz = rate_hz or source.rate_hz or 30.0
    unsure_n = 0

    def pictures() -> Iterator[NDArray[np.uint8]]:
        nonlocal unsure_n
        for frame in chain(first, frames):
            result = pipeline.process(frame)
            unsure_n += result.features is None
            polygons = cell_polygons(result.cells) if result.cells is not None else []
            yield picture(
                view,
                frame,
                result.tracks,
                polygons,
                result.features,
                palette=PALETTES[palette],
                caption=caption(result),
            )

    with bar(progress) as shown:
        task = shown.add_task(out.name, total=getattr(source, "frames_n", 0) or None)
        drawn = (_told(shown, task, one) for one in pictures())
        frames_n = write_video(drawn, out, rate_hz)
    source.close()
    if words := damage_of(source):
        log.warning("%s: %s", recording, words)
    return Made(frames_n, unsure_n, len(rest), rate_hz)


def _told(shown: Progress, task: TaskID, one: NDArray[np.uint8]) -> NDArray[np.uint8]:
    shown.advance(task)
    return one


def caption(result: Result) -> str:
    """The calibrated values of a frame in a line; empty without any."""
    reading = result.reading
    parts = [
        _part("depth", reading, "displacement_mm", "mm"),
        _shear(reading),
        _part("force", reading, "force_n", "N", error=False),
        _part("torsion", reading, "torsion_deg", "deg", error=False),
    ]
    return "   ".join(part for part in parts if part)


def _part(name: str, reading: Reading, field: str, unit: str, error: bool = True) -> str:
    value, sigma = reading.values.get(field, nan), reading.sigmas.get(field, nan)
    if isnan(value):
        return ""
    spread = f" +-{sigma:.2f}" if error and not isnan(sigma) else ""
    return f"{name} {value:.2f}{spread} {unit}"


def _shear(reading: Reading) -> str:
    x, y = reading.values.get("shear_x_mm", nan), reading.values.get("shear_y_mm", nan)
    return "" if isnan(x) or isnan(y) else f"shear {hypot(x, y):.2f} mm"
