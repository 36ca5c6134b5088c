"""The whole chain on bundled recordings, without hardware: `make demo`.

Each recording goes through the running loop onto a virtual CAN FD bus and onto a serial line (a pair of
pseudo-terminals), is decoded on the host, and is compared with the simulator's truth.
"""

import math
import os
import pty
import select
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

import hostlink
from calib.errors import TableError
from calib.extract import executor
from calib.figures import figure, surface_figure
from edge.calibration import Calibration
from edge.cells import cell_polygons
from edge.errors import SourceError
from edge.link.node import Node
from edge.link.sinks import CanSink, MemorySink, SerialSink, open_sink
from edge.runtime.device import LoopDevice
from edge.runtime.loop import Loop
from edge.runtime.measurement import LoopConfig
from edge.sources import open_source
from edge.types import Feature, Result
from hostlink.output_file import OutputError, check_output, writing
from hostlink.wire import State, pack_state, unpack_state

#: Recording, and the calibration of the tip and tool that it was made with.
RECORDINGS: dict[str, str] = {
    "press": "rings331_ball.json",
    "press_shear": "hex127_flat.json",
    "two_contacts": "rings331_ball.json",
    "nothing": "hex127_flat.json",
}
NODE = 7


@dataclass
class Received:
    """The results of one recording, end to end.

    sent    states computed by the edge, by the 16-bit sample number
    can     states decoded by the host from the bus
    serial  and from the serial line
    last    the last frame's result, for the pictures
    truth   the simulator's, by sample number
    """

    name: str
    sent: dict[int, State]
    can: dict[int, State]
    serial: dict[int, State]
    last: Result
    truth: dict[int, dict[str, Any]]
    calibration: Calibration


@contextmanager
def serial_line() -> Iterator[tuple[str, str]]:
    """Two ends of a serial line: a pair of pseudo-terminals, joined by a thread."""
    with ExitStack() as stack:
        ends = [pty.openpty() for _ in range(2)]
        for master, slave in ends:
            tty.setraw(slave)
            stack.callback(os.close, master)
            stack.callback(os.close, slave)
        stack.enter_context(_joined(ends[0][0], ends[1][0]))
        yield os.ttyname(ends[0][1]), os.ttyname(ends[1][1])


@contextmanager
def _joined(a: int, b: int) -> Iterator[None]:
    wake_r, wake_w = os.pipe()

    def carry() -> None:
        while True:
            ready, _, _ = select.select([a, b, wake_r], [], [])
            if wake_r in ready:
                return
            for source, drain in ((a, b), (b, a)):
                if source in ready:
                    data = os.read(source, 65536)
                    while data:
                        data = data[os.write(drain, data) :]

    thread = threading.Thread(target=carry, daemon=True)
    thread.start()
    try:
        yield
    finally:
        os.write(wake_w, b".")
        thread.join()
        os.close(wake_r)
        os.close(wake_w)


def play(recording: Path, calibration: Calibration) -> Received:
    """Send a recording over both links and collect what arrives.

    Raises  edge.errors.SourceError, SinkError
    """
    with ExitStack() as stack:
        near, far = stack.enter_context(serial_line())
        addresses = {"can": f"virtual:demo-{recording.stem}", "serial": f"serial:{far}"}
        received: dict[str, dict[int, State]] = {name: {} for name in addresses}
        for name, address in addresses.items():
            connection = stack.enter_context(hostlink.connect(address))
            connection.on_sample(partial(_collect, received[name]))
        source = open_source(str(recording))
        stack.callback(source.close)
        loop = Loop(source, [], calibration, LoopConfig(demand=frozenset(Feature)))
        loop.measurement.watch("video")
        device = LoopDevice(loop, "demo")
        for address in (addresses["can"], f"serial:{near}"):
            sink = open_sink(address, node=NODE)
            stack.callback(sink.close)
            assert isinstance(sink, CanSink | SerialSink)
            loop.sinks.append(Node(sink, device))
        memory = MemorySink()
        loop.sinks.append(memory)
        truth: dict[int, dict[str, Any]] = {}

        def keep(result: Result, state: State) -> None:
            truth[state.sample] = result.frame.truth or {}

        loop.result_callbacks.append(keep)
        loop.run()
        sent = {state.sample: state for state in memory.states}
        if loop.measurement.last is None:
            raise SourceError(f"{recording}: no frame after the tare")
        for sink in loop.sinks:
            sink.drain(5.0)
        _await(lambda: all(len(h) >= len(sent) for h in received.values()))
        return Received(
            recording.stem,
            sent,
            received["can"],
            received["serial"],
            loop.measurement.last,
            truth,
            calibration,
        )


def _collect(into: dict[int, State], sample: hostlink.Sample) -> None:
    into[sample.state.sample] = sample.state


def _await(done: Callable[[], bool]) -> None:
    """Wait for bytes that are on their way through the kernel."""
    tick, deadline = threading.Event(), time.monotonic() + 5.0
    while not done() and time.monotonic() < deadline:
        tick.wait(0.01)


def _same(a: State, b: State) -> bool:
    return repr(a) == repr(b)  # NaN is not equal to itself, but has the same representation


def errors(received: Received) -> dict[str, float]:
    """Mean absolute errors of the states decoded by the host, over the pressed frames."""
    place, depth, direction, shear = [], [], [], []
    wrong_n = 0
    for number, state in received.can.items():
        truth = received.truth.get(number)
        if not truth:
            continue
        places = np.array(truth["places_mm"]).reshape(-1, 2)
        if not truth["contacts"]:
            wrong_n += state.contact_n != 0
            continue
        if min(c["depth_mm"] for c in truth["contacts"]) < 0.8:
            continue
        wrong_n += state.contact_n != len(places)
        found = np.array([[c.x_mm, c.y_mm] for c in state.contacts]).reshape(-1, 2)
        if len(found):
            gap = np.hypot(*(places[:, None] - found[None]).transpose(2, 0, 1))
            place.extend(gap.min(axis=1))
        true = complex(*truth["shear_mm"])
        read = complex(state.shear_x_mm, state.shear_y_mm)
        if abs(true) > 0.3:
            direction.append(abs(math.degrees(np.angle(read * true.conjugate()))))
        if len(places) == 1:
            depth.append(abs(state.displacement_mm - truth["depth_mm"]))
            shear.append(abs(read - true))

    def mean(values: list[float]) -> float:
        return float(np.mean(values)) if values else math.nan

    return {
        "place_mm": mean(place),
        "depth_mm": mean(depth),
        "shear_mm": mean(shear),
        "direction_deg": mean(direction),
        "wrong_n": wrong_n,
    }


def demo(data: Path, out: Path, console: Console, overwrite: bool = False) -> None:
    """Play every bundled recording, print the table, write the pictures.

    Raises  TableError: a recording is missing; CalibrationError; OutputError. Nothing is written then
    """
    for name in RECORDINGS:
        if not (data / f"{name}.mcap").is_file():
            raise TableError(f"{data}: no {name}.mcap in it; give --data the bundled recordings")
    for file in set(RECORDINGS.values()):
        Calibration.load(data / file)
    _check_folder(data, out, overwrite)
    table = Table(
        title="What the host decoded, against the simulator's truth",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        padding=(0, 1, 0, 0),
    )
    for name in ("recording", "samples", "pins", "links\nagree", "contacts", "place\nmm", "depth\nmm",
                 "shear\nmm", "angle\ndeg"):  # fmt: skip
        table.add_column(name, justify="left" if name == "recording" else "right", no_wrap=True)
    begun_s = time.monotonic()
    with executor() as processes:
        rows = [processes.submit(_row, data, out, name) for name in RECORDINGS]
        for name, row in zip(RECORDINGS, rows, strict=True):
            table.add_row(*row.result())
            console.print(f"{name}: played over CAN FD and a serial line, {time.monotonic() - begun_s:.0f} s")
    console.print(table)
    console.print("Links agree: what CAN FD and serial brought equals what the edge computed.")
    console.print("Errors: mean absolute, over the frames pressed by 0.8 mm or more.")
    console.print(f"Pictures: {out}/*.png")


def _check_folder(data: Path, out: Path, overwrite: bool) -> None:
    """Make the folder for the pictures. Raises OutputError: not possible, or pictures are there already."""
    if out.resolve() == data.resolve():
        raise OutputError(f"{out}: the recordings are there; give another folder to --out")
    if out.exists() and not out.is_dir():
        raise OutputError(f"{out}: is no folder; give the name of one to --out")
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{out}: cannot be made: {error.strerror}") from None
    for name in RECORDINGS:
        for picture in (f"{name}.png", f"{name}_surface.png"):
            check_output(out / picture, (".png",), (), overwrite)


def _row(data: Path, out: Path, name: str) -> list[str]:
    """Play one recording, draw its pictures. Returns  its row of the table."""
    received = play(data / f"{name}.mcap", Calibration.load(data / RECORDINGS[name]))
    found = errors(received)
    last = received.can[max(received.can)]
    # What is sent is rounded to the fields' resolution.
    same = received.can.keys() == received.serial.keys() and all(
        _same(received.can[k], received.serial[k])
        and _same(received.can[k], unpack_state(pack_state(state, 0)))
        for k, state in received.sent.items()
    )
    _pictures(received, out)
    return [
        name,
        str(len(received.sent)),
        str(received.last.tracks.n_seen),
        "yes" if same else f"{len(received.sent)}/{len(received.can)}/{len(received.serial)}",
        f"{last.contact_n}" + (f" ({found['wrong_n']:.0f} wrong)" if found["wrong_n"] else ""),
        *(
            f"{found[key]:.2f}" if math.isfinite(found[key]) else "-"
            for key in ("place_mm", "depth_mm", "shear_mm", "direction_deg")
        ),
    ]


def _pictures(received: Received, out: Path) -> None:
    result = received.last
    if result.cells is None or result.features is None:
        return
    scale = received.calibration.mm_per_px or 0.0
    polygons = cell_polygons(result.cells)
    with writing(out / f"{received.name}.png", overwrite=True) as unfinished:
        figure(unfinished, result.frame, result.tracks, polygons, result.features, mm_per_px=scale)
    if result.features.surface is not None:
        with writing(out / f"{received.name}_surface.png", overwrite=True) as unfinished:
            surface_figure(unfinished, result.features, mm_per_px=scale)
