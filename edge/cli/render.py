"""`edge render`: a recording as the paper's video: every frame through the loop and into a picture.

What is sent of a frame is shown; one without values with its image and without cells.
"""

import logging
from collections.abc import Iterator
from contextlib import closing
from itertools import islice
from math import hypot, isnan, nan
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from edge.calibration import Calibration, uncalibrated
from edge.cells import cell_polygons
from edge.cli.assembly import expect_sensor, load_calibration, rest_given
from edge.cli.options import PATH, calibration_option, overwrite_option, rest_option, sensor_option
from edge.cli.progress import counting
from edge.cli.summary import damage_of, json_line
from edge.config import Config, SensorTable
from edge.errors import CalibrationError, SourceError
from edge.examples import example_calibration
from edge.rest.tare import TareParams, TareRefused
from edge.runtime.loop import Loop
from edge.runtime.measurement import LoopConfig
from edge.sources import open_source
from edge.sources.files import FileSource
from edge.types import Frame, Rest, Result, Tracks
from edge.view.palette import PALETTES
from edge.view.panels import View, picture
from edge.view.video import CODECS, write_video
from hostlink.cli_types import FiniteFloat, WholeNumber, counted
from hostlink.output_file import check_output, writing
from hostlink.wire import RestFrameReason

log = logging.getLogger(__name__)


@click.command()
@click.argument("recording")
@click.option("-o", "--out", required=True, type=PATH, help=".mp4, .webm, .mkv or .avi")
@calibration_option
@sensor_option
@click.option(
    "--palette",
    type=click.Choice(list(PALETTES)),
    default="paper",
    show_default=True,
    help="safe: orange and blue, for colour-blind readers.",
)
@click.option("--rate", "rate_hz", type=FiniteFloat(1, 240), help="Pictures a second; else as recorded.")
@click.option("--height", type=WholeNumber(120, 2160), default=640, show_default=True, help="A panel's, px.")
@rest_option
@overwrite_option
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
@click.option("-q", "--quiet", is_flag=True, help="No progress, no closing line.")
def render(
    recording: str,
    out: Path,
    calibration_path: Path | None,
    overwrite: bool,
    as_json: bool,
    quiet: bool,
    **options: Any,
) -> None:
    """Make a video of RECORDING: cells, contacts and shear beside the camera's image.

    The first frames must show the untouched tip: they are the rest frame, unless --rest says another.
    """
    check_output(out, tuple(CODECS), filter(None, (recording, calibration_path)), overwrite)
    calibration = load_calibration(calibration_path or example_calibration(recording))
    with writing(out, overwrite) as unfinished:
        progress = not (quiet or as_json)
        made = render_recording(recording, unfinished, calibration, progress=progress, **options)
    if as_json:
        click.echo(json_line(made))
    elif not quiet:
        why = ", ".join(f"{name} {n}" for name, n in made["without_values"].items())
        lacking = f"{sum(made['without_values'].values())} without values" + (f" ({why})" if why else "")
        click.echo(f"{out}: {counted(made['frames_n'], 'frame')} at {made['rate_hz']:g} Hz, {lacking}")


def render_recording(
    recording: str,
    out: Path,
    calibration: Calibration | None = None,
    *,
    palette: str = "paper",
    rate_hz: float | None = None,
    height: int = 640,
    progress: bool = False,
    rest: str | None = None,
    sensor_name: str | None = None,
) -> dict[str, Any]:
    """Write the video, with the options of `render`; height of a panel, px.

    Returns  frames_n in the video; pins_n of the rest frame; rate_hz of the pictures; without_values, frames
             by the fault that explains it
    Raises   ConfigError: the sensor; InputError: recording, first frames or calibration; SinkError; OSError
    """
    with closing(open_source(recording)) as source:
        known = expect_sensor(source, Config(sensor=SensorTable(model=sensor_name or "")))
        on_surface = known is not None and known.on_surface
        loop = Loop(source, [], calibration, LoopConfig(on_surface=on_surface))
        loop.measurement.watch("video")
        rest_frame, seen_in, taken_n = _rest_frame(loop, rest, calibration)
        mm_per_px = (calibration.mm_per_px if calibration else None) or 0.0
        pattern, colours = rest_frame.pattern, PALETTES[palette]
        view = View.of(rest_frame.xy_img, pattern.pitch_px, height, mm_per_px, colours)
        loop.measurement.use_rest(rest_frame, seen_in)
        n_pins = len(rest_frame)
        lost = Tracks.of(np.full((n_pins, 2), np.nan), np.full(n_pins, np.nan), np.zeros(n_pins, np.bool_), 0)
        rate_hz = rate_hz or source.rate_hz or 30.0
        total_n = 0
        if isinstance(source, FileSource):
            total_n, source.keeps_colour = source.frames_n, True
        with counting(out.name, total_n, progress) as count:

            def pictures() -> Iterator[NDArray[np.uint8]]:
                for n, frame in enumerate(source, 1):
                    if n == taken_n:  # `replay` begins here, and what is learnt since must be the same
                        loop.measurement.use_rest(rest_frame, seen_in)
                    loop.step(frame)
                    result = loop.measurement.last
                    if result is None or result.frame is not frame:  # it could not be measured
                        result = Result(frame, lost, None, None, uncalibrated(), False)
                    polygons = cell_polygons(result.cells) if result.cells is not None else []
                    text = caption(result)
                    yield picture(view, frame, result.tracks, polygons, result.features, text)
                    count(n)

            frames_n = write_video(pictures(), out, rate_hz)
    if damage := damage_of(source):
        log.warning("%s: %s", recording, damage)
    return {
        "frames_n": frames_n, "pins_n": n_pins, "rate_hz": rate_hz,
        "without_values": loop.statistics().without_values,
    }  # fmt: skip


def _rest_frame(loop: Loop, how: str | None, calibration: Calibration | None) -> tuple[Rest, Frame, int]:
    """The rest frame, an image that shows it, and of how many first images it is. Raises SourceError,
    CalibrationError.
    """
    source = loop.source
    if source.live:
        raise SourceError(f"{source.name}: is live; record it first, then render the recording")
    given = rest_given(source, how, calibration)
    if given is not None:
        log.info("rest frame: %s", given.message)
        return given.rest, given.frame, 0
    frames = list(islice(source, TareParams().frames_n))
    if not frames:
        raise SourceError(f"{source.name}: no images")
    try:
        rest = loop.measurement.take_rest_frame(frames, calibration).rest
    except TareRefused as error:
        kind = CalibrationError if error.reason is RestFrameReason.OTHER_TIP else SourceError
        raise kind(f"{source.name}: {error.problem}") from None
    return rest, frames[-1], len(frames)


def caption(result: Result) -> str:
    """The calibrated values of a frame in two lines, some with their errors; empty without any."""
    values, sigmas = result.reading.values, result.reading.sigmas
    shear_mm = hypot(values.get("shear_x_mm", nan), values.get("shear_y_mm", nan))
    tangential_n = hypot(values.get("force_x_n", nan), values.get("force_y_n", nan))
    rows = (
        ("depth", values.get("displacement_mm", nan), sigmas.get("displacement_mm", nan), "mm"),
        ("shear", shear_mm, nan, "mm"),
        ("torsion", values.get("torsion_deg", nan), nan, "deg"),
        ("force", values.get("force_n", nan), nan, "N"),
        ("tangential", tangential_n, nan, "N"),
        ("torque", values.get("torque_z_nmm", nan), sigmas.get("torque_z_nmm", nan), "N mm"),
    )
    parts = []
    for name, value, sigma, unit in rows:
        if not isnan(value):
            spread = "" if isnan(sigma) else f" +-{sigma:.2f}"
            parts.append(f"{name} {value:.2f}{spread} {unit}")
    return "\n".join("   ".join(parts[k : k + 3]) for k in (0, 3)).strip()
