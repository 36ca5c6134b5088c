"""`edge render`: a recording as the paper's video: every frame through the pipeline and into a picture.

A frame whose pins cannot be identified is shown with its image and without cells.
"""

import logging
from collections.abc import Iterator
from contextlib import closing
from dataclasses import asdict, dataclass
from itertools import islice
from math import hypot, isnan, nan
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray

from edge.calibration import Calibration
from edge.cells import cell_polygons
from edge.cli.assembly import load_calibration, rest_given
from edge.cli.options import PATH, calibration_option, overwrite_option, rest_option
from edge.cli.progress import counting
from edge.cli.summary import damage_of, json_line
from edge.errors import NoPins, SourceError
from edge.examples import example_calibration
from edge.frame import Pipeline
from edge.rest.tare import TareParams, tare
from edge.sources import open_source
from edge.types import Feature, FrameSource, RecordedSource, Rest, Result
from edge.view.palette import PAPER, SAFE
from edge.view.panels import View, picture
from edge.view.video import CODECS, write_video
from hostlink.cli_types import FiniteFloat, WholeNumber, counted
from hostlink.output_file import check_output, writing

log = logging.getLogger(__name__)

PALETTES = {"paper": PAPER, "safe": SAFE}
#: Features in a picture; the surface is not drawn.
DRAWN = frozenset(Feature) - {Feature.SURFACE}


@click.command()
@click.argument("recording")
@click.option("-o", "--out", required=True, type=PATH, help=".mp4, .webm, .mkv or .avi")
@calibration_option
@click.option(
    "--palette",
    type=click.Choice(["paper", "safe"]),
    default="paper",
    show_default=True,
    help="safe: orange and blue, for colour-blind readers.",
)
@click.option("--rate", "rate_hz", type=FiniteFloat(1, 240), help="Pictures a second; else as recorded.")
@click.option("--height", type=WholeNumber(120, 2160), default=640, show_default=True, help="Of a panel, px.")
@rest_option
@overwrite_option
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
@click.option("-q", "--quiet", is_flag=True, help="No progress, no closing line.")
def render(
    recording: str,
    out: Path,
    calibration_path: Path | None,
    palette: str,
    rate_hz: float | None,
    height: int,
    rest: str | None,
    overwrite: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Make a video of RECORDING: cells, contacts and shear beside the camera's image.

    The first frames must show the untouched tip: they are the rest frame, unless --rest says another.
    """
    check_output(out, tuple(CODECS), filter(None, (recording, calibration_path)), overwrite)
    style = Style(palette, rate_hz, height)
    calibration = load_calibration(calibration_path or example_calibration(recording))
    with writing(out, overwrite) as unfinished:
        made = render_recording(recording, unfinished, calibration, style, not (quiet or as_json), rest)
    if as_json:
        click.echo(json_line(asdict(made)))
    elif not quiet:
        click.echo(
            f"{out}: {counted(made.frames_n, 'frame')} at {made.rate_hz:g} Hz, "
            f"{made.unidentified_n} without values"
        )


@dataclass(frozen=True, slots=True)
class Style:
    palette: str = "paper"  # "paper" or "safe"
    rate_hz: float | None = None  # pictures a second; None: the recording's own
    height: int = 640  # of a panel, px


@dataclass(frozen=True, slots=True)
class Made:
    frames_n: int  # in the video
    unidentified_n: int  # of them without values, because the pins could not be identified
    pins_n: int  # of the rest frame
    rate_hz: float  # pictures a second


def render_recording(
    recording: str,
    out: Path,
    calibration: Calibration | None = None,
    style: Style | None = None,
    progress: bool = False,
    rest: str | None = None,
) -> Made:
    """Write the video.

    progress  show a bar on stderr
    rest      "auto", "none" or the number of an image; None: the rest frame is made of the first images,
              if they do not show a touch
    Raises    SourceError: no such recording, or no pins in its first frames; SinkError: cannot be written;
              OSError: the disk is full; CalibrationError: of another tip
    """
    style = style or Style()
    with closing(open_source(recording)) as source:
        rest_frame = _rest_frame(source, rest, calibration)
        mm_per_px = (calibration.mm_per_px if calibration else None) or 0.0
        palette = PALETTES[style.palette]
        view = View.of(rest_frame.xy_img, rest_frame.pattern.pitch_px, style.height, mm_per_px, palette)
        pipeline = Pipeline(rest_frame, calibration, DRAWN)
        rate_hz = style.rate_hz or source.rate_hz or 30.0
        total_n = source.frames_n if isinstance(source, RecordedSource) else 0
        unidentified_n = 0
        with counting(out.name, total_n, progress) as count:

            def pictures() -> Iterator[NDArray[np.uint8]]:
                nonlocal unidentified_n
                for n, frame in enumerate(source, 1):
                    result = pipeline.process(frame)
                    unidentified_n += result.features is None
                    polygons = cell_polygons(result.cells) if result.cells is not None else []
                    text = caption(result)
                    yield picture(view, frame, result.tracks, polygons, result.features, text)
                    count(n)

            frames_n = write_video(pictures(), out, rate_hz)
    if damage := damage_of(source):
        log.warning("%s: %s", recording, damage)
    return Made(frames_n, unidentified_n, len(rest_frame), rate_hz)


def _rest_frame(source: FrameSource, how: str | None, calibration: Calibration | None) -> Rest:
    """Raises SourceError, CalibrationError."""
    if source.live:
        raise SourceError(f"{source.name}: is live; record it first, then render the recording")
    given = rest_given(source, how, calibration)
    if given is not None:
        log.info("rest frame: %s", given.message)
        return given.rest
    images = [frame.image for frame in islice(source, TareParams().frames_n)]
    if not images:
        raise SourceError(f"{source.name}: no images")
    try:
        return tare(images, np.inf, calibration, source.polarity, source.lens)
    except NoPins as error:
        raise SourceError(f"{source.name}: {error}") from None


def caption(result: Result) -> str:
    """The calibrated values of a frame in a line, some with their errors; empty without any."""
    values, sigmas = result.reading.values, result.reading.sigmas
    shear_mm = hypot(values.get("shear_x_mm", nan), values.get("shear_y_mm", nan))
    tangential_n = hypot(values.get("force_x_n", nan), values.get("force_y_n", nan))
    rows = (
        ("depth", values.get("displacement_mm", nan), sigmas.get("displacement_mm", nan), "mm"),
        ("shear", shear_mm, nan, "mm"),
        ("force", values.get("force_n", nan), nan, "N"),
        ("tangential", tangential_n, nan, "N"),
        ("torque", values.get("torque_z_nmm", nan), sigmas.get("torque_z_nmm", nan), "N mm"),
        ("torsion", values.get("torsion_deg", nan), nan, "deg"),
    )
    parts = []
    for name, value, sigma, unit in rows:
        if not isnan(value):
            spread = "" if isnan(sigma) else f" +-{sigma:.2f}"
            parts.append(f"{name} {value:.2f}{spread} {unit}")
    return "   ".join(parts)
