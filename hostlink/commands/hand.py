"""`python -m hostlink hand`: a hand's file, checked and as ROS has it; and the option `--hand`."""

from __future__ import annotations

from math import degrees
from pathlib import Path

import click

from hostlink.hand_file import HandFile, read_hand
from hostlink.output_file import check_output, writing

__all__ = ["hand", "hand_option", "write_text"]


def _read(_context: click.Context, _option: click.Parameter, path: Path | None) -> HandFile:
    return HandFile() if path is None else read_hand(path)


hand_option = click.option(
    "--hand",
    type=click.Path(path_type=Path),
    callback=_read,
    help="A file of the fingers' names and places: docs/robot.md.",
)


def write_text(text: str, output: Path | None, suffix: str, overwrite: bool) -> None:
    """Into this file, or to the terminal."""
    if output is None:
        click.echo(text, nl=False)
        return
    with writing(check_output(output, (suffix,), overwrite=overwrite), overwrite) as unfinished:
        unfinished.write_text(text, encoding="utf-8")
    click.echo(f"wrote {output}", err=True)


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--urdf", "urdf_path", type=click.Path(path_type=Path), help="Write its description for ROS here."
)
@click.option("--rviz", "rviz_path", type=click.Path(path_type=Path), help="Write a view for RViz.")
@click.option("--overwrite", is_flag=True, help="Replace these files if they exist.")
def hand(file: Path, urdf_path: Path | None, rviz_path: Path | None, overwrite: bool) -> None:
    """Check the hand in FILE and list its fingers; write its URDF, or a view for RViz."""
    from hostlink.bridge.robot_model import rviz_config, urdf

    named = read_hand(file)
    for mount in named.mounts:
        place = ", ".join(f"{v * 1e3:g}" for v in mount.place_m)
        turn = ", ".join(f"{degrees(v):g}" for v in mount.turn_rad)
        on = mount.parent_frame(named.namespace)
        click.echo(f"{mount.name:<20} node {mount.node:<3} at {place} mm, turned by {turn} deg, on {on}")
    if urdf_path is not None:
        write_text(urdf(named.mounts, named.namespace), urdf_path, ".urdf", overwrite)
    if rviz_path is not None:
        write_text(rviz_config(named, named.namespace), rviz_path, ".rviz", overwrite)
