"""One picture of what is made of each real sensor: cells, motion and contact, without its maker's images.

Of each recording the image with the largest contact is drawn, against its rest frame: the one that was
published, or that `--rest auto` chooses. Pins are followed through a video; each still is a jump from rest.
"""

from collections.abc import Iterable
from pathlib import Path

import click
import cv2
import numpy as np
from numpy.typing import NDArray

from edge.cells import cell_polygons
from edge.frame import Pipeline
from edge.pins import take_rest
from edge.rest.choice import rest_of_source
from edge.sources import open_source, read_image
from edge.types import Frame, Rest, Result
from edge.view.panels import View, draw_touch
from tests.bench.output import writes_results
from tests.bench.recordings import TIP_331, real_option

SIDE_PX = 320
TITLE_PX = 28
STILLS_STEP = 30  # every thirtieth still
SEEN_REL = 0.85  # share of the pins that an image must show
TITLES = {
    TIP_331: "TacTip, 331 pins",
    "video/Movement4.avi": "home-made tip, about 130 pins",
    "video/flatSkin.avi": "flat skin, square grid, fisheye",
    "gelsight_mini/press.avi": "GelSight Mini, dark dots",
}


def _recording(path: Path) -> tuple[Rest, Iterable[Frame]]:
    """Its rest frame; a video's images, or some of the stills."""
    if path.is_dir():
        paths = sorted((path / "frames").iterdir())[::STILLS_STEP]
        return take_rest([read_image(path / "rest.png")]), (
            Frame(read_image(still), 0, n) for n, still in enumerate(paths)
        )
    source = open_source(str(path))
    return rest_of_source(source, "auto").rest, source


def _strongest(rest: Rest, frames: Iterable[Frame], stills: bool) -> Result:
    """The image with the largest contact. stills: none follows from the one before."""
    pipeline = Pipeline(rest)
    best: tuple[float, Result] | None = None
    for frame in frames:
        if stills:
            pipeline.forget()
        result = pipeline.process(frame)
        if result.features is None or result.tracks.n_seen < SEEN_REL * len(rest):
            continue
        volume = result.features.volume_px2 or 0.0
        if best is None or volume > best[0]:
            best = volume, result
    assert best is not None, "no image shows the pins"
    return best[1]


def _panel(title: str, rest: Rest, result: Result) -> NDArray[np.uint8]:
    view = View.of(rest.xy_img, rest.pattern.pitch_px, SIDE_PX)
    polygons = cell_polygons(result.cells) if result.cells is not None else []
    panel = np.full((SIDE_PX + TITLE_PX, SIDE_PX, 3), 255, np.uint8)
    panel[:SIDE_PX] = draw_touch(view, polygons, result.tracks, result.features)
    at = (8, SIDE_PX + TITLE_PX - 9)
    cv2.putText(panel, title, at, cv2.FONT_HERSHEY_SIMPLEX, 0.5, (40, 40, 40), 1, cv2.LINE_AA)
    return panel


@click.command()
@real_option
@writes_results
def command(folder: Path, out: Path) -> None:
    """Draw what is made of each real sensor."""
    panels = []
    for name, title in TITLES.items():
        rest, frames = _recording(folder / name)
        result = _strongest(rest, frames, stills=(folder / name).is_dir())
        click.echo(f"{name}: {len(rest)} pins, image {result.frame.sequence}")
        panels.append(_panel(title, rest, result))
    cv2.imwrite(str(out / "sensors.png"), np.hstack(panels), [cv2.IMWRITE_PNG_COMPRESSION, 9])
