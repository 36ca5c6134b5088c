"""Assembles a finger: source, loop, links, recorder and live page, from options and configuration."""

import logging
import os
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import click
import numpy as np
from msgspec.structs import asdict

from edge.calibration import Calibration
from edge.cli.options import LoopOptions
from edge.config import Config, SourceTable
from edge.drift import DriftParams
from edge.errors import ConfigError
from edge.examples import example_calibration
from edge.faults.registry import FaultLog, FaultRegistry
from edge.link.node import Node
from edge.link.settings import NodeSettings, SettingsFile
from edge.link.sinks import CanSink, SerialSink, open_sink
from edge.rest.choice import GivenRest, rest_if_touched, rest_of_source
from edge.rest.tare import TareParams
from edge.runtime.board_monitor import BoardMonitor, free_space_problem
from edge.runtime.calibration_store import CalibrationStore
from edge.runtime.device import LoopDevice
from edge.runtime.loop import Loop
from edge.runtime.measurement import LoopConfig
from edge.runtime.systemd import Notifier
from edge.sensors import KnownSensor, load_sensor, missing_pins
from edge.sources import open_source
from edge.sources.region import region_of
from edge.types import FrameSource, Polarity, Result
from hostlink.interrupt import call_on_signals
from hostlink.web import Listen
from hostlink.wire import FEATURE_BITS, State

log = logging.getLogger("edge")


def open_configured(table: SourceTable) -> FrameSource:
    """The source of a configuration. Raises SourceError."""
    settings = asdict(table)
    return open_source(settings.pop("spec"), **settings)


def load_calibration(path: str | Path | None) -> Calibration | None:
    """Raises CalibrationError."""
    return None if path is None else Calibration.load(example_calibration(str(path)) or path)


def rest_given(source: FrameSource, how: str | None, calibration: Calibration | None) -> GivenRest | None:
    """The rest frame of --rest; else one for a recording that begins touched. Raises InputError."""
    return rest_if_touched(source, calibration) if how is None else rest_of_source(source, how, calibration)


def expect_sensor(source: FrameSource, config: Config) -> KnownSensor | None:
    """The configured sensor; the source's pins are looked for as and where it has them.

    A recording takes the configured region too, as a camera does when it is opened.
    Raises  ConfigError; SourceError: the region is none of these images
    """
    if source.region is None:
        parts = config.source.roi, config.source.circle, config.source.mask
        source.region = region_of(source.name, source.size_px, *parts)
    if not config.sensor.model:
        return None
    sensor = load_sensor(config.sensor.model)
    look_as(source, sensor)
    return sensor


def look_as(source: FrameSource, sensor: KnownSensor) -> None:
    """Look for pins of the sensor's polarity, in its region, unless the source's address says otherwise."""
    if source.polarity is Polarity.FOUND:
        source.polarity = Polarity(sensor.pins.polarity or "")
    if source.region is None:
        parts = sensor.camera.roi or "", sensor.camera.circle or "", sensor.camera.mask or ""
        source.region = region_of(source.name, source.size_px, *parts)


def make_loop(stack: ExitStack, source: FrameSource, config: Config, calibration_path: Path | None) -> Loop:
    """The loop with everything that the options request; the stack closes it all."""
    sensor = expect_sensor(source, config)
    state_dir = _state_directory(config)
    store = None if state_dir is None else CalibrationStore(state_dir)
    if store is not None:
        store.clear_leftovers()
    given = calibration_path or config.calibration.file or None
    stored = [] if calibration_path or store is None else store.load()
    calibration = stored[0] if stored else load_calibration(given)
    registry = FaultRegistry()
    monitor = BoardMonitor(registry, hot_degc=config.limits.temperature_degc)
    notifier = Notifier()
    stack.callback(notifier.close)
    loop = Loop(
        source,
        [],
        calibration,
        LoopConfig(
            demand=frozenset(config.features.demand),
            several=config.features.several,
            on_surface=sensor is not None and sensor.on_surface,
            smooth_s=config.features.smooth_ms * 1e-3,
            tare=TareParams(frames_n=config.tare.frames_n, steady_px=config.tare.steady_px),
            drift=DriftParams(limit_px=config.tare.drift_px),
            load_pitches=config.limits.load_pitches,
        ),
        faults=registry,
        board=monitor,
        notifier=notifier,
    )
    if sensor is not None:
        loop.result_callbacks.append(_report_missing_pins(sensor))
    loop.measurement.fallbacks = tuple(stored[1:])
    registry.listeners.append(FaultLog(registry, notifier.status))
    device = LoopDevice(loop, config.sensor.serial, store)
    defaults = NodeSettings(
        heartbeat_ms=config.link.heartbeat_ms,
        divider=config.link.divider,
        features=sum(FEATURE_BITS.get(feature, 0) for feature in config.features.demand),
    )
    settings = SettingsFile(state_dir / "settings.json" if state_dir else None, defaults)
    monitor.storage += [loop.session.trouble, settings.trouble]
    if state_dir is not None:
        monitor.storage.append(lambda: free_space_problem(state_dir))
    for spec in config.link.sinks:
        _add_sink(stack, loop, spec, device, settings, config.sensor.node_id)
    call_on_signals(loop.stop)
    return loop


def _report_missing_pins(sensor: KnownSensor) -> Callable[[Result, State], None]:
    """A callback that warns when a rest frame has fewer pins than the sensor."""
    reported = ""

    def check(result: Result, state: State) -> None:
        nonlocal reported
        message = missing_pins(sensor, len(result.tracks.xy_img))
        if message and message != reported:
            log.warning("%s: clean lens and skin, light it evenly; or is it another sensor?", message)
        reported = message

    return check


def _state_directory(config: Config) -> Path | None:
    """Raises ConfigError: it is no folder."""
    if not config.state.directory:
        return None
    folder = Path(config.state.directory)
    if not os.path.isdir(folder):
        raise ConfigError(f"[state] directory: {folder} is no folder; create it, or omit the key")
    return folder


def _add_sink(
    stack: ExitStack, loop: Loop, spec: str, device: LoopDevice, settings: SettingsFile, node_id: int
) -> None:
    """Open a sink; one that can carry commands becomes a node. Raises SinkError."""
    sink = open_sink(spec, node=node_id)
    stack.callback(sink.close)
    if not isinstance(sink, CanSink | SerialSink):
        loop.sinks.append(sink)
        return
    node = Node(sink, device, settings)
    loop.faults.listeners.append(node.report)
    for code, message in loop.faults.active.items():
        node.report(code, True, message)

    watched = False

    def send_detail(result: Result, state: State) -> None:
        nonlocal watched
        if watched is not (wanted := node.detail_divider > 0):
            watched = wanted
            loop.measurement.watch(node, wanted)
        if wanted and result.features is not None:
            f = result.features
            node.send_detail(state.sample, np.column_stack([f.displacement_px, f.area_change]).tolist())

    loop.result_callbacks.append(send_detail)
    loop.sinks.append(node)


def start_worker(
    stack: ExitStack, loop: Loop, options: LoopOptions, listen: Listen | None, config: Config
) -> None:
    """Recorder and live page in their own process, if they are requested; says where the page is.

    At the end of the stack: exit code 1 if the recording is not complete. The worker says why.
    """
    if listen is None and options.record_path is None:
        return
    from edge.worker.client import WorkerClient  # not in a finger that nobody watches
    from edge.worker.params import WorkerConfig

    # A sink's address may name another number than the configuration does.
    numbers = [sink.number for sink in loop.sinks if isinstance(sink, Node)]
    worker = WorkerClient(
        loop,
        WorkerConfig(
            listen,
            options.record_path,
            options.overwrite,
            options.recordings_folder(config),
            {"serial": config.sensor.serial},
            numbers[0] if numbers else config.sensor.node_id,
        ),
    )

    def end(kind: object, error: object, trace: object) -> None:
        worker.close()
        if kind is None and options.record_path is not None and worker.recording.fault:
            raise SystemExit(1)

    stack.push(end)
    worker.start()
    if listen is not None:
        click.echo(f"live page: {worker.url}", err=True)
