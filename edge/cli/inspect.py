"""`edge inspect`: what a picture, recording or camera shows: pins, sensor, light, focus, what to do."""

import json
from collections.abc import Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np

from edge.calibration import Calibration
from edge.cli import picture
from edge.cli.assembly import load_calibration, look_as
from edge.cli.checks import Line, print_lines
from edge.cli.options import FOLDER, PATH, calibration_option, overwrite_option, rest_option, sensor_option
from edge.errors import EdgeError, InputError, NoPins, SourceError
from edge.pins import left_out, take_rest
from edge.pins.lens import rest_as_seen
from edge.rest.choice import rest_of_source
from edge.rest.sensor_match import mm_per_px, recognise
from edge.rest.symmetry import symmetry_of
from edge.rest.tare import PARAMS as TARE
from edge.sensors import KnownSensor, known_sensors, load_sensor, missing_pins
from edge.sources import open_source
from edge.sources.files import FileSource
from edge.types import Frame, Rest
from edge.view.panels import save_pins_overlay
from hostlink.cli_exit import print_error
from hostlink.output_file import check_output, writing


@click.command()
@click.argument("images", nargs=-1, required=True, metavar="IMAGE...")
@click.option(
    "--json",
    "as_json",
    is_flag=True,
    help='Print [{"image":..., "n_pins":..., "dark":..., "sensor":..., "mm_per_px":..., "touched":..., '
    '"xy_px":..., "holes_px":..., "left_out_px":..., "settings":..., "lines":...}]; of a recording '
    '"rest":... and "untouched":... too.',
)
@click.option("--out", type=PATH, help="One picture that shows all of it (.png), of a single IMAGE.")
@click.option("--overlay", type=FOLDER, help="Folder for such pictures, one of each IMAGE.")
@sensor_option
@rest_option
@calibration_option
@overwrite_option
def inspect(
    images: Sequence[str],
    as_json: bool,
    out: Path | None,
    overlay: Path | None,
    sensor_name: str | None,
    rest: str | None,
    calibration_path: Path | None,
    overwrite: bool,
) -> None:
    """Find the pins in each IMAGE, and say what is good and what to improve.

    An IMAGE is a picture, a recording (MCAP, video, GIF, folder) or a camera (v4l2:0), with options as for
    --source. Every pin should be found, and nothing else. If the tip is untouched, it also says which known
    sensor this looks like, and the scale if the sensor's pitch is known. From a recording it takes the rest
    frame: the least deformed image, or what --rest says.
    """
    if calibration_path is not None and rest is None:
        raise InputError("--calibration: is for the rest frame of a recording; give --rest too")
    calibration = load_calibration(calibration_path)
    named = None if sensor_name is None else load_sensor(sensor_name)
    sensors = known_sensors() if named is None else [named]
    pictures = {} if overlay is None else _pictures(images, overlay, overwrite)
    if out is not None:
        if len(images) > 1 or overlay is not None:
            raise InputError("--out: is for a single image; give --overlay and a folder for several")
        pictures = {images[0]: check_output(out, (".png",), [_file(images[0])], overwrite)}
    found: list[dict[str, Any]] = []
    for address in images:
        entry: dict[str, Any] = {"image": address, "n_pins": 0, "xy_px": []}
        try:
            seen = _seen_of(address, rest, calibration, named)
        except EdgeError as error:
            message = str(error) if address in str(error) else f"{address}: {error}"
            print_error(message)
            entry["error"] = message
        else:
            entry |= seen.findings(sensors)
            summary = f"{address}: {_in_words(entry, sensors)}"
            if address in pictures:
                with writing(pictures[address], overwrite) as unfinished:
                    seen.draw(unfinished, summary)
            if not as_json:
                click.echo(summary)
                if "rest" in entry:
                    click.echo(f"{address}: rest frame: {entry['rest']}")
                print_lines(seen.lines)
        found.append(entry)
    if as_json:
        click.echo(json.dumps(found))
    if any("error" in entry for entry in found):
        raise SystemExit(2)


@dataclass(frozen=True, slots=True)
class _Seen:
    """The findings on one source.

    settings  keys of its address that suit it better, and the pins that each finds
    about     of the choice of the rest frame
    """

    frame: Frame
    rest: Rest
    lines: list[Line]
    settings: dict[str, int]
    about: dict[str, Any]

    def findings(self, sensors: Sequence[KnownSensor]) -> dict[str, Any]:
        rest, match = self.rest, recognise(self.rest, sensors)
        scale = None if match is None else mm_per_px(match.sensor, rest)
        return self.about | {
            "n_pins": len(rest),
            "dark": rest.pattern.dark,
            "sensor": None if match is None else match.sensor.name,
            "mm_per_px": None if scale is None else round(scale, 5),
            "touched": symmetry_of(rest).in_contact,
            "xy_px": rest.xy_img.round(3).tolist(),
            "holes_px": picture.holes(rest).round(3).tolist(),
            "left_out_px": left_out(self.frame.image, rest_as_seen(rest)).round(3).tolist(),
            "settings": self.settings,
            "lines": [asdict(line) for line in self.lines],
        }

    def draw(self, path: Path, title: str) -> None:
        rest = rest_as_seen(self.rest)
        areas = [area.partition("=") for key in self.settings for area in key.split("&")]
        rois = [numbers.split(",") for name, _, numbers in areas if name == "roi"]
        text = [
            f"{line.level} {line.topic}: {line.message}" + (f" -> {line.advice}" if line.advice else "")
            for line in self.lines
        ]
        save_pins_overlay(
            path,
            self.frame.image,
            rest.pins,
            picture.clipped(self.frame, rest),
            np.concatenate([picture.holes(rest), left_out(self.frame.image, rest)]),
            [[int(number) for number in roi] for roi in rois],
            [title, *text, "ring: a pin, red if clipped; cross: a spot left out, or a place without a pin"],
        )


def _seen_of(
    address: str, how: str | None, calibration: Calibration | None, named: KnownSensor | None
) -> _Seen:
    """Look at a picture or camera, or at a recording as replayed. Raises InputError, NoPins."""
    with closing(open_source(address)) as source:
        if named is not None:
            look_as(source, named)
        several = isinstance(source, FileSource) and source.frames_n != 1
        if how is not None or several:
            given = rest_of_source(source, how or "auto", calibration)
            frame, rest = given.frame, given.rest
            frames, about = [frame], {"rest": given.message, "untouched": given.untouched}
        else:
            frames, about = picture.watch(source)[: TARE.frames_n], {}
            if not frames:
                raise SourceError(f"{source.name}: no images; is another program using it?")
            frame = frames[-1]
            try:
                rest = take_rest([f.image for f in frames], source.polarity, source.lens, source.region)
            except NoPins as error:
                line = picture.brightness(frames, None)
                raise NoPins(
                    f"{error}; light: {line.message}; {line.advice or 'give ?roi= or ?mask='}"
                ) from None
        settings = picture.settings_tried(source, frame, rest)
        lines = [*picture.pins(frame, rest), picture.brightness(frames, rest)]
        lines += [picture.better_settings(settings)] if settings else []
    return _Seen(frame, rest, lines, settings, about)


def _in_words(entry: dict[str, Any], sensors: Sequence[KnownSensor]) -> str:
    known = next((s for s in sensors if s.name == entry["sensor"]), None)
    message = f"{entry['n_pins']} {'dark' if entry['dark'] else 'bright'} pins; they "
    if known is not None:
        message += f"fit {known.title} ({known.name})"
    elif len(sensors) == 1:
        message += f"do not fit {sensors[0].title}"
    else:
        message += "fit no known sensor (python -m edge sensor describes yours)"
    if entry["mm_per_px"] is not None:
        message += f", {entry['mm_per_px']:.4f} mm a px"
    if entry["touched"]:
        message += ", something touches it"
    missing = missing_pins(sensors[0], entry["n_pins"]) if len(sensors) == 1 else ""
    return f"{message}: {missing}" if missing else message


def _file(address: str) -> Path:
    """The file that an address names, without its options."""
    return Path(address if Path(address).exists() else address.partition("?")[0])


def _pictures(images: Sequence[str], folder: Path, overwrite: bool) -> dict[str, Path]:
    """The picture file of each image. Raises OutputError; InputError: two have the same name."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--overlay {folder}: {error.strerror}; give a folder that can be made") from None
    paths = {address: _file(address) for address in images}
    for path in paths.values():  # they would be images of the folder from then on
        if path.parent.resolve() == folder.resolve():
            raise InputError(f"--overlay {folder}: {path.name} is there too; give another folder")
    chosen: dict[str, Path] = {}
    for address, path in paths.items():
        made = folder / f"{path.stem}_pins.png"
        if made in chosen.values():
            raise InputError(f"--overlay {folder}: two images are named {path.stem}; give them one by one")
        chosen[address] = check_output(made, (".png",), list(paths.values()), overwrite)
    return chosen
