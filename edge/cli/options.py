"""Common options of the commands, and their values."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import wraps
from pathlib import Path
from typing import Any

import click
from msgspec.structs import replace

from edge.config import Config, load_config
from edge.errors import InputError
from edge.sensors import load_sensor
from hostlink.cli_types import FiniteFloat
from hostlink.output_file import check_output
from hostlink.web import Listen, WebError, find_token, parse_listen
from hostlink.web.listen import TOKEN_VARIABLE

Command = Callable[..., None]
PATH = click.Path(path_type=Path)
FILE = click.Path(path_type=Path, dir_okay=False)
FOLDER = click.Path(path_type=Path, file_okay=False)

config_option = click.option("-c", "--config", "config_path", type=PATH, help="TOML file; see deploy/.")
source_option = click.option(
    "--source",
    "source_spec",
    help="v4l2:0, /dev/video0, picamera:0 (a Raspberry Pi's CSI camera), oak:, sim:press, example:press, or "
    "a file. Default: the configuration's, else v4l2:0.",
)
sink_option = click.option(
    "--sink",
    "sink_specs",
    multiple=True,
    help="Where samples go; may be given more than once. can:can0, can:can0?fd=0, virtual:NAME, "
    "udp:239.0.0.1, serial:/dev/ttyACM0?baud=921600, slcan:/dev/ttyACM0, memory:",
)
calibration_option = click.option(
    "--calibration",
    "calibration_path",
    type=PATH,
    help="Calibration file; an example has its own.",
)
sensor_option = click.option(
    "--sensor",
    "sensor_name",
    metavar="NAME|FILE.toml",
    help="What the fingertip is: a known sensor, or a file of your own. Default: found from its pins.",
)
smooth_option = click.option(
    "--smooth",
    "smooth_ms",
    type=FiniteFloat(0, 1000),
    metavar="MS",
    help="Smooth calibrated values while the tip is touched; a sudden step is followed in this time.",
)
overwrite_option = click.option("--overwrite", is_flag=True, help="Replace files that exist already.")

_LOOP_OPTIONS = (
    config_option,
    sink_option,
    calibration_option,
    sensor_option,
    smooth_option,
    click.option("--record", "record_path", type=PATH, help="Write images and values to this .mcap file."),
    overwrite_option,
    click.option(
        "--view", "view_here", is_flag=True, help="Serve a live page at 127.0.0.1:8765, or at --view-at."
    ),
    click.option(
        "--view-at",
        metavar="HOST:PORT",
        help="Serve the live page there; beyond this machine only with a token.",
    ),
    click.option(
        "--view-token",
        metavar="TOKEN|auto",
        help="Let the page tare and record, with this token of 8 characters or more; auto makes one. All "
        f"users of the machine see a command line: {TOKEN_VARIABLE} in the environment or a file is safer.",
    ),
    click.option("--view-token-file", type=FILE, help="The token is the first line of this file."),
    click.option(
        "--recordings",
        type=FOLDER,
        help="Folder for what the page's record button makes. Default: in the state folder, else here.",
    ),
)


@dataclass(frozen=True, slots=True)
class LoopOptions:
    """Options common to `run` and `replay`, as given."""

    config_path: Path | None
    sink_specs: tuple[str, ...]
    calibration_path: Path | None
    sensor_name: str | None
    smooth_ms: float | None
    record_path: Path | None
    overwrite: bool
    view_here: bool
    view_at: str | None
    view_token: str | None
    view_token_file: Path | None
    recordings: Path | None

    def load_config(self, source_spec: str | None = None) -> Config:
        """Raises ConfigError."""
        config = configured(self.config_path, self.sensor_name, self.sink_specs, source_spec)
        if self.smooth_ms is None:
            return config
        return replace(config, features=replace(config.features, smooth_ms=self.smooth_ms))

    def check_record(self, *inputs: str | Path) -> None:
        """Raises OutputError: there is a file already, or it is one that is read."""
        if self.record_path is not None:
            read = [path for path in (*inputs, self.config_path, self.calibration_path) if path]
            check_output(self.record_path, (".mcap",), read, self.overwrite)

    def listen(self) -> Listen | None:
        """Where the live page is served; None: there is none. Raises InputError."""
        if self.view_at is None and not self.view_here:
            if self.view_token is not None or self.view_token_file is not None:
                raise InputError("--view-token: there is no page; give --view too")
            return None
        try:
            token = find_token(self.view_token, self.view_token_file, "--view-token-file")
            return parse_listen(self.view_at or "", token)
        except WebError as error:
            raise InputError(str(error)) from None

    def recordings_folder(self, config: Config) -> Path:
        """Folder for recordings started on the page."""
        state = config.state.directory
        return self.recordings or (Path(state) / "recordings" if state else Path("."))


def configured(
    path: Path | None, sensor_name: str | None, sink_specs: Sequence[str], source_spec: str | None
) -> Config:
    """The configuration, with what options name instead. Raises ConfigError: the sensor is not known, too."""
    config = load_config(path)
    if sensor_name is not None:
        config = replace(config, sensor=replace(config.sensor, model=sensor_name))
    if sink_specs:
        config = replace(config, link=replace(config.link, sinks=tuple(sink_specs)))
    if source_spec:
        config = replace(config, source=replace(config.source, spec=source_spec))
    if config.sensor.model:
        load_sensor(config.sensor.model)
    return config


def loop_options(command: Command) -> Command:
    """Add the options of `LoopOptions`; the command gets them as one argument, `options`."""
    names = [field.name for field in fields(LoopOptions)]

    @wraps(command)
    def packed(**given: Any) -> None:
        options = LoopOptions(**{name: given.pop(name) for name in names})
        command(options=options, **given)

    made: Command = packed
    for option in reversed(_LOOP_OPTIONS):  # help lists them in the order of the table
        made = option(made)
    return made


class RestFrom(click.ParamType[str]):
    """The number of an image, "auto" or "none"; stays text."""

    name = "rest"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if value in ("auto", "none") or (str(value).isdecimal() and len(value) < 10):
            return value
        self.fail(f"{value!r} is no image; give its number, from 0, or auto, or none", param, ctx)


rest_option = click.option(
    "--rest",
    type=RestFrom(),
    metavar="FRAME|auto|none",
    help="Rest frame: an image's number, from 0; auto finds the least deformed image; none takes the "
    "calibration's rest pins. Default: the first images; for inspect, auto.",
)


class SpeedFactor(FiniteFloat):
    """A factor, or "max"."""

    def __init__(self) -> None:
        super().__init__(0.01, 100)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if value == "max":
            return value
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter:
            self.fail(f"{value!r} is not a speed; give a factor from 0.01 to 100, or max", param, ctx)
