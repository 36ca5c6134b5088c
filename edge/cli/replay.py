"""`edge replay`: a recording instead of a camera."""

import logging
from contextlib import ExitStack, closing
from dataclasses import asdict

import click

from edge.cli.assembly import make_loop, rest_given, start_worker
from edge.cli.options import LoopOptions, SpeedFactor, loop_options, rest_option
from edge.cli.progress import counting, waiting
from edge.cli.summary import Summary, damage_of, json_line, print_summary
from edge.errors import CalibrationError, InputError
from edge.examples import example_calibration
from edge.runtime.loop import Loop
from edge.sources import open_source
from edge.sources.files import FileSource
from edge.sources.live import ThreadedSource
from edge.sources.paced import Paced
from edge.types import Result
from hostlink.cli_types import counted
from hostlink.wire import FaultCode, State

log = logging.getLogger("edge")


@click.command()
@click.argument("recording")
@loop_options
@click.option(
    "--speed", type=SpeedFactor(), default="1", show_default=True, metavar="FACTOR|max",
    help="1 as recorded, 2 twice as fast.",
)  # fmt: skip
@click.option("--loop", "again", is_flag=True, help="Start again when it ends, until stopped.")
@rest_option
@click.option("--samples", is_flag=True, help="Print every sample as a line of JSON.")
@click.option("-q", "--quiet", is_flag=True, help="No closing summary.")
@click.option("--json", "as_json", is_flag=True, help="Print the closing summary as JSON.")
def replay(
    options: LoopOptions,
    recording: str,
    speed: float | str,
    again: bool,
    rest: str | None,
    samples: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    """Send RECORDING (MCAP, video, folder of images, example:press) as if it were live.

    The first frames must show the untouched tip: they are the rest frame, unless --rest says another. If
    they are seen to show a touch, the rest frame is chosen as by --rest auto. A closing summary lists the
    pins that were seen, the shear in px and, with a calibration, the depth in mm.
    """
    if again and isinstance(speed, str):
        raise InputError("--loop: has no end at --speed max; give a factor")
    config = options.load_config()
    options.check_record(recording)
    listen = options.listen()
    with ExitStack() as stack:
        with waiting(f"opening {recording}", not quiet):
            source = open_source(recording)
            total_n = source.frames_n if isinstance(source, FileSource) else 0
            if not isinstance(speed, str):  # of the rest frame no image may be missed
                source = Paced(source, speed=speed, loop=again, rest_n=config.tare.frames_n)
            stack.callback(source.close)
            calibration_path = options.calibration_path or example_calibration(recording)
            loop = make_loop(stack, source, config, calibration_path)
            _use_rest(loop, recording, rest, quiet)
        start_worker(stack, loop, options, listen, config)
        summary = Summary(source)
        loop.result_callbacks.append(summary.add)
        failures = _print_samples(loop) if samples else []
        with counting("replay", total_n, not (quiet or samples or again)) as count:
            loop.tick_callbacks.append(lambda: count(loop.frames_n))
            statistics = loop.run()
        for failure in failures:
            raise failure
        if damage := damage_of(source):
            log.warning("%s: %s", recording, damage)
        lost = _lost_to_tare(loop, summary.skipped_n, config.tare.frames_n)
        if lost and summary.skipped_n is None:
            raise InputError(f"{recording}: {loop.faults.active.get(FaultCode.TARE_IMPLAUSIBLE, lost)}")
        if not quiet or as_json:
            print_summary(statistics, loop.sinks, as_json, summary.report())
        if lost:
            log.warning("%s: %s", recording, lost)


def _use_rest(loop: Loop, recording: str, how: str | None, quiet: bool) -> None:
    """Take another rest frame if one is asked for or the first images show a touch.

    Raises  InputError: also where the tare would, before a page or a recording begins
    """
    with closing(open_source(recording)) as source:
        source.polarity, source.lens = loop.source.polarity, loop.source.lens
        source.region = loop.source.region
        try:
            given = rest_given(source, how, loop.measurement.calibration)
        except CalibrationError:
            if how is not None or not loop.measurement.fallbacks:
                raise
            given = None  # a calibration stored before may be this tip's
    if given is not None:
        loop.measurement.use_rest(given.rest, given.frame)
        if not quiet:
            click.echo(f"rest frame: {given.message}", err=True)


def _print_samples(loop: Loop) -> list[OSError]:
    """Print each sample; stop the loop, and give the error, where stdout fails (`| head -1`, a full disk)."""
    failures: list[OSError] = []

    def print_one(result: Result, state: State) -> None:
        if not failures:
            try:
                click.echo(json_line(asdict(state)))
            except OSError as error:
                failures.append(error)
                loop.stop()

    loop.result_callbacks.append(print_one)
    return failures


def _lost_to_tare(loop: Loop, skipped_n: int | None, tare_n: int) -> str:
    """Message on the images that passed while the rest frame was taken; "": none did, or it was stopped.

    skipped_n  images before the first result; None: there was no result
    """
    paced = loop.source if isinstance(loop.source, ThreadedSource) else None
    if skipped_n == 0 or not loop.frames_n or (paced and not paced.ended):
        return ""
    way_out = "--loop plays it on" if paced else "replay a longer one"
    if paced and loop.frames_n + paced.dropped_n > tare_n:
        way_out += ", --speed max takes every image"
    if skipped_n is None:
        took = f"{counted(tare_n, 'image')} and a search"
        return f"ended while the rest frame was being taken ({took}), no values; {way_out}"
    return f"{counted(skipped_n, 'image')} passed while the rest frame was being taken; {way_out}"
