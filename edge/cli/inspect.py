"""`edge inspect`: which pins are found in single images."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from edge.cli.options import overwrite_option
from edge.errors import EdgeError, InputError
from hostlink.cli_exit import print_error
from hostlink.interrupt import exit_on_interrupt
from hostlink.output_file import check_output, writing

if TYPE_CHECKING:
    from edge.types import Image, Pins


@click.command()
@click.argument("images", nargs=-1, required=True, metavar="IMAGE...", type=click.Path(path_type=Path))
@click.option(
    "--json", "as_json", is_flag=True, help='Print [{"image":..., "n_pins":..., "xy_px":[[x,y],...]}].'
)
@click.option(
    "--overlay",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder for pictures with the pins marked.",
)
@overwrite_option
def inspect(images: Sequence[Path], as_json: bool, overlay: Path | None, overwrite: bool) -> None:
    """Find the pins in each IMAGE, without prior knowledge, and list them.

    Use it to check focus, illumination and exposure: every pin should be found, and nothing else.
    """
    with exit_on_interrupt():
        from edge.pins import detect
        from edge.sources import read_image

    pictures = {} if overlay is None else _pictures(images, overlay, overwrite)
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
            print_error(message)
            entry["error"] = message
        else:
            entry["n_pins"] = len(pins)
            entry["xy_px"] = [[round(float(x), 3), round(float(y), 3)] for x, y in pins.xy_img]
            if path in pictures:
                _draw(pictures[path], image, pins, overwrite)
        found.append(entry)
        if not as_json and "error" not in entry:
            click.echo(f"{path}: {entry['n_pins']} pins")
    if as_json:
        click.echo(json.dumps(found))
    if failed:
        raise SystemExit(2)


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


def _draw(picture: Path, image: Image, pins: Pins, overwrite: bool) -> None:
    from edge.view.panels import save_pins_overlay

    with writing(picture, overwrite) as unfinished:
        save_pins_overlay(unfinished, image, pins)
