"""Recordings are read back exactly, and damage loses only the damaged chunk."""

import threading
from contextlib import suppress
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, Message
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap_protobuf.decoder import DecoderFactory
from mcap_protobuf.writer import Writer

from edge.errors import SinkError, SourceError
from edge.recording import messages
from edge.recording.mcap_file import read_metadata
from edge.recording.reader import RecordingSource
from edge.recording.topics import TOPICS, proto
from edge.recording.writer import Recorder
from edge.types import Cells, Clock, Features, Frame, Reading, Result, Tracks
from hostlink.topics import status_text
from hostlink.wire import State, Status
from tests.support.fields import contact_region
from tests.support.layouts import tracks_of
from tests.support.messages import read_messages
from tests.support.refusals import one_line
from tests.support.waiting import present, until

STEP_NS = 4_166_667


def frames_of(n: int, *, bits: int = 8, size: tuple[int, int] = (64, 48)) -> list[Frame]:
    """Noise images with gaps in the sequence and uneven times."""
    rng = np.random.default_rng(7)
    return [
        Frame(
            image=rng.integers(0, 1 << bits, (size[1], size[0]), np.uint8 if bits == 8 else np.uint16),
            capture_ns=123_456_789_012_345 + i * STEP_NS + i % 3,
            sequence=(1 << 33) + i + (5 if i >= 4 else 0),  # more than MCAP's own counter holds, and a gap
            clock=Clock.DEVICE,
            bits=bits,
            truth={"depth_mm": 0.1 * i, "contacts": [[1.5, -2.25]]} if i % 2 else None,
        )
        for i in range(n)
    ]


def write(path: Path, frames: list[Frame], **options: Any) -> Recorder:
    with Recorder(path, **options) as recorder:
        for frame in frames:
            assert recorder.frame(frame)
    return recorder


def assert_same(got: list[Frame], want: list[Frame]) -> None:
    for name in ("sequence", "capture_ns", "truth", "bits"):
        assert [getattr(f, name) for f in got] == [getattr(f, name) for f in want]
    for a, b in zip(got, want, strict=True):
        assert a.image.dtype == b.image.dtype
        assert np.array_equal(a.image, b.image)


@pytest.mark.parametrize("bits", [8, 10, 12, 16])
@pytest.mark.parametrize(
    ("image", "compression"), [("raw", "none"), ("raw", "lz4"), ("raw", "zstd"), ("png", "none")]
)
def test_round_trip_is_exact(tmp_path: Path, image: Any, compression: Any, bits: int) -> None:
    want = frames_of(9, bits=bits)
    recorder = write(tmp_path / "a.mcap", want, image=image, compression=compression)
    assert recorder.fault is None
    assert recorder.dropped_n == recorder.refused_n == 0
    source = RecordingSource(tmp_path / "a.mcap")
    assert source.size_px == (64, 48)
    assert not source.live
    assert next(m["clock"] for t, _, m in read_messages(source.path) if t == "/camera/frame") == "device"
    assert source.rate_hz == pytest.approx(1e9 / STEP_NS, rel=1e-3)
    got = list(source)
    assert_same(got, want)
    assert {f.clock for f in got} == {Clock.RECORDED}
    assert not source.faults
    assert_same(list(source), want)  # again from the start


def test_same_frames_make_the_same_file_where_the_offset_is_given(tmp_path: Path) -> None:
    frames = frames_of(5)
    for name in ("a", "b"):
        write(tmp_path / name, frames, offset_ns=0, image="png", compression="zstd")
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    write(tmp_path / "c", frames)  # log times keep the intervals, whatever the offset
    times = [ns for topic, ns, _ in read_messages(tmp_path / "c") if topic == TOPICS["image"].name]
    assert np.array_equal(np.diff(times), np.diff([f.capture_ns for f in frames]))


N = 7


def results() -> tuple[Tracks, Cells, Features, Reading]:
    rng = np.random.default_rng(3)
    xy = rng.uniform(0, 60, (N, 2))
    gone = np.where(np.arange(N) == 2, np.nan, 0.0)
    tracks = tracks_of(xy + gone[:, None])
    area = rng.uniform(200, 300, N) + gone
    cells = Cells(area, np.full(N, 250.0), xy, np.zeros((1, 3), np.int32), np.zeros((4, 2)))
    contact = contact_region((30.0, 20.0), 0.4, 120.0)
    features = Features(
        area_change=area / 250 - 1,
        displacement_px=rng.normal(0, 1, (N, 2)),
        in_contact=True,
        shear_px=np.array([1.25, -0.5]),
        volume_px2=12.5,
        contacts=(contact,),
    )
    reading = Reading(
        {"displacement_mm": 1.5, "shear_x_mm": float("nan")},
        {"displacement_mm": 0.01},
        np.array([[0.5, -0.25, 1.5]]),
        calibrated=True,
    )
    return tracks, cells, features, reading


def cloud_to_array(cloud: Any) -> np.ndarray[Any, Any]:
    """Structured array of a decoded foxglove.PointCloud: one row a pin, one field a column."""
    kinds = {1: "u1", 6: "<i4", 7: "<f4", 8: "<f8"}
    named: Any = {
        "names": [f.name for f in cloud.fields], "formats": [kinds[f.type] for f in cloud.fields],
        "offsets": [f.offset for f in cloud.fields], "itemsize": cloud.point_stride,
    }  # fmt: skip
    return np.frombuffer(cloud.data, np.dtype(named))


def decode_by_the_library(path: Path) -> None:
    """The mcap library's reader checks the CRCs, and decodes every message by the schemas in the file."""
    factory = DecoderFactory()
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            if channel.message_encoding == "protobuf":
                present(factory.decoder_for("protobuf", schema))(message.data)


def test_results_read_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tracks, cells, features, reading = results()
    (frame,) = frames_of(1)
    path = tmp_path / "a.mcap"
    square, none = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0]]), np.full((3, 2), np.nan)
    monkeypatch.setattr(messages, "cell_polygons", lambda cells: [none, square])
    monkeypatch.setattr(messages, "cell_rgba", lambda change: np.full((2, 4), [1.0, 0.0, 0.0, 0.5]))
    with Recorder(path, tip={"serial": "T-1"}, rate_hz=240) as recorder:
        recorder.finger = 2
        warm = State(sample=7, status=Status.OVER_TEMPERATURE, displacement_mm=1.5, force_n=float("nan"))
        recorder.take(frame, Result(frame, tracks, cells, features, reading, searched=False), warm)
        recorder.event("warning", "pins lost: 1")
        recorder.attach("calibration.json", b'{"version": 1}')
        recorder.metadata("run", {"operator": "nobody"})
    assert recorder.refused_n == 0
    got = {topic: message for topic, _, message in read_messages(path)}
    finger = {"/finger_2/sample", "/finger_2/contacts"}
    assert set(got) == {t.name for t in TOPICS.values()} - {TOPICS["truth"].name} | finger

    pins = cloud_to_array(got["/pins"])
    assert np.array_equal(pins["x"], tracks.xy_img[:, 0], equal_nan=True)
    assert np.array_equal(pins["y"], tracks.xy_img[:, 1], equal_nan=True)
    assert np.array_equal(pins["seen"].astype(bool), tracks.seen)
    assert np.array_equal(pins["dx_px"], features.displacement_px[:, 0])
    assert np.array_equal(pins["area_change"], features.area_change, equal_nan=True)
    area = cloud_to_array(got["/cells"])
    assert np.array_equal(area["area_px2"], cells.area_px2, equal_nan=True)
    assert np.array_equal(area["x"], cells.xy_img[:, 0])

    dots = got["/pins/overlay"].points[0]
    assert len(dots.points) == N - 1  # the lost pin is not drawn
    assert dots.points[0].x == tracks.xy_img[0, 0] + 0.5  # Foxglove counts from the pixel's corner
    (loop,) = got["/cells/overlay"].points  # a polygon that is none is left out
    assert loop.type == loop.LINE_LOOP
    assert loop.fill_color.r == 1.0

    assert got["/features"]["shear_x_px"] == 1.25
    assert got["/features"]["torsion_rad"] is None
    assert got["/features"]["contacts"][0]["x_px"] == 30.0
    assert got["/features"]["contacts"][0]["orientation_rad"] is None  # NaN: round
    assert got["/reading"]["values"] == {"displacement_mm": 1.5, "shear_x_mm": None}
    assert got["/reading"]["contacts"] == [{"x_mm": 0.5, "y_mm": -0.25, "depth_mm": 1.5}]
    (status,) = got["/diagnostics"]["status"]
    assert (status["name"], status["level"], status["message"]) == ("finger_2", 1, status_text(warm.status))
    assert got["/tf"].transforms[0].child_frame_id == "finger_2"
    assert got["/events"].message == "pins lost: 1"
    assert got["/events"].level == 3
    with path.open("rb") as file:
        assert [a.data for a in make_reader(file).iter_attachments()] == [b'{"version": 1}']
    assert read_metadata(path)["run"] == {"operator": "nobody"}
    assert read_metadata(path)["voronoi_touch"]["serial"] == "T-1"
    assert RecordingSource(path).rate_hz == 240
    decode_by_the_library(path)


def test_a_truth_that_cannot_be_written_is_counted_and_named(tmp_path: Path) -> None:
    known = {"pins": np.array([[1.5, 2.5]]), "depth_mm": np.float64(0.25), "force_n": float("nan")}
    frames = [
        Frame(np.zeros((4, 4), np.uint8), n, n, truth=truth)
        for n, truth in enumerate((known, {"rig": object()}))
    ]
    recorder = write(tmp_path / "a.mcap", frames)
    assert recorder.refused_n == 1
    (event,) = [m for topic, _, m in read_messages(tmp_path / "a.mcap") if topic == "/events"]
    assert "/camera/truth" in event.message
    first, second = RecordingSource(tmp_path / "a.mcap")
    assert first.truth == {"pins": [[1.5, 2.5]], "depth_mm": 0.25, "force_n": None}
    assert second.truth is None


#: A recording's file, its frames, where its chunks end, and how many images each has.
Long = tuple[Path, list[Frame], list[int], list[int]]


def chunks_of(path: Path) -> tuple[list[int], list[int]]:
    """Where each chunk ends, and how many images it has, by the library's reader."""
    ends, counts, images = list[int](), list[int](), set[int]()
    with path.open("rb") as file:
        for record in StreamReader(file, emit_chunks=True).records:
            if isinstance(record, Chunk):
                parts = breakup_chunk(record)
                images |= {p.id for p in parts if isinstance(p, Channel) and p.topic == "/camera/image"}
                ends.append(file.tell())
                counts.append(sum(isinstance(p, Message) and p.channel_id in images for p in parts))
    return ends, counts


@pytest.fixture
def long_recording(tmp_path: Path) -> Long:
    """Several chunks."""
    path, frames = tmp_path / "long.mcap", frames_of(30, size=(640, 480))
    write(path, frames)
    ends, counts = chunks_of(path)
    assert len(ends) >= 5
    return path, frames, ends, counts


@pytest.mark.parametrize("cut", ["just after chunk 3", "in chunk 4", "in the index"])
def test_truncated_file_yields_all_complete_chunks(long_recording: Long, cut: str) -> None:
    path, frames, ends, counts = long_recording
    data = path.read_bytes()
    where, complete = {
        "just after chunk 3": (ends[2], 3),
        "in chunk 4": (ends[3] - 1000, 3),
        "in the index": (len(data) - 20, len(ends)),
    }[cut]
    path.write_bytes(data[:where])
    source = RecordingSource(path)
    got = list(source)
    expected = sum(counts[:complete])
    assert len(got) == expected > 0
    assert_same(got, frames[:expected])
    assert source.faults["truncated"]


def test_damage_to_one_chunk_loses_that_chunk_only(long_recording: Long) -> None:
    path, frames, ends, counts = long_recording
    data = bytearray(path.read_bytes())
    data[ends[2] - 5000] ^= 0xFF
    path.write_bytes(data)
    source = RecordingSource(path)
    got = list(source)
    before = sum(counts[:2])
    assert_same(got, frames[:before] + frames[before + counts[2] :])
    assert source.faults["damaged chunk"] == 1


def test_an_idle_recording_is_on_disk_without_being_closed(tmp_path: Path) -> None:
    """Few small messages reach the file by age, not only by size."""
    path, copy = tmp_path / "idle.mcap", tmp_path / "copy.mcap"
    with Recorder(path) as recorder:
        recorder.frame(frames_of(1)[0])

        def reads_back() -> bool:
            copy.write_bytes(path.read_bytes())
            with suppress(SourceError):
                return len(list(RecordingSource(copy))) == 1
            return False

        until(reads_back, "the frame is on disk")


def test_a_slow_disk_drops_messages_and_reports_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The queue is bounded; the call returns; the file has a warning for the gap."""
    path = tmp_path / "slow.mcap"
    recorder = Recorder(path, buffer_mb=1.0)
    gate = threading.Event()
    add = recorder._writer.add

    def slow(*arguments: Any) -> None:
        gate.wait()
        add(*arguments)

    monkeypatch.setattr(recorder._writer, "add", slow)
    frames = frames_of(20, size=(640, 480))
    taken = [recorder.frame(frame) for frame in frames]
    assert recorder.dropped_n > 0
    assert taken[0]
    assert not taken[-1]
    gate.set()
    recorder.close()
    got = list(RecordingSource(path))
    assert [f.sequence for f in got] == [f.sequence for f, ok in zip(frames, taken, strict=True) if ok]
    texts = [m.message for topic, _, m in read_messages(path) if topic == "/events"]
    assert any("the disk is too slow" in text for text in texts)


def test_a_disk_that_fills_up_while_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recorder = Recorder(tmp_path / "full.mcap", buffer_mb=100)
    write_to_disk, left = recorder._writer._file.write, 400_000

    def write(data: bytes) -> int:
        """A file that holds one chunk."""
        nonlocal left
        left -= len(data)
        if left < 0:
            raise OSError(28, "No space left on device")
        return int(write_to_disk(data))

    full = Mock(wraps=recorder._writer._file, write=write)
    monkeypatch.setattr(recorder._writer._writer, "_Writer__stream", full)
    for frame in frames_of(30, size=(640, 480)):
        recorder.frame(frame)
    recorder.close()
    assert "No space left" in present(recorder.fault)
    assert not recorder.frame(frames_of(1)[0])
    assert recorder.dropped_n > 0


def test_a_recording_is_never_overwritten_unasked(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    write(path, frames_of(1))
    for where, options, stated in (
        (path, {}, "a.mcap exists"),
        (tmp_path / "no such folder" / "a.mcap", {}, "cannot write"),
        (Path("/dev/full"), {"overwrite": True}, "/dev/full: No space left"),  # full from the start
    ):
        assert stated in one_line(SinkError, Recorder, where, **options)
    write(path, frames_of(2), overwrite=True)
    assert len(list(RecordingSource(path))) == 2
    assert "/other" in one_line(SourceError, RecordingSource, path, topic="/other")


def test_a_camera_whose_clock_begins_anew_leaves_times_that_grow(tmp_path: Path) -> None:
    frames = [Frame(np.full((4, 4), n, np.uint8), ns, n) for n, ns in enumerate((7000, 9000, 1000, 3000))]
    for options in ({}, {"offset_ns": 0}):
        write(tmp_path / "a.mcap", frames, overwrite=True, rate_hz=1e5, **options)
        log_ns = [ns for topic, ns, _ in read_messages(tmp_path / "a.mcap") if topic == TOPICS["image"].name]
        assert all(step_ns > 0 for step_ns in np.diff(log_ns))
        got = list(RecordingSource(tmp_path / "a.mcap"))
        assert [f.sequence for f in got] == [0, 1, 2, 3]
        assert [f.capture_ns for f in got] == [7000, 9000, 14000, 16000]


@pytest.mark.parametrize("chunk_size", [1, 1 << 20])
@pytest.mark.parametrize("indexed", [True, False])
def test_messages_out_of_order_are_played_by_time(tmp_path: Path, chunk_size: int, indexed: bool) -> None:
    path, log_ns = tmp_path / "a.mcap", [4000, 1000, 3000, 2000, 5000]
    with path.open("wb") as file, Writer(file, chunk_size=chunk_size) as writer:
        for ns in log_ns:
            data = bytes([ns // 1000, 9])
            image = proto("RawImage")(width=2, height=1, step=2, encoding="mono8", data=data)
            writer.write_message("/image", image, log_time=ns, publish_time=ns)
    if not indexed:
        path.write_bytes(path.read_bytes()[:-40])
    frames = list(RecordingSource(path))
    assert [(f.capture_ns, f.image[0, 0]) for f in frames] == [(1000 * n, n) for n in range(1, 6)]
    assert [f.sequence for f in frames] == [0, 1, 2, 3, 4]  # a running number
