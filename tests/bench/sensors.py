"""A row of `docs/sensors.md` for each real sensor, and one picture of what is made of some of them.

A new recording is a line of `CATALOGUE`. The picture shows cells, motion and contact, without makers' images.

Of each recording the image with the largest contact is drawn, against its rest frame: the one that was
published, or that `--rest auto` chooses.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import click
import cv2
import numpy as np
from numpy.typing import NDArray

from edge.cells import cell_polygons
from edge.errors import NoPins
from edge.frame import Pipeline
from edge.pins import take_rest
from edge.rest.choice import rest_of_source
from edge.sources import open_source
from edge.sources.files import FolderSource
from edge.types import Rest, Result
from edge.view.panels import View, draw_touch
from tests.bench.output import ROOT, writes_results
from tests.bench.recordings import real_option

PAGE = ROOT / "docs" / "sensors.md"
CASES = "cases/sensors"
VPTAC, MIRRORS = f"{CASES}/mirror_two_views", "?roi=54,79,215,220&roi=308,91,219,216"
PRESSED, BINARY = f"{CASES}/press_hides_dots_gelslim", "real/tactip331_binary"
DOME = "real/fingervision_dome/frames"
HEAD = "| recording | pins by eye | found | more than by eye | held | touched |"
SIDE_PX = 320
TITLE_PX = 28
SEEN_REL = 0.85  # share of the pins that an image must show


@dataclass(frozen=True, slots=True)
class Row:
    """A recording; paths are in the folder of the shared data, and may have keys of a source's address.

    by_eye  pins counted by eye; 0: not counted
    images  video, or folder of stills; "": there is the rest image alone
    rest    image of the untouched skin; "": `--rest auto` finds one
    """

    title: str
    by_eye: int
    images: str
    rest: str = ""


CATALOGUE = (
    Row("TacTip, 331 pins, thresholded", 331, f"{BINARY}/frames", f"{BINARY}/rest.png"),
    Row("TacTip, 331 pins", 331, "real/tactip331_gray/frames"),
    Row("home-made tip, spokes", 0, "real/video/Movement4.avi"),
    Row("flat skin, square grid, fisheye", 0, "real/video/flatSkin.avi"),
    Row("GelSight Mini, dark dots", 70, "real/gelsight_mini/press.avi"),
    Row("FingerVision dome", 36, DOME, f"{DOME}/0.00_0.00_0.00_0.00_0.jpg"),
    Row("GelSlim, ghosted dots", 285, PRESSED, f"{PRESSED}/000_rest.png"),
    Row("GelSlim, small dots", 530, "", f"{CASES}/false_gelsight_mini/000.png"),
    Row("Tactile insertion, ghosted dots", 330, "", f"{CASES}/ghosted_dots_one_marker_two_pins/000.png"),
    Row("FingerVision, flat", 180, "", f"{CASES}/pin_split_by_glint/whole.png"),
    Row("Vptac, two mirrors", 120, f"{VPTAC}{MIRRORS}", f"{VPTAC}/001.png{MIRRORS}"),
    Row("UM-FingerVision dome", 36, "", f"{CASES}/size_jump_umfv/000.png"),
    Row("AllSight, spokes", 100, "", f"{CASES}/tube_perspective_allsight/000.png"),
    Row("TacLINK, along a tube", 0, "", f"{CASES}/tube_perspective_taclink/000.png"),
)


def _rest_of(shared: Path, row: Row) -> Rest:
    """Raises NoPins."""
    if row.rest:
        source = open_source(str(shared / row.rest))
        return take_rest([next(iter(source)).image], region=source.region)
    return rest_of_source(open_source(str(shared / row.images)), "auto").rest


def _results(shared: Path, row: Row, rest: Rest) -> Iterator[Result]:
    """Of a video's images, each followed from the one before; of a folder's stills, each a jump from rest."""
    source = open_source(str(shared / row.images)) if row.images else ()
    pipeline = Pipeline(rest)
    for frame in source:
        if isinstance(source, FolderSource):
            pipeline.forget()
        yield pipeline.process(frame)


def _row(shared: Path, row: Row) -> tuple[str, NDArray[np.uint8] | None]:
    """Its line of the table, and its panel of the picture, if it shows a contact."""
    by_eye = str(row.by_eye) if row.by_eye else "not counted"
    try:
        rest = _rest_of(shared, row)
    except NoPins:
        return f"| {row.title} | {by_eye} | 0 | 0 | | |", None
    held, touched_n, best = [], 0, None
    for result in _results(shared, row, rest):
        held.append(result.tracks.n_seen / len(rest))
        if result.features is None or not result.features.in_contact:
            continue
        touched_n += 1
        volume = result.features.volume_px2 or 0.0
        if held[-1] >= SEEN_REL and (best is None or volume > best[0]):
            best = volume, result
    false = str(max(0, len(rest) - row.by_eye)) if row.by_eye else ""
    share = f"{np.median(held):.0%} | {touched_n} of {len(held)}" if held else "|"
    line = f"| {row.title} | {by_eye} | {len(rest)} | {false} | {share} |"
    return line, None if best is None else _panel(row.title, rest, best[1])


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
    """Write the table of docs/sensors.md, and draw what is made of some sensors."""
    lines, panels = zip(*[_row(folder.parent, row) for row in CATALOGUE], strict=True)
    table = "\n".join([HEAD, "|---|---|---|---|---|---|", *lines])
    click.echo(table)
    before, after = PAGE.read_text(encoding="utf-8").split(HEAD, 1)
    PAGE.write_text(before + table + after[after.index("\n\n") :], encoding="utf-8")
    drawn = [panel for panel in panels if panel is not None]
    cv2.imwrite(str(out / "sensors.png"), np.hstack(drawn), [cv2.IMWRITE_PNG_COMPRESSION, 9])
