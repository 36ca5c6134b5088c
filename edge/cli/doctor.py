"""`edge doctor`: checks everything that a finger needs. One line a topic: ok, warn or fail, and advice.

It changes nothing. A topic that cannot be checked because another failed is skipped, not guessed.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

import click

from edge.cli import checks, options, picture
from edge.cli.assembly import expect_sensor, open_configured
from edge.cli.checks import Line, worst
from edge.cli.machine import Machine
from edge.cli.progress import waiting
from edge.config import Config
from edge.errors import InputError, NoPins
from edge.examples import example_calibration
from edge.rest.tare import PARAMS as TARE
from edge.rest.tare import take_rest_frame
from edge.types import FrameSource


@click.command()
@options.config_option
@options.source_option
@options.sink_option
@options.calibration_option
@options.sensor_option
@click.option("--json", "as_json", is_flag=True, help="Print the lines as JSON.")
def doctor(
    config_path: Path | None,
    source_spec: str | None,
    sink_specs: Sequence[str],
    calibration_path: Path | None,
    sensor_name: str | None,
    as_json: bool,
) -> None:
    """Check camera, pins, calibration, link, processor, clock and disk.

    Prints ok, warn or fail for each, and advice. Leave the tip untouched, and stop the service, which
    holds the camera. Exit code 1 if something fails, 0 otherwise.
    """
    from edge.runtime.calibration_store import CalibrationStore

    config = options.configured(config_path, sensor_name, sink_specs, source_spec)
    chosen = example_calibration(str(calibration_path or config.source.spec)) or calibration_path
    chosen = chosen or (Path(config.calibration.file) if config.calibration.file else None)
    if config.state.directory and not calibration_path:
        stored = CalibrationStore(Path(config.state.directory)).path
        chosen = stored if stored.is_file() else chosen
    with waiting("checking camera, link and machine", not as_json):
        lines = examine(config, lambda: open_configured(config.source), chosen, Machine())
    if as_json:
        click.echo(json.dumps({"worst": worst(lines), "lines": [asdict(line) for line in lines]}))
    else:
        checks.print_lines(lines)
    raise SystemExit(worst(lines) == "fail")


def examine(
    config: Config, open_camera: Callable[[], FrameSource], calibration_path: Path | None, machine: Machine
) -> list[Line]:
    """Run all checks, in the order of the data flow. `open_camera` may raise SourceError."""
    lines: list[Line] = []
    rest, tare, images = None, TARE, []
    try:
        source = open_camera()
    except InputError as error:
        advice = "check cable, power and [source] spec; is the service running?"
        lines.append(Line("camera", "fail", str(error), advice))
        size_px = config.source.width, config.source.height
        asked_hz = config.source.rate_hz
    else:
        size_px = source.size_px
        sensor = expect_sensor(source, config)
        try:
            frames = picture.watch(source)
        finally:
            source.close()
        asked_hz = config.source.rate_hz or source.rate_hz
        lines += checks.camera(source, frames, config)
        if frames:
            tare, images = TARE.of(source), [f.image for f in frames[: TARE.frames_n]]
            try:
                rest = tare.take(images)
            except NoPins as error:
                lines.append(Line("pins", "fail", str(error), "focus the lens, set [source] roi to the skin"))
            else:
                lines += [*picture.pins(frames[-1], rest), checks.sensor(rest, sensor)]
            lines.append(picture.brightness(frames, rest))
    lines += checks.calibration(calibration_path, rest, partial(take_rest_frame, images, tare))
    for spec in config.link.sinks:
        lines += checks.link(spec, machine)
    if not config.link.sinks:
        advice = 'set [link] sinks, e.g. ["can:can0"]'
        lines.append(Line("link", "warn", "no sink: samples are not sent", advice))
    lines += [
        *checks.processor(machine),
        checks.clock(machine),
        *checks.disk(config, size_px, asked_hz, machine),
    ]
    return lines
