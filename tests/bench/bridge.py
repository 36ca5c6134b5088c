"""Bridges at full rate: fingers in a process of their own, the bridge in this one, a listener in a third.

Counts what of the samples sent arrives, and how long each takes from its capture (3 ms before it is sent) to
the listener, on one machine's clock.
"""

from __future__ import annotations

import json
import multiprocessing as mp
import struct
import threading
import time
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.table import Table

from tests.bench.output import writes_results

PORT = 29_457
BUS = "udp:239.0.0.9?port=29458"
_SETTLE_S = 3.0


def send(fingers: int, rate_hz: float, seconds: float, known: Any, begin: Any, sent: Any) -> None:
    """Fingers on a bus, paced by the clock; `sent` gets the samples of each."""
    from tests.hostlink.bridge.test_foxglove import state
    from tests.hostlink.test_client import make_node

    nodes = [make_node(f"{BUS}&node={n}&ttl=0")[0] for n in range(1, fingers + 1)]
    first = 0
    while not known.wait(0.05):  # until all are known at the other end
        for number, node in enumerate(nodes, 1):
            node.send(state(number, first))
        first += 1
    begin.wait()
    start_s, k = time.monotonic(), 0
    while (due_s := start_s + k / rate_hz) < start_s + seconds:
        time.sleep(max(0.0, due_s - time.monotonic()))
        for number, node in enumerate(nodes, 1):
            node.send(state(number, first + k))
        k += 1
    sent.put(k)
    for node in nodes:
        node.close()


def listen(fingers: int, known: Any, begin: Any, end: Any, result: Any) -> None:
    """Every finger's samples at a peer: counts and latencies (ms) from capture to here, by quantile."""
    import numpy as np

    from tests.hostlink.bridge.ros_peer import Peer, Received

    peer = Peer(PORT)
    latencies: list[float] = []
    numbers: dict[str, list[int]] = {}
    keys: set[str] = set()
    lock = threading.Lock()

    def take(received: Received) -> None:
        sec, nanosec = struct.unpack_from("<iI", received.payload, 4)
        with lock:
            keys.add(received.key)
            if len(keys) == fingers:
                known.set()
            if begin.is_set():
                latencies.append((received.arrival_ns - sec * 1_000_000_000 - nanosec) / 1e6)
                numbers.setdefault(received.key, []).append(received.number)

    peer.subscribe("0/*/sample/**", take)
    end.wait()
    peer.close()
    gaps_n = sum(n[-1] - n[0] + 1 - len(n) for n in numbers.values())
    marks: Any = np.quantile(latencies, (0.5, 0.99, 0.999, 1.0)) if latencies else []
    result.put((len(latencies), gaps_n, [float(m) for m in marks]))


def measure(fingers: int, rate_hz: float, seconds: float) -> dict[str, Any]:
    """One run of the ROS 2 bridge."""
    import hostlink
    from hostlink.bridge.ros import RosOutlet
    from hostlink.bridge.run import Bridge
    from tests.hostlink.bridge.ros_peer import open_router

    context = mp.get_context("spawn")
    known, begin, end = context.Event(), context.Event(), context.Event()
    sent, result = context.Queue(), context.Queue()
    router = open_router(PORT)
    listener = context.Process(target=listen, args=(fingers, known, begin, end, result))
    sender = context.Process(target=send, args=(fingers, rate_hz, seconds, known, begin, sent))
    listener.start()
    with hostlink.connect(BUS) as hand:
        outlet = RosOutlet("jazzy", f"tcp/127.0.0.1:{PORT}")
        bridge = Bridge(hand, [outlet])
        thread = threading.Thread(target=bridge.run)
        thread.start()
        sender.start()
        known.wait()
        end.wait(_SETTLE_S)  # nobody sets it: what is under way arrives before it counts
        begun_s = time.process_time()
        begin.set()
        sent_n = fingers * sent.get()
        end.wait(_SETTLE_S)  # nobody sets it: what has not come by then is lost
        busy = (time.process_time() - begun_s) / seconds
        lost_n = sum(s.lost_n for s in hand.statistics.values())
        end.set()
        received_n, gaps_n, marks = result.get()
        bridge.stop()
        thread.join()
        outlet.close()
    listener.join()
    sender.join()
    router.close()
    return {
        "fingers": fingers, "rate_hz": rate_hz, "seconds": seconds, "sent": sent_n, "received": received_n,
        "lost on the bus": lost_n, "left out by the bridge": bridge.left_out_n, "lost after it": gaps_n,
        "latency ms, median": marks[0], "latency ms, 99 %": marks[1], "latency ms, 99.9 %": marks[2],
        "latency ms, most": marks[3], "share of a core, bridge and router": busy,
    }  # fmt: skip


@click.command()
@click.option("--fingers", default=5, show_default=True)
@click.option("--rate", "rate_hz", default=240.0, show_default=True, help="Samples a second of each, Hz.")
@click.option("--seconds", default=30.0, show_default=True)
@writes_results
def command(fingers: int, rate_hz: float, seconds: float, out: Path) -> None:
    """Samples over CAN frames on UDP, through `bridge --ros`, to a peer in another process."""
    row = measure(fingers, rate_hz, seconds)
    table = Table("", "", title="ROS 2 bridge")
    for name, value in row.items():
        table.add_row(name, f"{value:.3f}" if isinstance(value, float) else str(value))
    Console().print(table)
    (out / "bridge.json").write_text(json.dumps(row, indent=1) + "\n", encoding="utf-8")
