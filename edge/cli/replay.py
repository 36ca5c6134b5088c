"""`edge replay`: a recording instead of a camera."""

from __future__ import annotations

import logging
from contextlib import ExitStack
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from edge.cli.assembly import make_loop, start_worker
from edge.cli.options import LoopOptions, SpeedFactor, loop_options, rest_option
from edge.cli.progress import counting, waiting
from edge.cli.summary import Summary, damage_of, json_line, print_summary
from edge.errors import InputError
from hostlink.cli_exit import print_error
from hostlink.cli_types import counted

if TYPE_CHECKING:
    from edge.runtime.loop import Loop
    from edge.types import FrameSource, Result
    from hostlink.wire import State

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
    """Send RECORDING (MCAP, video, folder of images) as if it were live.

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
            source, total_n = _open(recording, speed, again, config.tare.frames_n)
            stack.callback(source.close)
            loop = make_loop(stack, source, config, options.sink_specs, options.calibration_path)
            _use_rest(loop, recording, rest, quiet)
            url = start_worker(stack, loop, options, listen, config)
        if url:
            click.echo(f"live page: {url}", err=True)
        summary, passed, printer = Summary(), _PassedBefore(source), _SamplePrinter(loop)
        loop.result_callbacks += [summary.add, passed.note, *([printer.print] if samples else [])]
        with counting("replay", total_n, not (quiet or samples or again)) as count:
            loop.tick_callbacks.append(lambda: count(loop.frames_n))
            statistics = loop.run()
        printer.raise_failure()
        if not quiet or as_json:
            print_summary(statistics, loop.sinks, as_json, summary.report())
        for message in (damage_of(source), _lost_to_tare(loop, passed.skipped_n)):
            if message:
                log.warning("%s: %s", recording, message)
        if message := _no_values(loop, config.tare.frames_n):
            raise SystemExit(print_error(f"{recording}: {message}", 1))


def _use_rest(loop: Loop, recording: str, how: str | None, quiet: bool) -> None:
    """Use another rest frame than the first images, if one is asked for or they show a touch.

    Raises  SourceError, CalibrationError
    """
    from contextlib import closing

    from edge.rest.choice import rest_if_touched, rest_of_source
    from edge.sources import open_source

    with closing(open_source(recording)) as source:
        source.polarity, source.lens = loop.source.polarity, loop.source.lens
        if how is not None:
            given = rest_of_source(source, how, loop.calibration)
        elif source.live or (found := rest_if_touched(source, loop.calibration)) is None:
            return
        else:
            given = found
    loop.measurement.use_rest(given.rest, given.frame)
    if not quiet:
        click.echo(f"rest frame: {given.message}", err=True)


def _open(recording: str, speed: float | str, again: bool, rest_n: int) -> tuple[FrameSource, int]:
    """The source, and how many frames it has; 0: not known. Raises SourceError.

    rest_n  images of the rest frame, of which none may be missed
    """
    from edge.sources import Paced, open_source
    from edge.types import RecordedSource

    source = open_source(recording)
    total_n = source.frames_n if isinstance(source, RecordedSource) else 0
    if isinstance(speed, str):
        return source, total_n
    return Paced(source, speed=speed, loop=again, rest_n=rest_n), total_n


class _PassedBefore:
    """Counts the images before the first result.

    skipped_n  None: there was no result
    """

    def __init__(self, source: FrameSource) -> None:
        self._source = source
        self.skipped_n: int | None = None

    def note(self, result: Result, state: State) -> None:
        if self.skipped_n is None:
            self.skipped_n = self._source.dropped_n


class _SamplePrinter:
    """Prints samples; stops the loop if stdout is closed (`| head -1`) or its disk is full."""

    def __init__(self, loop: Loop) -> None:
        self._loop = loop
        self._failure: OSError | None = None

    def print(self, result: Result, state: State) -> None:
        if self._failure is None:
            try:
                click.echo(json_line(asdict(state)))
            except OSError as error:
                self._failure = error
                self._loop.stop()

    def raise_failure(self) -> None:
        """Raise the error of stdout, for `run_command`."""
        if self._failure is not None:
            raise self._failure


def _no_values(loop: Loop, tare_n: int) -> str:
    """Message if the whole recording gave no values; else empty."""
    if loop.last is not None or not _played_to_its_end(loop):
        return ""
    return (
        f"ended while the rest frame was being taken ({counted(tare_n, 'image')} and a search), "
        f"no values; {_way_out(loop)}"
    )


def _lost_to_tare(loop: Loop, skipped_n: int | None) -> str:
    """Message on the part of a recording that the tare took; empty: no more than its own images."""
    if not skipped_n or not _played_to_its_end(loop):
        return ""
    return f"{counted(skipped_n, 'image')} passed while the rest frame was being taken; {_way_out(loop)}"


def _played_to_its_end(loop: Loop) -> bool:
    """False: it was stopped."""
    from edge.types import LiveSource

    return loop.frames_n > 0 and (not isinstance(loop.source, LiveSource) or loop.source.ended)


def _way_out(loop: Loop) -> str:
    from edge.types import LiveSource

    paced = isinstance(loop.source, LiveSource)
    return "--loop plays it on, --speed max takes every image" if paced else "replay a longer one"
