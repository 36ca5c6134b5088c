"""`python -m hostlink view`."""

from __future__ import annotations

import threading
from pathlib import Path

import click

from hostlink.cli_types import seconds_option
from hostlink.client import connect
from hostlink.commands.hand import hand_option
from hostlink.errors import UsageError
from hostlink.hand_file import HandFile
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
@hand_option
@seconds_option
def view(
    address: str,
    listen: str,
    token: str | None,
    token_file: Path | None,
    hand: HandFile,
    seconds: float | None,
) -> None:
    """Show the fingers at ADDRESS in a browser, laid out as a hand."""
    try:
        where = parse_listen(listen, find_token(token, token_file, "--token-file"))
        from hostlink.view import HandView

        with connect(address, hand=hand) as connection:
            page = HandView(connection, where)
            page.start()
            click.echo(f"live page: {page.server.url}", err=True)
            try:
                threading.Event().wait(seconds)
            finally:
                page.close()
    except WebError as error:
        raise UsageError(str(error)) from None
