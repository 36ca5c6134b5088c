"""`edge inspect`: which pins are found in single images, or in the rest frame of a recording."""

import json
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import click

from edge.calibration import Calibration
from edge.cli.assembly import load_calibration
from edge.cli.options import FOLDER, PATH, calibration_option, overwrite_option, rest_option, sensor_option
from edge.errors import EdgeError, InputError, SourceError
from edge.pins import take_rest
from edge.rest.choice import rest_of_source
from edge.rest.sensor_match import mm_per_px, recognise
from edge.rest.symmetry import symmetry_of
from edge.sensors import KnownSensor, known_sensors, load_sensor, missing_pins
from edge.sources import open_source, read_image
from edge.types import Image, Polarity, Rest
from edge.view.panels import save_pins_overlay
from hostlink.cli_exit import print_error
from hostlink.output_file import check_output, writing


@click.command()
@click.argument("images", nargs=-1, required=True, metavar="IMAGE...", type=PATH)
@click.option(
    "--json",
    "as_json",
    is_flag=True,
    help='Print [{"image":..., "n_pins":..., "dark":..., "sensor":..., "mm_per_px":..., '
    '"touched":..., "xy_px":...}]; with --rest "rest":... and "untouched":... too.',
)
@click.option("--overlay", type=FOLDER, help="Folder for pictures with the pins marked.")
@sensor_option
@rest_option
@calibration_option
@overwrite_option
def inspect(
    images: Sequence[Path],
    as_json: bool,
    overlay: Path | None,
    sensor_name: str | None,
    rest: str | None,
    calibration_path: Path | None,
    overwrite: bool,
) -> None:
    """Find the pins in each IMAGE, without prior knowledge, and list them.

    Use it to check focus, illumination and exposure: every pin should be found, and nothing else. Of an
    untouched tip it also says which known sensor it looks like, and the scale where its pitch is known.
    With --rest each IMAGE is a recording (MCAP, video, folder), and the pins are those of its rest frame.
    """
    if calibration_path is not None and rest is None:
        raise InputError("--calibration: is for the rest frame of a recording; give --rest too")
    calibration = load_calibration(calibration_path)
    named = None if sensor_name is None else load_sensor(sensor_name)
    sensors = known_sensors() if named is None else [named]
    polarity = Polarity.FOUND if named is None else named.polarity
    pictures = {} if overlay is None else _pictures(images, overlay, overwrite)
    found: list[dict[str, Any]] = []
    for path in images:
        entry: dict[str, Any] = {"image": str(path), "n_pins": 0, "xy_px": []}
        try:
            image, found_rest, about = _rest_of(path, rest, calibration, polarity)
        except EdgeError as error:
            message = str(error) if str(path) in str(error) else f"{path}: {error}"
            print_error(message)
            entry["error"] = message
        else:
            entry |= about | _findings(found_rest, sensors)
            if path in pictures:
                with writing(pictures[path], overwrite) as unfinished:
                    save_pins_overlay(unfinished, image, found_rest.pins)
            if not as_json:
                click.echo(f"{path}: {_in_words(entry, sensors)}")
                if rest is not None:
                    click.echo(f"{path}: rest frame: {entry['rest']}")
        found.append(entry)
    if as_json:
        click.echo(json.dumps(found))
    if any("error" in entry for entry in found):
        raise SystemExit(2)


def _rest_of(
    path: Path, how: str | None, calibration: Calibration | None, polarity: Polarity
) -> tuple[Image, Rest, dict[str, Any]]:
    """Of an image, or of a recording as `replay` takes it. Raises SourceError, NoPins, CalibrationError."""
    if how is None:
        try:
            image = read_image(path)
        except SourceError as error:
            advice = "; for a recording add --rest auto" if path.exists() else ""
            raise SourceError(f"{error}{advice}") from None
        return image, take_rest([image], polarity), {}
    with closing(open_source(str(path))) as source:
        if source.polarity is Polarity.FOUND:
            source.polarity = polarity
        given = rest_of_source(source, how, calibration)
    return given.frame.image, given.rest, {"rest": given.message, "untouched": given.untouched}


def _findings(rest: Rest, sensors: Sequence[KnownSensor]) -> dict[str, Any]:
    match = recognise(rest, sensors)
    scale = None if match is None else mm_per_px(match.sensor, rest)
    return {
        "n_pins": len(rest),
        "dark": rest.pattern.dark,
        "sensor": None if match is None else match.sensor.name,
        "mm_per_px": None if scale is None else round(scale, 5),
        "touched": symmetry_of(rest).in_contact,
        "xy_px": [[round(float(x), 3), round(float(y), 3)] for x, y in rest.xy_img],
    }


def _in_words(entry: dict[str, Any], sensors: Sequence[KnownSensor]) -> str:
    known = next((s for s in sensors if s.name == entry["sensor"]), None)
    message = f"{entry['n_pins']} {'dark' if entry['dark'] else 'bright'} pins, "
    if known is not None:
        message += f"as of {known.title} ({known.name})"
    else:
        message += f"not as of {sensors[0].title}" if len(sensors) == 1 else "as of no known sensor"
    if entry["mm_per_px"] is not None:
        message += f", {entry['mm_per_px']:.4f} mm a px"
    if entry["touched"]:
        message += ", something touches it"
    missing = missing_pins(sensors[0], entry["n_pins"]) if len(sensors) == 1 else ""
    return f"{message}: {missing}" if missing else message


def _pictures(images: Sequence[Path], folder: Path, overwrite: bool) -> dict[Path, Path]:
    """The picture file of each image. Raises OutputError; InputError: two have the same name."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--overlay {folder}: {error.strerror}; give a folder that can be made") from None
    for path in images:  # they would be images of the folder from then on
        if path.parent.resolve() == folder.resolve():
            raise InputError(f"--overlay {folder}: {path.name} is there too; give another folder")
    chosen: dict[Path, Path] = {}
    for path in dict.fromkeys(images):
        picture = folder / f"{path.stem}_pins.png"
        if picture in chosen.values():
            raise InputError(f"--overlay {folder}: two images are named {path.stem}; give them one by one")
        chosen[path] = check_output(picture, (".png",), images, overwrite)
    return chosen
