"""Commands that let samples flow by: monitor, record, decode."""

from __future__ import annotations

import json
import logging
import queue
import sys
import time
from contextlib import ExitStack, suppress
from dataclasses import asdict
from math import isnan
from pathlib import Path
from typing import Any

import click

from hostlink.client import Connection, connect
from hostlink.decoder import CanDecoder, Sample, SerialDecoder
from hostlink.errors import ConnectError
from hostlink.monitor import Board, line, table
from hostlink.recording import SERIAL_SUFFIX, LogWriter, SerialWriter, check_suffix, decode_recording
from hostlink.wire import State, Status
from hostlink.wire.address import parse_address

# The pace of the display. It shows what holds, news or none (a link that is down, a rate that falls): no
# event of the link could stand in for it.
LOOK_S = 0.1  # a table that changes faster cannot be read
LINE_S = 1.0
seconds_option = click.option(
    "--seconds", type=click.FloatRange(min=0, min_open=True), help="Stop after this time; else at Ctrl-C."
)


@click.command()
@click.argument("address")
@seconds_option
@click.option("--plain", is_flag=True, help="Lines, not a table; so it is where stdout is no terminal.")
def monitor(address: str, seconds: float | None, plain: bool) -> None:
    """Show what the fingers at ADDRESS feel, and how the link does."""
    end_s = None if seconds is None else time.monotonic() + seconds
    with connect(address) as hand:
        board = Board(hand)
        with suppress(KeyboardInterrupt):  # Ctrl-C is how one stops looking
            if plain or not sys.stdout.isatty():
                _print_lines(board, end_s, address)
            else:
                _show_table(hand, board, end_s)


def _print_lines(board: Board, end_s: float | None, address: str) -> None:
    looked = False
    while (wait_s := _left(end_s, LINE_S)) > (LOOK_S if looked else 0):  # a rate over less is noise
        time.sleep(wait_s)
        rows, looked = board.look(), True
        for row in rows:
            click.echo(line(row))
        if not rows:
            click.echo(f"{address}: nothing heard yet")
        sys.stdout.flush()


def _show_table(hand: Connection, board: Board, end_s: float | None) -> None:
    from rich.live import Live

    # The table says itself when the link is down; a line of the log would tear it.
    logging.getLogger("hostlink").addHandler(logging.NullHandler())
    with Live(auto_refresh=False, screen=False) as live:
        while (wait_s := _left(end_s, LOOK_S)) > 0:
            time.sleep(wait_s)
            link = "" if hand.up else "  (link down)"
            live.update(table(board.look(), f"{hand.address}{link}"), refresh=True)


def _left(end_s: float | None, most_s: float) -> float:
    return most_s if end_s is None else min(most_s, end_s - time.monotonic())


@click.command()
@click.argument("address")
@click.argument("file", type=click.Path(path_type=Path, dir_okay=False))
@seconds_option
def record(address: str, file: Path, seconds: float | None) -> None:
    """Record all that comes in at ADDRESS into FILE: .log or .blf for a bus, .serial for a line."""
    path = check_suffix(file)
    is_can = parse_address(address).is_can
    if is_can == (path.suffix.lower() == SERIAL_SUFFIX):
        raise ConnectError(f"{path}: a bus is recorded as .log or .blf, a serial line as .serial")
    end_s = None if seconds is None else time.monotonic() + seconds
    arrived: queue.SimpleQueue[Any] = queue.SimpleQueue()
    written_n = 0
    with ExitStack() as stack:
        hand = stack.enter_context(connect(address))
        writer: Any = stack.enter_context(LogWriter(path) if is_can else SerialWriter(path))
        # The clock on the wall: logs are compared with other logs.
        hand.on_raw(lambda data, _: arrived.put((data, time.time())))
        try:
            while (wait_s := _left(end_s, LINE_S)) > 0:
                try:
                    data, at_s = arrived.get(timeout=wait_s)
                except queue.Empty:
                    continue
                if is_can:
                    writer.write(data)
                else:
                    writer.write(data, at_s)
                written_n += 1
        except KeyboardInterrupt:
            click.echo("", err=True)  # Ctrl-C is how a recording ends
    what = "frames" if is_can else "chunks"
    samples = sum(s.received_n for s in hand.statistics.values())
    click.echo(f"{path}: {written_n} {what}, {samples} samples", err=True)


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--json/--text", "as_json", default=True, help="JSON objects (default), or plain text.")
@click.option("--finger", type=click.IntRange(0, 127), help="Only this finger.")
@click.option("--summary", is_flag=True, help="Counts of each finger on stderr at the end.")
def decode(file: Path, as_json: bool, finger: int | None, summary: bool) -> None:
    """Print the samples in a recording FILE (.log, .blf, .serial), one line each."""
    is_serial = file.suffix.lower() == SERIAL_SUFFIX
    decoder: CanDecoder | SerialDecoder = SerialDecoder() if is_serial else CanDecoder()
    for event in decode_recording(file, decoder):
        if isinstance(event, Sample) and finger in (None, event.node):
            click.echo(_json(event) if as_json else _text(event))
    if summary:
        for node, statistics in sorted(decoder.statistics.items()):
            counts = " ".join(f"{name.removesuffix('_n')}={n}" for name, n in asdict(statistics).items() if n)
            click.echo(f"finger={node} {counts}", err=True)


def _json(event: Sample) -> str:
    """One sample as a JSON object; NaN is null, status bits are names."""
    values: dict[str, Any] = {"finger": event.node, "arrival_s": event.arrival_s, "lost_n": event.lost_n}
    for name, value in asdict(event.state).items():
        values[name] = _plain(value)
    values["status"] = [bit.name for bit in Status if bit in event.state.status]
    return json.dumps(values)


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return None if isnan(value) else round(value, 6)
    if isinstance(value, dict):
        return {name: _plain(v) for name, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    return value


def _text(event: Sample) -> str:
    s: State = event.state
    return (
        f"{event.arrival_s:.6f} finger={event.node} sample={s.sample} "
        f"displacement_mm={s.displacement_mm:.3f} shear_mm={s.shear_x_mm:.3f},{s.shear_y_mm:.3f} "
        f"force_n={s.force_n:.3f} contacts={s.contact_n}"
    )
