"""`python -m hostlink view`."""

from __future__ import annotations

import re
import threading
from pathlib import Path

import click

from hostlink.cli_types import seconds_option
from hostlink.client import connect
from hostlink.errors import UsageError
from hostlink.web import TOKEN_VARIABLE, WebError, find_token, parse_listen


@click.command()
@click.argument("address")
@click.option(
    "--listen",
    default="127.0.0.1:8766",
    show_default=True,
    metavar="HOST:PORT",
    help="Where the page is served; beyond this machine only with a token.",
)
@click.option(
    "--token",
    metavar="TOKEN|auto",
    help="Let the page tare, with this token of 8 characters or more; auto makes one. All users of the "
    f"machine see a command line: {TOKEN_VARIABLE} in the environment or a file is safer.",
)
@click.option(
    "--token-file",
    type=click.Path(path_type=Path, dir_okay=False),
    help="The token is the first line of this file.",
)
@click.option(
    "--hand", default="1,2,3,4,5", show_default=True, help="Node numbers from thumb to little finger."
)
@click.option("--left", is_flag=True, help="A left hand: the thumb on the right.")
@seconds_option
def view(
    address: str,
    listen: str,
    token: str | None,
    token_file: Path | None,
    hand: str,
    left: bool,
    seconds: float | None,
) -> None:
    """Show the fingers at ADDRESS in a browser, laid out as a hand."""
    nodes = _nodes(hand)
    try:
        where = parse_listen(listen, find_token(token, token_file, "--token-file"))
        from hostlink.view import HandView

        with connect(address) as connection:
            page = HandView(connection, where, nodes, left)
            page.start()
            click.echo(f"live page: {page.server.url}", err=True)
            try:
                threading.Event().wait(seconds)
            finally:
                page.close()
    except WebError as error:
        raise UsageError(str(error)) from None


def _nodes(hand: str) -> list[int]:
    """The numbers, each one of a node and named once. Raises UsageError."""
    numbers = hand.split(",")
    if not all(re.fullmatch(r"\s*\d{1,9}\s*", number) and 1 <= int(number) <= 127 for number in numbers):
        raise UsageError(f"--hand {hand}: give node numbers from 1 to 127, e.g. 1,2,3,4,5")
    nodes = [int(number) for number in numbers]
    twice = [node for node in nodes if nodes.count(node) > 1]
    if twice:
        raise UsageError(f"--hand {hand}: node {twice[0]} is given twice; give each finger's own")
    return nodes
