"""Commands on streams of samples: monitor, record, decode."""

from __future__ import annotations

import json
import logging
import queue
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import asdict
from itertools import chain
from math import isnan
from pathlib import Path
from typing import Any

import click

from hostlink.cli_types import WholeNumber, channel_option, counted, seconds_option
from hostlink.client import Connection, connect
from hostlink.commands.hand import hand_option
from hostlink.commands.monitor import Board, line, screen
from hostlink.decoder import SERIAL_NODE, CanDecoder, Event, Sample, SerialDecoder
from hostlink.errors import ConnectError, LinkTimeout, LogError, UsageError, VersionMismatch
from hostlink.hand_file import HandFile
from hostlink.interrupt import calling_on_signals
from hostlink.output_file import WriteError, check_output, writing
from hostlink.recording import (
    CAN_SUFFIXES,
    SERIAL_SUFFIX,
    LogWriter,
    SerialWriter,
    check_suffix,
    decode_recording,
    decoder_for,
)
from hostlink.table import write_csv, write_parquet
from hostlink.wire import State, Status
from hostlink.wire.address import parse_address
from hostlink.wire.open_errors import message_of

# Refresh period of the display. It is a fixed period, not an event of the link, because a missing sample (a
# link that is down, a falling rate) has to be shown too.
REFRESH_S = 0.1  # a table that changes faster cannot be read
LINE_S = 1.0


@click.command()
@click.argument("address")
@hand_option
@seconds_option
@click.option("--plain", is_flag=True, help="Print lines, not a table; the default if stdout is no terminal.")
def monitor(address: str, hand: HandFile, seconds: float | None, plain: bool) -> None:
    """Show the samples of the fingers at ADDRESS, and the state of the link."""
    end_s = None if seconds is None else time.monotonic() + seconds
    with connect(address, hand=hand) as connection:
        board = Board(connection)
        with suppress(KeyboardInterrupt):  # Ctrl-C is how one stops looking
            if plain or not sys.stdout.isatty():
                _print_lines(board, end_s, address)
            else:
                _show_table(connection, board, end_s)
            if (
                not connection.fingers and not connection.silent_nodes
            ):  # only with --seconds: there is no other end
                raise LinkTimeout(f"{address}: no finger was heard for {seconds:g} s")


def _print_lines(board: Board, end_s: float | None, address: str) -> None:
    shown = False
    while (wait_s := _left(end_s, LINE_S)) > (REFRESH_S if shown else 0):  # a rate over less is noise
        time.sleep(wait_s)
        rows, shown = board.rows(), True
        for row in rows:
            click.echo(line(row))
        if not rows:
            click.echo(f"{address}: nothing received yet")
        sys.stdout.flush()


def _show_table(hand: Connection, board: Board, end_s: float | None) -> None:
    from rich.live import Live

    # The table shows when the link is down; a log line would break it.
    logging.getLogger("hostlink").addHandler(logging.NullHandler())
    with Live(auto_refresh=False, screen=False) as live:
        while (wait_s := _left(end_s, REFRESH_S)) > 0:
            time.sleep(wait_s)
            link = "" if hand.up else "  (link down)"
            live.update(screen(board.rows(), f"{hand.address}{link}", live.console), refresh=True)


def _left(end_s: float | None, most_s: float) -> float:
    return most_s if end_s is None else min(most_s, end_s - time.monotonic())


@click.command()
@click.argument("address")
@click.argument("file", type=click.Path(path_type=Path))
@seconds_option
@click.option("--overwrite", is_flag=True, help="Replace FILE if it exists.")
def record(address: str, file: Path, seconds: float | None, overwrite: bool) -> None:
    """Record all that comes in at ADDRESS into FILE: .log or .blf for a bus, .serial for a line.

    Ends after --seconds, or with Ctrl-C.
    """
    place = parse_address(address)
    suffixes = CAN_SUFFIXES if place.is_can else (SERIAL_SUFFIX,)
    if check_suffix(file, (*CAN_SUFFIXES, SERIAL_SUFFIX)).suffix.lower() not in suffixes:
        raise ConnectError(f"{file}: a bus is recorded as .log or .blf, a serial line as .serial")
    path = check_output(file, suffixes, overwrite=overwrite)
    try:
        with connect(address) as hand, writing(path, overwrite, keep_partial=True) as unfinished:
            written_n, samples_n = _record(hand, unfinished, seconds)
            if not written_n:  # no file of nothing, least of all in place of an earlier recording
                unfinished.unlink()
                raise LinkTimeout(f"{address}: nothing came in")
    except LogError as error:  # it names the temporary file, which the user does not know
        why = message_of(error.__cause__ or error)
        raise WriteError(f"{path}: cannot be written: {why}; the recording ends there") from None
    what = "frame" if place.is_can else "chunk"
    click.echo(f"{path}: {counted(written_n, what)}, {counted(samples_n, 'sample')}", err=True)


def _record(hand: Connection, path: Path, seconds: float | None) -> tuple[int, int]:
    """Record until the time is up or Ctrl-C; returns the messages written and the samples in them. Raises
    LogError.
    """
    arrived: queue.SimpleQueue[tuple[Any, float] | None] = queue.SimpleQueue()
    is_can = hand.address.is_can
    node = hand.address.node or SERIAL_NODE
    decoder: Any = CanDecoder() if is_can else SerialDecoder(node)  # only counts the contents of the file
    written_n = samples_n = 0
    # A signal is one more thing that arrives: as an exception it could cut off what is being written.
    with (
        calling_on_signals(lambda: arrived.put(None)),
        LogWriter(path) if is_can else SerialWriter(path, node) as writer,
    ):
        # Wall clock, since logs are compared with other logs; but one that is set meanwhile is not followed.
        ahead_s = time.time() - time.monotonic()
        end = hand.on_raw(lambda data, arrival_s: arrived.put((data, arrival_s + ahead_s)))
        for data, at_s in _until_ended(arrived, None if seconds is None else time.monotonic() + seconds, end):
            events: list[Event] = []
            if isinstance(writer, LogWriter):
                data.timestamp = at_s
                writer.write(data)
                if not (data.is_extended_id or data.is_error_frame or data.is_remote_frame):
                    with suppress(VersionMismatch):  # recorded all the same
                        events = decoder.receive(data.arbitration_id, data.data)
            else:
                writer.write(data, at_s)
                with suppress(VersionMismatch):
                    events = decoder.receive(data)
            written_n += 1
            samples_n += sum(isinstance(event, Sample) for event in events)
    return written_n, samples_n


def _until_ended(
    arrived: queue.SimpleQueue[tuple[Any, float] | None], end_s: float | None, end: Callable[[], None]
) -> Iterator[tuple[Any, float]]:
    """All that arrives until the time is up or None does, including the last message before it."""
    while (wait_s := _left(end_s, LINE_S)) > 0:
        with suppress(queue.Empty):
            message = arrived.get(timeout=wait_s)
            if message is None:
                break
            yield message
    end()
    with suppress(queue.Empty):
        while True:
            message = arrived.get_nowait()
            if message is not None:
                yield message


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--json/--text", "as_json", default=True, help="JSON objects (default), or plain text.")
@click.option(
    "--csv", "csv_file", type=click.Path(path_type=Path), help="Write a table to this file instead."
)
@click.option(
    "--parquet", "parquet_file", type=click.Path(path_type=Path), help="The same, as Parquet (extra `data`)."
)
@click.option("--overwrite", is_flag=True, help="Replace that file if it exists.")
@click.option("--finger", type=WholeNumber(1, 127), help="Only this finger.")
@channel_option
@click.option("--summary", is_flag=True, help="Counts of each finger on stderr at the end.")
def decode(
    file: Path,
    as_json: bool,
    csv_file: Path | None,
    parquet_file: Path | None,
    overwrite: bool,
    finger: int | None,
    channel: str | None,
    summary: bool,
) -> None:
    """Print the samples in FILE, one line each, or write them as a table.

    FILE is a recording of a bus (.log, .blf, .asc), of a serial line (.serial) or of the edge (.mcap).
    """
    if csv_file is not None and parquet_file is not None:
        raise UsageError("--csv and --parquet: give one of them")
    decoder = decoder_for(file)
    samples = (
        event for event in decode_recording(file, decoder, channel, finger) if isinstance(event, Sample)
    )
    shown_n = 0
    if csv_file is not None:
        path = check_output(csv_file, (".csv",), (file,), overwrite)
        shown_n = _write_table(samples, write_csv, path, overwrite)
    elif parquet_file is not None:
        path = check_output(parquet_file, (".parquet",), (file,), overwrite)
        shown_n = _write_table(samples, write_parquet, path, overwrite)
    else:
        for sample in samples:
            click.echo(_json(sample) if as_json else _text(sample))
            shown_n += 1
    if summary:
        for node, statistics in sorted(decoder.statistics.items()):
            counts = " ".join(f"{name.removesuffix('_n')}={n}" for name, n in asdict(statistics).items() if n)
            click.echo(f"finger={node} {counts}", err=True)
    if not shown_n:
        raise LogError(f"{file}: {_nothing_found(decoder, finger)}")
    if damaged_n := _damaged_n(decoder):
        click.echo(f"{file}: {counted(damaged_n, 'damaged frame')} not decoded", err=True)


def _write_table(
    samples: Iterator[Sample], write: Callable[[Iterable[Sample], Path], int], path: Path, overwrite: bool
) -> int:
    """Write the samples; how many. Raises LogError: the recording is damaged; what came before is written."""
    damage: list[LogError] = []

    def until_damage() -> Iterator[Sample]:
        try:
            yield from samples
        except LogError as error:
            damage.append(error)

    readable = until_damage()
    written_n = 0
    if (first := next(readable, None)) is not None:  # no file without a sample
        with writing(path, overwrite) as unfinished:
            written_n = write(chain((first,), readable), unfinished)
        click.echo(f"{path}: {written_n} samples", err=True)
    if damage:
        raise damage[0]
    return written_n


def _nothing_found(decoder: CanDecoder | SerialDecoder, finger: int | None) -> str:
    """Why no sample was printed, and what is there instead."""
    found = [node for node, s in sorted(decoder.statistics.items()) if s.received_n]
    if found:
        return f"no sample of finger {finger}; it holds those of {', '.join(map(str, found))}"
    damaged = counted(_damaged_n(decoder), "damaged frame")
    which = "a fingertip" if finger is None else f"finger {finger}"
    return f"no sample of {which}; {damaged}, {getattr(decoder, 'unknown_n', 0)} of other devices"


def _damaged_n(decoder: CanDecoder | SerialDecoder) -> int:
    """Frames of fingertips that came in damaged."""
    return sum(statistics.corrupt_n for statistics in decoder.statistics.values())


def _json(event: Sample) -> str:
    """One sample as a JSON object; NaN is null, status bits are names."""
    values: dict[str, Any] = {
        "finger": event.node,
        "arrival_s": _plain(event.arrival_s),
        "lost_n": event.lost_n,
    }
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
        f"force_n={s.force_n:.3f} force_xy_n={s.force_x_n:.3f},{s.force_y_n:.3f} "
        f"slip_margin={s.slip_margin:.3f} contacts={s.contact_n}"
    )
