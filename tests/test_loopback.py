"""Recorded frames through the whole chain and back: the host decodes what the edge computed."""

import math
from pathlib import Path
from threading import Event
from uuid import uuid4

import pytest
from rich.console import Console

import hostlink
from calib.demo import RECORDINGS, demo, on_wire, play
from edge.calibration import Calibration
from edge.link.node import Node
from edge.link.sinks import CanSink, MemorySink, SerialSink, open_sink
from edge.runtime.device import LoopDevice
from edge.runtime.loop import Loop
from edge.sources import open_source
from hostlink.decoder import Sample as Decoded
from hostlink.output_file import OutputError
from hostlink.recording import LogWriter, decode_recording
from hostlink.wire import State
from tests.support.states import same
from tests.support.waiting import SOON_S

NODE = 5


def test_the_demo_compares_and_draws_all_recordings(
    data_dir: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    demo(data_dir, tmp_path, Console(width=100))
    rows = {
        line.split()[0]: line.split()[1:4] for line in capsys.readouterr().out.splitlines() if line.split()
    }
    assert [rows[name][1:] for name in RECORDINGS] == [[n, "yes"] for n in ("331", "127", "331", "127")]
    pictures = {path.name for path in tmp_path.iterdir()}
    assert {f"{name}.png" for name in RECORDINGS} <= pictures
    assert "press_surface.png" in pictures


def test_the_demo_needs_a_folder(data_dir: Path, tmp_path: Path) -> None:
    (file := tmp_path / "file").touch()
    with pytest.raises(OutputError, match="file: is no folder; give the name of one to --out"):
        demo(data_dir, file, Console())


def send(
    recording: Path, calibration: Path, edge_address: str, host_address: str, log: Path | None = None
) -> tuple[dict[int, State], dict[int, State]]:
    """Computed and received states by sample number."""
    received: dict[int, State] = {}
    arrived = Event()
    source = open_source(str(recording))
    memory = MemorySink()
    expected_n = sum(1 for _ in source)
    with hostlink.connect(host_address) as host:

        def take(sample: hostlink.Sample) -> None:
            received[sample.state.sample] = sample.state
            if len(received) == expected_n:
                arrived.set()

        host.on_sample(take)
        writer = LogWriter(log) if log is not None else None
        if writer is not None:
            host.on_raw(lambda message, _: writer.write(message))
        loop = Loop(source, [memory], Calibration.load(calibration))
        sink = open_sink(edge_address, node=NODE)
        assert isinstance(sink, CanSink | SerialSink)
        loop.sinks.append(Node(sink, LoopDevice(loop, "T1")))
        loop.run()
        sink.drain(SOON_S)
        arrived.wait(SOON_S)
        sink.close()
    if writer is not None:
        writer.close()
    source.close()
    return {state.sample: state for state in memory.states}, received


def check(computed: dict[int, State], received: dict[int, State]) -> None:
    """Received equals computed within the wire's resolution, no sample lost or added."""
    assert computed.keys() == received.keys()
    for number, state in computed.items():
        assert same(received[number], on_wire(state)), number
    assert any(state.contact_n for state in computed.values())
    assert any(
        math.isfinite(state.displacement_mm) and state.displacement_mm > 1 for state in computed.values()
    )


@pytest.fixture
def pressed(data_dir: Path) -> tuple[Path, Path]:
    """A recording with all kinds of values, and its calibration."""
    return data_dir / "press_shear.mcap", data_dir / RECORDINGS["press_shear"]


@pytest.mark.parametrize("suffix", [".log", ".blf"])
@pytest.mark.parametrize("options", ["", "?fd=0"])
def test_a_log_written_and_read_back(
    pressed: tuple[Path, Path], tmp_path: Path, suffix: str, options: str
) -> None:
    bus, log = f"virtual:{uuid4()}{options}", tmp_path / f"touch{suffix}"
    computed, received = send(*pressed, bus, bus, log)
    check(computed, received)
    logged = {
        event.state.sample: event.state for event in decode_recording(log) if isinstance(event, Decoded)
    }
    check(computed, logged)


@pytest.mark.parametrize("name", RECORDINGS)
def test_every_bundled_recording_over_both_links(data_dir: Path, name: str) -> None:
    received = play(data_dir / f"{name}.mcap", Calibration.load(data_dir / RECORDINGS[name]))
    assert received.sent.keys() == received.can.keys() == received.serial.keys()
    for number, state in received.sent.items():
        assert same(received.can[number], on_wire(state))
        assert same(received.serial[number], on_wire(state))
    assert received.last.tracks.n_seen == len(received.last.tracks.seen)
