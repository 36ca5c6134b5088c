"""`edge sensor`: the description of a sensor of one's own, from one image and one length."""

import json
from pathlib import Path

import click
import numpy as np

from edge.cli.options import PATH, overwrite_option
from edge.errors import InputError, NoPins
from edge.pins import take_rest
from edge.rest.sensor_match import layout_of
from edge.rest.symmetry import symmetry_of
from edge.sensors import load_sensor
from edge.sources.files import read_image
from edge.types import Rest
from hostlink.cli_types import FiniteFloat
from hostlink.output_file import check_output, writing


@click.command()
@click.argument("image", type=PATH)
@click.option("-o", "--output", required=True, type=PATH, help="File to write (.toml).")
@click.option(
    "--across-mm",
    type=FiniteFloat(0.1, 1000),
    help="By ruler, from centre to centre of the two pins that are furthest apart.",
)
@click.option("--title", help="What people call it; default: the file's name.")
@overwrite_option
def sensor(image: Path, output: Path, across_mm: float | None, title: str | None, overwrite: bool) -> None:
    """Describe a sensor by one IMAGE of its untouched skin, for --sensor and [sensor] model.

    The file has number, layout and polarity of the pins and, with --across-mm, their pitch. Without it
    nothing is known in mm.
    """
    check_output(output, (".toml",), (image,), overwrite)
    title = title or output.stem
    if not 0 < len(title) <= 64 or not title.isprintable():
        raise InputError(f"--title {title!r}: give 1 to 64 printable characters")
    try:
        rest = take_rest([read_image(image)])
    except NoPins as error:
        raise InputError(f"{image}: {error}") from None
    with writing(output, overwrite) as unfinished:
        unfinished.write_text(_description(rest, title, across_mm, image.name), encoding="utf-8")
    made = load_sensor(str(output))
    layout = made.pins.layout or "of no regular layout"
    pitch = "" if made.pins.pitch_mm is None else f", pitch {made.pins.pitch_mm:g} mm"
    click.echo(f"{output}: {made.pins.count} {made.pins.polarity} pins, {layout}{pitch}")
    symmetry = symmetry_of(rest)
    if symmetry.in_contact:
        click.echo(f"warning: {image}: something touches the tip: {symmetry.message}; take another", err=True)


def _description(rest: Rest, title: str, across_mm: float | None, image: str) -> str:
    """The file. The pitch is that of the middle: of the layout, or without one of the three nearest."""
    found = layout_of(rest)
    seen = f"found in {image}"
    pins: dict[str, object] = {"count": len(rest), "polarity": "dark" if rest.pattern.dark else "bright"}
    if found is not None:
        pins["layout"] = found[0]
    camera: dict[str, object] = {"size_px": rest.pattern.size_px}
    sources = {f"pins.{key}": seen for key in pins} | {"camera.size_px": seen}
    if across_mm is not None:
        away = rest.xy_img[:, None] - rest.xy_img
        scale = across_mm / float(np.hypot(*away.T).max())
        pitch_px = rest.pattern.pitch_px if found is None else found[1].pitch_px
        pins["pitch_mm"], camera["mm_per_px"] = round(scale * pitch_px, 4), round(scale, 5)
        measured = f"{across_mm:g} mm across by ruler, {seen}"
        sources |= dict.fromkeys(["pins.pitch_mm", "camera.mm_per_px"], measured)
    text = f"title = {json.dumps(title)}\n"
    for name, table in (("pins", pins), ("camera", camera), ("sources", sources)):
        text += f"\n[{name}]\n"
        for key, value in table.items():
            text += f"{json.dumps(key) if '.' in key else key} = {json.dumps(value, ensure_ascii=False)}\n"
    return text
