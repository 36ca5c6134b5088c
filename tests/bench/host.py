"""The host's cost of a sample: `python -m tests.bench host`.

A control loop's: instructions of `CanDecoder.receive` and of reading four values, counted by
`tests.bench.counter`. A recording's: time and peak memory a line of `to_arrays`, beside python-can's reader
with cantools and the generated DBC, which check no CRC and no order, in the same run.
"""

import tempfile
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import can
import cantools
import click

from hostlink import to_arrays
from tests.bench.counter import counted
from tests.bench.host_child import PERIOD_S, frames_of
from tests.bench.output import ROOT, show, write_json, writes_results

COUNTED, LINES = 1000, 100_000
BEGIN_S = 1_767_225_600.0
DBC = ROOT / "hostlink" / "dbc" / "voronoi_touch_fd.dbc"


def write_log(path: Path, lines_n: int) -> None:
    """A log of samples of one finger, in the format of its name."""
    logger = can.Logger(str(path))
    for k, data in enumerate(frames_of(lines_n)):
        time_s = BEGIN_S + PERIOD_S * k
        logger.on_message_received(can.Message(time_s, 0x181, False, data=data, is_fd=True, channel=0))
    logger.stop()


def by_cantools(path: Path) -> dict[str, list[object]]:
    """Columns of all signals, by python-can's reader and cantools."""
    database = cantools.database.load_file(DBC)
    assert isinstance(database, cantools.database.can.Database)
    message = database.get_message_by_frame_id(0x181)
    columns: dict[str, list[object]] = {signal.name: [] for signal in message.signals}
    for frame in can.LogReader(str(path)):
        values = message.decode(bytes(frame.data), decode_choices=False, scaling=True)
        assert isinstance(values, dict)
        for name, value in values.items():
            columns[name].append(value)
    return columns


def cost(read: Callable[[Path], object], path: Path, lines_n: int) -> tuple[float, float]:
    """Time in us and peak memory in bytes, a line."""
    begun_s = time.process_time()
    read(path)
    us = 1e6 * (time.process_time() - begun_s) / lines_n
    tracemalloc.start()
    read(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return us, peak / lines_n


@click.command("host")
@writes_results
def command(out: Path) -> None:
    """Instructions of a decoded sample; time and memory of a recording, against python-can and cantools."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        counts = counted(["tests.bench.host_child", str(COUNTED)], COUNTED, Path(folder) / "counts")
        for suffix in ("log", "blf"):
            path = Path(folder) / f"bus.{suffix}"
            write_log(path, LINES)
            for name, read in (("to_arrays", to_arrays), ("python-can, cantools", by_cantools)):
                us, peak = cost(read, path, LINES)
                rows.append({"format": suffix, "reader": name, "us a line": us, "bytes a line": peak})
    write_json(out / "host.json", {"instructions": counts.instructions, "lines": LINES, "recordings": rows})
    click.echo(f"{counts.instructions:,} instructions a sample, received and four values read")
    show(rows, f"{LINES:,} samples of one finger")
