"""`python -m hostlink dbc`: a CAN database of the fingers on a bus."""

from __future__ import annotations

from pathlib import Path

import click

from hostlink.cli_types import FiniteFloat, WholeNumber
from hostlink.commands.hand import hand_option, write_text
from hostlink.errors import UsageError
from hostlink.extras import require
from hostlink.hand_file import HandFile


@click.command()
@hand_option
@click.option(
    "--node",
    "nodes",
    type=WholeNumber(1, 127),
    multiple=True,
    help="A finger's number; repeatable. Without it all of --hand.",
)
@click.option("--classic", is_flag=True, help="For a classic CAN bus; else for CAN FD.")
@click.option(
    "--rate",
    "rate_hz",
    type=FiniteFloat(0, 1000, min_open=True),
    default=250.0,
    show_default=True,
    help="Samples a second, for the cycle times.",
)
@click.option("-o", "--output", type=click.Path(path_type=Path), help="A .dbc file; else it is printed.")
@click.option("--overwrite", is_flag=True, help="Replace that file if it exists.")
def dbc(
    hand: HandFile,
    nodes: tuple[int, ...],
    classic: bool,
    rate_hz: float,
    output: Path | None,
    overwrite: bool,
) -> None:
    """Write a CAN database (DBC) of the fingers with these numbers, or of those of a hand."""
    chosen = nodes or tuple(mount.node for mount in hand.mounts)
    if not chosen:
        raise UsageError("dbc: of which fingers? give --node 3 --node 4, or --hand hand.toml")
    if len({*chosen}) < len(chosen):
        raise UsageError("--node: one is given twice; give each finger's own")
    require("cantools", "dbc")
    from hostlink.wire.generate.dbc import Sender, text
    from hostlink.wire.generate.dbc import classic as classic_database
    from hostlink.wire.generate.dbc import fd as fd_database

    senders = [Sender(node, hand.mount(node).name, rate_hz) for node in chosen]
    write_text(text((classic_database if classic else fd_database)(senders)), output, ".dbc", overwrite)
