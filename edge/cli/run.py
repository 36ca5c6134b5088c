"""`edge run`: frames from a camera, samples onto the bus."""

import logging
from contextlib import ExitStack

import click

from edge.cli.assembly import make_loop, open_configured, start_worker
from edge.cli.options import LoopOptions, loop_options, source_option
from edge.cli.progress import waiting
from edge.cli.summary import print_summary
from edge.examples import example_calibration
from edge.sources.camera import CameraSource
from hostlink.cli_types import WholeNumber

log = logging.getLogger("edge")


@click.command()
@source_option
@loop_options
@click.option("--frames", "frames_max", type=WholeNumber(min=1), help="Stop after so many frames.")
@click.option("-q", "--quiet", is_flag=True, help="No closing statistics.")
@click.option("--json", "as_json", is_flag=True, help="Print the closing statistics as JSON.")
def run(
    options: LoopOptions, source_spec: str | None, frames_max: int | None, quiet: bool, as_json: bool
) -> None:
    """Run the finger: camera in, bus out, until stopped.

    Leave the tip untouched at the start: the first frames are its rest frame (tare). Stop with Ctrl-C
    or SIGTERM; what was measured and lost is then printed.
    """
    config = options.load_config(source_spec)
    options.check_record()
    listen = options.listen()
    with ExitStack() as stack:
        with waiting(f"opening {config.source.spec}", not quiet):
            source = open_configured(config.source)
            stack.callback(source.close)
            if isinstance(source, CameraSource) and not quiet:
                click.echo(f"{source.name}: {source.terms}", err=True)
            calibration_path = options.calibration_path or example_calibration(config.source.spec)
            loop = make_loop(stack, source, config, calibration_path)
        start_worker(stack, loop, options, listen, config)
        if not loop.sinks and listen is None and options.record_path is None:
            log.warning("no sink: samples are not sent; give --sink can:can0, or the key sinks in [link]")
        statistics = loop.run(frames_max)
        if loop.frames_n and loop.measurement.last is None and not quiet:
            log.warning("%s ended while the rest frame was being taken, no values", source.name)
        if not quiet or as_json:
            print_summary(statistics, loop.sinks, as_json)
