"""Fingers on one bus: losses, and latency of samples.

    python -m tests.bench link --seconds 600 --fingers 5 --rate 250 --bus virtual --bus udp

Latency is from just before `send` to the callback of the host's client, on one clock. UDP's sender is a
process of its own, as a finger is; the virtual bus exists within one process only. The rate counts as
reached when every tick was served; a late tick is sent late, never skipped.
"""

import multiprocessing
import queue
import sys
import threading
import time
from pathlib import Path
from typing import Any

import click
import numpy as np

import hostlink
from edge.link.sinks import CanFdSink, open_sink
from hostlink.wire import Contact, State
from tests.bench.output import show, write_json, writes_results

PORT = 43_999
BUSES = {"virtual": "virtual:bench", "udp": f"udp:239.0.0.5?port={PORT}"}
SETTLE_S = 0.5  # longest wait after the last sample, for samples under way


def sample(number: int) -> State:
    """A sample with every field valid: the longest to pack and unpack."""
    return State(
        sample=number,
        capture_time_us=time.monotonic_ns() // 1000,
        latency_us=0.0,
        pins_tracked=1.0,
        contact_n=2,
        contacts=(Contact(1.0, -1.0, 0.5), Contact(-3.0, 2.0, 0.4)),
        displacement_mm=1.234,
        shear_x_mm=0.1,
        shear_y_mm=-0.2,
        force_n=2.0,
    )


def feed(address: str, fingers: int, rate_hz: float, seconds: float, report: Any) -> None:
    """Send as that many fingers; put what was sent and what was dropped into `report`."""
    option = "&" if "?" in address else "?"
    sinks = [open_sink(f"{address}{option}node={k + 1}") for k in range(fingers)]
    assert all(isinstance(sink, CanFdSink) for sink in sinks)
    begun_s, period_s = time.monotonic(), 1 / rate_hz
    for number in range(round(seconds * rate_hz)):
        wait_s = begun_s + number * period_s - time.monotonic()
        if wait_s > 0:
            time.sleep(wait_s)  # a sender that keeps time, as a camera does
        for sink in sinks:
            sink.send(sample(number))
    for sink in sinks:
        sink.close()
    report.put((sum(s.counters.sent for s in sinks), sum(s.counters.dropped for s in sinks)))


def measure(bus: str, fingers: int, rate_hz: float, seconds: float) -> dict[str, float | str]:
    """One run on one bus."""
    late_us: list[float] = []
    address = BUSES[bus]

    def receive(received: hostlink.Sample) -> None:
        now_us = time.monotonic_ns() // 1000
        late_us.append((now_us - received.state.capture_time_us) % 2**32)
        if len(late_us) >= awaited_n:
            arrived.set()

    arrived, awaited_n = threading.Event(), sys.maxsize
    with hostlink.connect(address) as hand:
        hand.on_sample(receive)
        context = multiprocessing.get_context("spawn")
        report: Any = queue.Queue() if bus == "virtual" else context.Queue()
        make: Any = threading.Thread if bus == "virtual" else context.Process
        sender = make(target=feed, args=(address, fingers, rate_hz, seconds, report))
        sender.start()
        sent_n, dropped_n = report.get()
        sender.join()
        awaited_n = sent_n
        if len(late_us) < sent_n:
            arrived.wait(SETTLE_S)  # samples that have not arrived by then are lost
        counted = list(hand.statistics.values())
    p50, p99, p999 = np.percentile(late_us, (50, 99, 99.9))
    return {
        "bus": bus,
        "fingers": fingers,
        "rate_hz": rate_hz,
        "seconds": seconds,
        "sent": sent_n,
        "refused_by_link": dropped_n,
        "received": sum(s.received_n for s in counted),
        "lost": sent_n - sum(s.received_n for s in counted),
        "counted_lost": sum(s.lost_n for s in counted),
        "corrupt": sum(s.corrupt_n for s in counted),
        "p50_us": float(p50),
        "p99_us": float(p99),
        "p99.9_us": float(p999),
        "max_us": float(max(late_us)),
    }


@click.command()
@click.option("--seconds", type=click.FloatRange(min=0.1), default=10.0, show_default=True)
@click.option("--fingers", type=click.IntRange(1, 127), default=5, show_default=True)
@click.option("--rate", type=click.FloatRange(1, 2000), default=250.0, show_default=True)
@click.option("--bus", "buses", type=click.Choice(sorted(BUSES)), multiple=True, help="Default: all.")
@writes_results
def command(seconds: float, fingers: int, rate: float, buses: tuple[str, ...], out: Path) -> None:
    """Fingers on one bus: losses, and latency of samples. Exit code 1: something was lost."""
    rows = [measure(bus, fingers, rate, seconds) for bus in buses or sorted(BUSES)]
    show(rows)
    write_json(out / "link.json", rows)
    sys.exit(1 if any(row["lost"] for row in rows) else 0)
