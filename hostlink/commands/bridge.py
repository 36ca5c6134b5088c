"""`python -m hostlink bridge`: fingers to ROS 2 and Foxglove."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import ExitStack, nullcontext
from pathlib import Path

import click

from hostlink.bridge.front_door import normal_origin
from hostlink.bridge.page_camera import PageAddress, parse_page
from hostlink.bridge.run import Bridge, Outlet
from hostlink.cli_types import WholeNumber, seconds_option
from hostlink.client import connect
from hostlink.commands.hand import hand_option
from hostlink.errors import UsageError
from hostlink.extras import require
from hostlink.hand_file import HandFile
from hostlink.output_file import check_output, writing
from hostlink.web import Listen, WebError, parse_listen


@click.command()
@click.argument("address")
@click.option("--foxglove", "foxglove", is_flag=True, help="Serve Foxglove, Lichtblick and PlotJuggler.")
@click.option(
    "--listen",
    default="127.0.0.1:8765",
    show_default=True,
    metavar="HOST:PORT",
    help="With --foxglove: where. Whoever can reach it may look.",
)
@click.option(
    "--allow-control",
    is_flag=True,
    help="With --foxglove: let viewers on this machine tare and set; pages in a browser only with --origin.",
)
@click.option(
    "--origin",
    "origins",
    multiple=True,
    metavar="SCHEME://HOST[:PORT]",
    help="With --allow-control: a viewer's page that may do so too, e.g. http://localhost:8080; repeatable.",
)
@click.option(
    "--record", type=click.Path(path_type=Path), help="With --foxglove: the same topics into this .mcap file."
)
@click.option(
    "--view",
    "pages",
    multiple=True,
    metavar="[FINGER=]URL",
    help="A finger's live page, for its camera; once for each finger.",
)
@click.option("--overwrite", is_flag=True, help="Replace that file if it exists.")
@click.option(
    "--ros",
    type=click.Choice(["humble", "jazzy", "kilted", "lyrical"]),
    help="Publish to ROS 2 of this distribution, over rmw_zenoh.",
)
@click.option(
    "--router", default="tcp/127.0.0.1:7447", show_default=True, help="With --ros: the Zenoh router to join."
)
@click.option(
    "--domain",
    type=WholeNumber(0, 232),
    default=0,
    envvar="ROS_DOMAIN_ID",
    help="With --ros: domain ID, else 0.",
)
@click.option("--namespace", help="With --ros: before all names, e.g. /left_hand; else the hand's name.")
@hand_option
@seconds_option
def bridge(
    address: str,
    foxglove: bool,
    listen: str,
    allow_control: bool,
    origins: tuple[str, ...],
    record: Path | None,
    pages: tuple[str, ...],
    overwrite: bool,
    ros: str | None,
    router: str,
    domain: int,
    namespace: str | None,
    hand: HandFile,
    seconds: float | None,
) -> None:
    """Pass the samples of the fingers at ADDRESS to ROS 2 (--ros jazzy), to viewers (--foxglove) or both."""
    if not foxglove and ros is None:
        raise UsageError("bridge: where to? give --foxglove, --ros DISTRIBUTION or both")
    if record is not None and not foxglove:
        raise UsageError("--record: the topics of --foxglove are what is recorded; give it too")
    if (allow_control or origins) and not (foxglove and allow_control):
        raise UsageError(
            "--allow-control, --origin: give --foxglove --allow-control, and --origin if you need it"
        )
    path = None if record is None else check_output(record, (".mcap",), overwrite=overwrite)
    where, cameras = _listen(listen), _cameras(pages)
    control = {normal_origin(text) for text in origins} if allow_control else None
    with ExitStack() as stack:
        # First, so that a wrong address is reported at once: a router may take its time.
        connection = stack.enter_context(connect(address, hand=hand))
        file = stack.enter_context(nullcontext() if path is None else writing(path, overwrite))
        outlets: list[Outlet] = []
        if foxglove:
            outlets.append(_foxglove(where, file, cameras, control, hand))
            stack.callback(outlets[-1].close)
        if ros is not None:
            names = hand.namespace if namespace is None else namespace
            outlets.append(_ros(ros, router, domain, names, seconds, hand, cameras))
            stack.callback(outlets[-1].close)
        carrier = Bridge(connection, outlets)
        try:
            carrier.run(seconds)
        except KeyboardInterrupt:  # the normal end
            click.echo("", err=True)
    if carrier.left_out_n:
        click.echo(f"{carrier.left_out_n} samples left out: slower than the fingers", err=True)


def _listen(text: str) -> Listen:
    try:
        # The protocol has no token: `auto` means that others may watch, but give no commands.
        return parse_listen(text, "auto")
    except WebError as error:
        raise UsageError(str(error)) from None


def _cameras(pages: Sequence[str]) -> list[PageAddress]:
    cameras = [parse_page(text) for text in pages]
    if cameras:  # before a router is waited for
        require("aiohttp", "view")
    twice = [c.finger for i, c in enumerate(cameras) if c.finger in {other.finger for other in cameras[:i]}]
    if twice:
        raise UsageError(f"--view: finger {twice[0]} is given twice; give each its number, as 2=URL")
    return cameras


def _foxglove(
    listen: Listen,
    file: Path | None,
    cameras: Sequence[PageAddress],
    control: Collection[str] | None,
    hand: HandFile,
) -> Outlet:
    from hostlink.bridge.foxglove import LAYOUT, FoxgloveOutlet

    if file is not None:
        file.unlink()  # an empty one made by `writing`; the SDK creates its own
    outlet = FoxgloveOutlet(listen, file, cameras, control, hand)
    click.echo(f"foxglove: {outlet.url}; layout to import: {LAYOUT}", err=True)
    return outlet


def _ros(
    distribution: str,
    router: str,
    domain: int,
    namespace: str,
    wait_s: float | None,
    hand: HandFile,
    cameras: Sequence[PageAddress],
) -> Outlet:
    from hostlink.bridge.ros import RosOutlet

    outlet = RosOutlet(distribution, router, domain, namespace, wait_s, hand, cameras)
    click.echo(f"ros: {distribution}, domain {domain}, router {router}", err=True)
    return outlet
