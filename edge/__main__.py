"""`python -m edge`: the finger's own program.

    run      frames from a camera, samples onto the bus
    replay   a recording instead of a camera
    render   a recording as a video
    inspect  what the pin detection sees in an image
    doctor   is everything there that a finger needs, and what to do where it is not

A user's mistake is one line on stderr and exit code 2. Heavy modules load with the command that needs them.
"""

from __future__ import annotations

import json
import logging
import math
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from edge.errors import ConfigError, EdgeError, SourceError, UsageError
from edge.leave import run_and_leave
from edge.progress import counting, waiting
from edge.threads import share_the_processor
from hostlink.ending import complain, program_name, run_command

if TYPE_CHECKING:
    from edge.app import App
    from edge.calibration import Calibration
    from edge.config import Config
    from edge.node import Node
    from edge.pipeline import Result
    from edge.statistics import Statistics
    from edge.types import FrameSource
    from hostlink.wire import State

log = logging.getLogger("edge")

SINK_HELP = (
    "Where samples go; may be given more than once. can:can0, can:can0?fd=0, virtual:NAME, "
    "udp:239.0.0.1, serial:/dev/ttyACM0?baud=921600, slcan:/dev/ttyACM0, memory:"
)
SOURCE_HELP = "v4l2:0, /dev/video0, oak:, sim:press, or a file. Default: the configuration's, else v4l2:0."


def view_options(command: Callable[..., None]) -> Callable[..., None]:
    """What the commands with a live page share."""
    for option in (
        click.option(
            "--recordings",
            type=click.Path(path_type=Path, file_okay=False),
            help="Folder for what the page's record button makes. Default: in the state folder, else here.",
        ),
        click.option(
            "--view-token",
            metavar="TOKEN|auto",
            help="Let the page tare and record, with this token of 8 characters or more; auto makes one.",
        ),
        click.option(
            "--view-at",
            metavar="HOST:PORT",
            help="Serve the live page there; beyond this machine only with a token.",
        ),
        click.option(
            "--view",
            "view_here",
            is_flag=True,
            help="Serve a live page at 127.0.0.1:8765, or where --view-at says.",
        ),
    ):
        command = option(command)
    return command


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.option("-v", "--verbose", is_flag=True, help="Say more about what goes on.")
@click.version_option(package_name="voronoi-touch")
def cli(verbose: bool) -> None:
    """Reads touch from the pins of a camera-based fingertip and sends it over CAN, CAN FD or serial.

    \b
    First steps without hardware:
      python -m edge inspect IMAGE                    which pins are seen in a picture of a tip
      python -m edge replay RECORDING --sink memory:  a recording through the whole chain
    With a camera and a bus:
      python -m edge run --source v4l2:0 --sink can:can0 --calibration tip.json
    """
    logging.basicConfig(
        level=logging.INFO if verbose else logging.WARNING, format="%(levelname)s %(name)s: %(message)s"
    )


@cli.command()
@click.option(
    "-c", "--config", "config_path", type=click.Path(path_type=Path), help="TOML file; see deploy/."
)
@click.option("--source", "source_spec", help=SOURCE_HELP)
@click.option("--sink", "sink_specs", multiple=True, help=SINK_HELP)
@click.option("--calibration", "calibration_path", type=click.Path(path_type=Path), help="Calibration file.")
@click.option(
    "--record", "record_path", type=click.Path(path_type=Path), help="Write images and values to MCAP."
)
@view_options
@click.option("--frames", "frames_max", type=click.IntRange(min=1), help="Stop after so many frames.")
@click.option("-q", "--quiet", is_flag=True, help="No closing statistics.")
@click.option("--json", "as_json", is_flag=True, help="Print the closing statistics as JSON.")
def run(
    config_path: Path | None,
    source_spec: str | None,
    sink_specs: Sequence[str],
    calibration_path: Path | None,
    record_path: Path | None,
    frames_max: int | None,
    quiet: bool,
    as_json: bool,
    view_here: bool,
    view_at: str | None,
    view_token: str | None,
    recordings: Path | None,
) -> None:
    """Run the finger: camera in, bus out, until stopped.

    Leave the tip untouched at the start: the first frames are its rest frame (tare). Stop with Ctrl-C
    or SIGTERM; what was measured and lost is then printed.
    """
    from edge.config import load_config
    from edge.sources import open_source

    config = load_config(config_path)
    with ExitStack() as stack:
        s = config.source
        spec = source_spec or s.spec
        with waiting(f"opening {spec}", not quiet):
            source = open_source(
                spec,
                width=s.width,
                height=s.height,
                rate_hz=s.rate_hz,
                exposure_us=s.exposure_us,
                gain=s.gain,
            )
            stack.callback(source.close)
            app = _app(stack, source, config, sink_specs, calibration_path)
            view = view_at or ("" if view_here else None)
            url = _aside(stack, app, config, record_path, view, view_token, recordings)
        if url:
            click.echo(f"live page: {url}", err=True)
        elif not app.sinks and record_path is None:
            log.warning("nobody will hear: no sink; give --sink can:can0, or the key sinks in [link]")
        _finish(app.run(frames_max), app, as_json, quiet)


@cli.command()
@click.argument("recording")
@click.option(
    "-c", "--config", "config_path", type=click.Path(path_type=Path), help="TOML file; see deploy/."
)
@click.option("--sink", "sink_specs", multiple=True, help=SINK_HELP)
@click.option("--calibration", "calibration_path", type=click.Path(path_type=Path), help="Calibration file.")
@click.option(
    "--speed", default="1", show_default=True, metavar="FACTOR|max", help="1 as recorded, 2 twice as fast."
)
@click.option(
    "--record", "record_path", type=click.Path(path_type=Path), help="Write images and values to MCAP."
)
@click.option("--loop", is_flag=True, help="Again from its start when it ends, until stopped.")
@view_options
@click.option("--samples", is_flag=True, help="Print every sample as a line of JSON.")
@click.option("-q", "--quiet", is_flag=True, help="No closing summary.")
@click.option("--json", "as_json", is_flag=True, help="Print the closing summary as JSON.")
def replay(
    recording: str,
    config_path: Path | None,
    sink_specs: Sequence[str],
    calibration_path: Path | None,
    speed: str,
    record_path: Path | None,
    loop: bool,
    samples: bool,
    quiet: bool,
    as_json: bool,
    view_here: bool,
    view_at: str | None,
    view_token: str | None,
    recordings: Path | None,
) -> None:
    """Send RECORDING (MCAP, video, folder of images) as if it were live.

    The first frames must show the untouched tip: they are the rest frame. At the end stands what was
    held and seen: pins, identities lost, shear in px and, with a calibration, in mm.
    """
    from edge.config import load_config
    from edge.sources import open_source
    from edge.summary import Summary, damage_of

    factor = _speed(speed)
    if loop and factor is None:
        raise SourceError("--loop: has no end at --speed max; give a factor")
    config = load_config(config_path)
    with ExitStack() as stack:
        with waiting(f"opening {recording}", not quiet):
            source: FrameSource = open_source(recording)
            total_n = getattr(source, "frames_n", 0)
            if factor is not None:
                from edge.sources import Paced

                source = Paced(source, speed=factor, loop=loop)
            stack.callback(source.close)
            app = _app(stack, source, config, sink_specs, calibration_path)
            view = view_at or ("" if view_here else None)
            url = _aside(stack, app, config, record_path, view, view_token, recordings)
        if url:
            click.echo(f"live page: {url}", err=True)
        summary = Summary()
        app.watchers.append(summary.add)
        skipped_n: list[int] = []  # before the first result
        app.watchers.append(lambda *_: skipped_n.append(source.dropped_n) if not skipped_n else None)
        if samples:
            app.watchers.append(lambda result, state: click.echo(_line(asdict(state))))
        shown = not (quiet or samples or loop)
        with counting("replay", total_n, shown) as count:
            app.turns.append(lambda: count(app.frames_n))
            statistics = app.run()
        _finish(statistics, app, as_json, quiet, summary.report())
        for words in filter(None, (damage_of(source), _missed(app, config.tare.frames_n, skipped_n))):
            log.warning("%s: %s", recording, words)


@cli.command()
@click.argument("recording")
@click.option("-o", "--out", required=True, type=click.Path(path_type=Path), help=".mp4, .webm, .mkv or .avi")
@click.option("--calibration", "calibration_path", type=click.Path(path_type=Path), help="Calibration file.")
@click.option(
    "--palette",
    type=click.Choice(["paper", "safe"]),
    default="paper",
    show_default=True,
    help="safe: orange and blue, which most colour-blind readers tell apart.",
)
@click.option("--rate", "rate_hz", type=click.FloatRange(1, 240), help="Pictures a second; else as recorded.")
@click.option(
    "--height", type=click.IntRange(120, 2160), default=640, show_default=True, help="Of a panel, px."
)
@click.option("--json", "as_json", is_flag=True, help="Print what was made as JSON.")
@click.option("-q", "--quiet", is_flag=True, help="No progress, no closing line.")
def render(
    recording: str,
    out: Path,
    calibration_path: Path | None,
    palette: str,
    rate_hz: float | None,
    height: int,
    as_json: bool,
    quiet: bool,
) -> None:
    """Make a video of RECORDING: cells, contacts and shear beside the camera's image.

    The first frames must show the untouched tip: they are the rest frame.
    """
    from edge.render import render_recording

    made = render_recording(
        recording, out, _calibration(calibration_path), palette, rate_hz, height, not (quiet or as_json)
    )
    if as_json:
        click.echo(_line(asdict(made)))
    elif not quiet:
        click.echo(f"{out}: {made.frames_n} frames at {made.rate_hz:g} Hz, {made.unsure_n} without values")


@cli.command()
@click.argument("images", nargs=-1, required=True, metavar="IMAGE...", type=click.Path(path_type=Path))
@click.option(
    "--json", "as_json", is_flag=True, help='Print [{"image":..., "n_pins":..., "xy_px":[[x,y],...]}].'
)
@click.option("--overlay", type=click.Path(path_type=Path), help="Folder for pictures with the pins marked.")
def inspect(images: Sequence[Path], as_json: bool, overlay: Path | None) -> None:
    """Find the pins in each IMAGE, with nothing known beforehand, and list them.

    Use it to judge focus, light and exposure: every pin should be found, and nothing else.
    """
    from edge.pins import detect
    from edge.sources import read_image

    if overlay is not None:
        overlay.mkdir(parents=True, exist_ok=True)
    found: list[dict[str, Any]] = []
    failed = False
    for path in images:
        entry: dict[str, Any] = {"image": str(path), "n_pins": 0, "xy_px": []}
        try:
            image = read_image(path)
            pins = detect(image)
        except EdgeError as error:
            failed = True
            message = str(error) if str(path) in str(error) else f"{path}: {error}"
            complain(message)
            entry["error"] = message
        else:
            entry["n_pins"] = len(pins)
            entry["xy_px"] = [[round(float(x), 3), round(float(y), 3)] for x, y in pins.xy_img]
            if overlay is not None:
                from edge.draw import save_pins_overlay

                save_pins_overlay(overlay / f"{path.stem}_pins.png", image, pins)
        found.append(entry)
        if not as_json and "error" not in entry:
            click.echo(f"{path}: {entry['n_pins']} pins")
    if as_json:
        click.echo(json.dumps(found))
    if failed:
        raise SystemExit(2)


@cli.command()
@click.option(
    "-c", "--config", "config_path", type=click.Path(path_type=Path), help="TOML file; see deploy/."
)
@click.option("--source", "source_spec", help=SOURCE_HELP)
@click.option("--sink", "sink_specs", multiple=True, help=SINK_HELP)
@click.option("--calibration", "calibration_path", type=click.Path(path_type=Path), help="Calibration file.")
@click.option("--json", "as_json", is_flag=True, help="Print the lines as JSON.")
def doctor(
    config_path: Path | None,
    source_spec: str | None,
    sink_specs: Sequence[str],
    calibration_path: Path | None,
    as_json: bool,
) -> None:
    """Look at camera, pins, calibration, link, processor, clock and disk.

    Says ok, warn or fail for each, and what to do. Leave the tip untouched, and stop the service: the
    camera is needed. Exit code 1 where something fails, 0 otherwise.
    """
    from msgspec.structs import replace

    from edge.config import load_config
    from edge.device import stored_calibration
    from edge.doctor import Machine, as_table, examine, worst
    from edge.sources import open_source

    config = load_config(config_path)
    if source_spec:
        config = replace(config, source=replace(config.source, spec=source_spec))
    if sink_specs:
        config = replace(config, link=replace(config.link, sinks=tuple(sink_specs)))
    state_dir = Path(config.state.directory) if config.state.directory else None
    chosen = calibration_path or stored_calibration(state_dir) or config.calibration.file
    s = config.source
    with waiting("looking at camera, link and machine", not as_json):
        lines = examine(
            config,
            lambda: open_source(
                s.spec,
                width=s.width,
                height=s.height,
                rate_hz=s.rate_hz,
                exposure_us=s.exposure_us,
                gain=s.gain,
            ),
            Path(chosen) if chosen else None,
            Machine(),
        )
    if as_json:
        click.echo(json.dumps({"worst": worst(lines), "lines": as_table(lines)}))
    else:
        colours = {"ok": "green", "warn": "yellow", "fail": "red"}
        for line in lines:
            click.echo(
                f"{click.style(f'{line.level:4s}', colours[line.level])} {line.topic:12s} {line.words}"
            )
            if line.advice:
                click.echo(f"{'':17s} -> {line.advice}")
    raise SystemExit(worst(lines) == "fail")


def _app(
    stack: ExitStack,
    source: FrameSource,
    config: Config,
    sink_specs: Sequence[str],
    calibration_path: Path | None,
) -> App:
    """The app with everything that the options ask for; the stack closes it all."""
    from edge.app import App
    from edge.device import AppDevice, clear_leftovers, stored_calibration
    from edge.health import FaultLog, Health, Vitals, room_for
    from edge.node import Node
    from edge.notify import Notifier
    from edge.settings import Settings, SettingsFile
    from edge.transport import CanSink, SerialSink, open_sink
    from hostlink.wire import FEATURE_BITS

    state_dir = Path(config.state.directory) if config.state.directory else None
    if state_dir is not None and not state_dir.is_dir():
        raise ConfigError(f"[state] directory: {state_dir} is no folder; make it, or leave the key out")
    if state_dir is not None:
        clear_leftovers(state_dir)
    calibration = _calibration(
        calibration_path or stored_calibration(state_dir) or config.calibration.file or None
    )
    health = Health()
    vitals = Vitals(health, hot_degc=config.limits.temperature_degc)
    notifier = Notifier()
    stack.callback(notifier.close)
    app = App(
        source,
        [],
        calibration,
        frozenset(config.features.demand),
        config.tare.frames_n,
        config.tare.steady_px,
        health,
        drift_px=config.tare.drift_px,
        load_pitches=config.limits.load_pitches,
        vitals=vitals,
        notifier=notifier,
    )
    health.listeners.append(FaultLog(health, notifier.status))
    vitals.storage.append(app.recorded.trouble)
    device = AppDevice(app, config.sensor.serial, state_dir)
    settings = SettingsFile(
        state_dir / "settings.json" if state_dir else None,
        Settings(
            heartbeat_ms=config.link.heartbeat_ms,
            divider=config.link.divider,
            features=sum(FEATURE_BITS.get(feature, 0) for feature in config.features.demand),
        ),
    )
    vitals.storage.append(settings.trouble)
    if state_dir is not None:
        vitals.storage.append(lambda: room_for(state_dir))
    for spec in sink_specs or config.link.sinks:
        sink = open_sink(spec, node=config.sensor.node_id)
        stack.callback(sink.close)
        if isinstance(sink, CanSink | SerialSink):
            node = Node(sink, device, settings, config.sensor.node_id)
            app.health.listeners.append(node.report)
            for code, words in app.health.active.items():
                node.report(code, True, words)
            app.watchers.append(_detail(node))
            app.sinks.append(node)
        else:
            app.sinks.append(sink)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: app.stop())
    return app


def _aside(
    stack: ExitStack,
    app: App,
    config: Config,
    record: Path | None,
    view: str | None,
    token: str | None,
    recordings: Path | None,
) -> str:
    """Recorder and live page, where they are asked for.

    view     HOST:PORT; "": the default; None: no page
    Returns  the page's address; "": none
    """
    if view is None and token is not None:
        raise UsageError("--view-token: there is no page; give --view too")
    if view is None and record is None:
        return ""
    from edge.aside import Aside
    from hostlink.web import WebError, parse_listen

    try:
        listen = None if view is None else parse_listen(view, token)
    except WebError as error:
        raise UsageError(str(error)) from None
    if recordings is None:
        recordings = Path(config.state.directory) / "recordings" if config.state.directory else Path(".")
    aside = Aside(app, listen, record, recordings, {"serial": config.sensor.serial})
    stack.callback(aside.close)
    aside.start()
    return aside.url if listen is not None else ""


def _detail(node: Node) -> Callable[[Result, State], None]:
    """A watcher that sends every pin's motion where the host has asked for it."""

    def watch(result: Result, state: State) -> None:
        if node.detail_divider and result.features is not None:
            f = result.features
            node.send_detail(state.sample, np.column_stack([f.displacement_px, f.area_change]).tolist())

    import numpy as np

    return watch


def _calibration(path: str | Path | None) -> Calibration | None:
    if path is None:
        return None
    from edge.calibration import Calibration

    return Calibration.load(path)


def _speed(text: str) -> float | None:
    """The factor; None for as fast as possible."""
    if text == "max":
        return None
    try:
        factor = float(text)
    except ValueError:
        factor = math.nan
    if not 0.01 <= factor <= 100:
        raise SourceError(f"--speed {text}: give a factor from 0.01 to 100, or max")
    return factor


def _missed(app: App, tare_n: int, skipped_n: Sequence[int]) -> str:
    """What of a recording the tare took up, in words; empty: no more than its own images.

    skipped_n  images that passed before the first result, where there was one
    """
    paced = app.source.live
    if not app.frames_n or (paced and not getattr(app.source, "ended", True)):
        return ""  # stopped
    way_out = "--loop plays it on, --speed max takes every image" if paced else "replay a longer one"
    if app.last is None:
        return (
            f"ended while the rest frame was being taken ({tare_n} images and a search), no values; {way_out}"
        )
    if skipped_n and skipped_n[0]:
        return f"{skipped_n[0]} images passed while the rest frame was being taken; {way_out}"
    return ""


def _finish(
    statistics: Statistics, app: App, as_json: bool, quiet: bool, extra: dict[str, Any] | None = None
) -> None:
    """Print what happened."""
    if quiet and not as_json:
        return
    table = {**asdict(statistics), **(extra or {})}
    table["sinks"] = {
        f"{i} {sink.name}": {"sent": sink.counters.sent, "dropped": sink.counters.dropped}
        for i, sink in enumerate(app.sinks)
    }
    if as_json:
        click.echo(_line(table))
        return
    for key, value in table.items():
        if isinstance(value, tuple):
            value = " / ".join(f"{v:.0f}" for v in value)
        elif isinstance(value, dict):
            value = ", ".join(f"{k} {v}" for k, v in value.items()) or "none"
        elif isinstance(value, float):
            value = f"{value:.3g}"
        click.echo(f"{key:24s} {value}")


def _line(table: dict[str, Any]) -> str:
    """One line of JSON; NaN, which JSON does not have, is null."""

    def plain(value: Any) -> Any:
        if isinstance(value, float):
            return value if math.isfinite(value) else None
        if isinstance(value, dict):
            return {k: plain(v) for k, v in value.items()}
        if isinstance(value, list | tuple):
            return [plain(v) for v in value]
        return value

    return json.dumps(plain(table))


def main() -> NoReturn:
    """Run a command and exit, as `hostlink.ending` has it."""
    share_the_processor()
    name = program_name("voronoi-touch-edge", "edge")
    sys.exit(run_command(cli, name, (UsageError,)))


def program() -> NoReturn:
    """`main`, for a process of its own."""
    run_and_leave(main)


if __name__ == "__main__":
    program()
