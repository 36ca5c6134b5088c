"""The cost of coding: processor time of one frame each way, best of several runs over random samples."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from random import Random
from typing import Any

import click
from rich.console import Console
from rich.table import Table

from hostlink.decoder import CanDecoder, SerialDecoder
from hostlink.wire import Message, encode_frame, pack_detail, pack_parts, pack_state, unpack_state
from tests.bench.output import writes_results
from tests.support.states import random_state


def cost_us(work: Callable[[Any], object], inputs: Iterable[Any], runs: int) -> float:
    """Smallest processor time of one call over the runs, us."""
    inputs = list(inputs)
    best = float("inf")
    for _ in range(runs):
        begun = time.process_time()
        for item in inputs:
            work(item)
        best = min(best, time.process_time() - begun)
    return best / len(inputs) * 1e6


@click.command()
@click.option("--samples", default=2000, show_default=True, help="Random samples in one run.")
@click.option("--runs", default=9, show_default=True, help="Runs; the fastest counts.")
@writes_results
def command(samples: int, runs: int, out: Path) -> None:
    """Coding of state frames, classic parts, serial frames and detail frames."""
    rng = Random(1)
    states = [random_state(rng, i) for i in range(samples)]
    frames = [pack_state(state, i) for i, state in enumerate(states)]
    lines = [encode_frame(Message.STATE, frame) for frame in frames]
    pins = [[(rng.gauss(0, 5), rng.gauss(0, 5), rng.gauss(0, 0.2)) for _ in range(331)]] * 20
    can, serial = CanDecoder(), SerialDecoder()
    rows = {
        "state frame, encode": cost_us(lambda s: pack_state(s, 1), states, runs),
        "state frame, decode": cost_us(unpack_state, frames, runs),
        "state frame, through the CAN decoder": cost_us(lambda f: can.receive(0x181, f), frames, runs),
        "serial framing, encode": cost_us(lambda f: encode_frame(Message.STATE, f), frames, runs),
        "serial, through the decoder": cost_us(serial.receive, lines, runs),
        "classic parts, encode": cost_us(lambda s: pack_parts(s, 1), states, runs),
        "detail of 331 pins, encode": cost_us(lambda p: pack_detail(1, p, 0), pins, runs),
    }
    table = Table("", "us", title="Coding, processor time of one")
    for name, value in rows.items():
        table.add_row(name, f"{value:.1f}")
    Console().print(table)
    (out / "wire.json").write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    command()
