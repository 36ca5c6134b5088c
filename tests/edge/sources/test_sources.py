"""Sources: specifications, errors of bad ones, and the timing of a replay."""

import re
import threading
from collections.abc import Iterator
from contextlib import closing
from importlib.metadata import EntryPoint
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import cv2
import numpy as np
import pytest

from edge import sources
from edge.errors import SourceError
from edge.params import PARAMS as RUNTIME
from edge.recording.reader import RecordingSource
from edge.recording.writer import Recorder
from edge.sources import open_source
from edge.sources.files import FolderSource, VideoSource, growing, read_image
from edge.sources.live import ThreadedSource, Watch
from edge.sources.options import Options, parse_spec
from edge.sources.paced import Paced
from edge.types import Clock, Frame, FrameSource, Polarity
from tests.support.refusals import one_line
from tests.support.waiting import SOON_S, present


def noise(seed: int = 0, size: tuple[int, int] = (64, 48)) -> np.ndarray[Any, Any]:
    return np.random.default_rng(seed).integers(0, 256, (size[1], size[0]), dtype=np.uint8)


def folder_of(path: Path, n: int) -> Path:
    path.mkdir()
    for i in range(n):
        cv2.imwrite(str(path / f"frame_{i}.png"), noise(i))
    return path


def video_of(path: Path, *images: np.ndarray[Any, Any], codec: str = "FFV1") -> Path:
    colour = [cv2.VIDEOWRITER_PROP_IS_COLOR, int(images[0].ndim == 3)]
    fourcc, size = cv2.VideoWriter.fourcc(*codec), images[0].shape[1::-1]
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, fourcc, 50.0, size, colour)
    assert writer.isOpened()
    for image in images:
        writer.write(image)
    writer.release()
    return path


def noises(n: int, size: tuple[int, int] = (64, 48)) -> list[np.ndarray[Any, Any]]:
    """Grey, in three channels."""
    return [cv2.merge([noise(i, size)] * 3) for i in range(n)]


@pytest.mark.parametrize(
    ("text", "scheme", "where", "exposure_us", "extra"),
    [
        ("v4l2:0", "v4l2", "0", 0, {}),
        ("v4l2:0?exposure_us=2000", "v4l2", "0", 2000, {}),
        ("v4l2:/dev/v4l/by-id/usb-a:b?exposure_us=5", "v4l2", "/dev/v4l/by-id/usb-a:b", 5, {}),
        ("oak:", "oak", "", 0, {}),
        ("sim:tip127?seed=3", "sim", "tip127", 0, {"seed": "3"}),
        ("plain/path.avi", "", "plain/path.avi", 0, {}),
        ("plain/path.avi?exposure_us=5", "", "plain/path.avi", 5, {}),
        ("/dev/video0", "", "/dev/video0", 0, {}),
    ],
)
def test_specifications(text: str, scheme: str, where: str, exposure_us: int, extra: dict[str, str]) -> None:
    spec = parse_spec(text, Options())
    assert (spec.scheme, spec.where) == (scheme, where)
    assert (spec.options.exposure_us, spec.options.extra) == (exposure_us, extra)


def test_a_plain_path_takes_options_and_may_have_a_question_mark(data_dir: Path, tmp_path: Path) -> None:
    odd = tmp_path / "is it?pins=dark.mcap"
    odd.symlink_to(data_dir / "nothing.mcap")
    with_options = f"{data_dir}/nothing.mcap?pins=bright"
    for spec, polarity in ((str(odd), Polarity.FOUND), (with_options, Polarity.BRIGHT)):
        with closing(open_source(spec)) as source:
            assert source.polarity is polarity


def test_keys_win_over_settings() -> None:
    spec = parse_spec("v4l2:0?rate_hz=120&check_rate=no", Options(rate_hz=30.0, gain=7))
    assert (spec.options.rate_hz, spec.options.check_rate, spec.options.gain) == (120.0, False, 7)


@pytest.mark.parametrize(
    ("spec", "stated"),
    [
        ("nowhere.mcap", "no such file"),
        ("", "no such file"),
        ("a\0b", "no such file"),
        ("ftp:somewhere", r"no scheme 'ftp'; known: example:, images:, mcap:.* oak:.* v4l2:.* video:"),
        ("v4l2:99", "no such camera; give v4l2:NUMBER, v4l2:SERIAL, v4l2:NAME or .*; cameras here"),
        ("/dev/video99", "no such camera"),
        ("v4l2:0?exposure_us=long", "us: must be a whole number from 0 to 2147483647, is .long"),
        ("sim:press?rate_hz=nan", "rate_hz: must be a number from 0 to 1000000, is .nan"),
        ("v4l2:0?width=-1", "width: must be a whole number from 0 to 8192, is .-1"),
        ("v4l2:0?pins=white", "pins: unknown value .*white.*; known: bright, dark"),
        ("v4l2:0?exposre_us=3", "unknown key 'exposre_us'|no such camera"),
        ("video:nowhere.avi", "no such file"),
    ],
)  # fmt: skip
def test_bad_specifications_are_one_line(spec: str, stated: str) -> None:
    assert re.search(stated, one_line(SourceError, open_source, spec))


def test_plain_paths(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    folder_of(tmp_path / "f", 2)
    video_of(tmp_path / "a.mkv", *noises(3))
    (tmp_path / "run:2.avi").symlink_to(video_of(tmp_path / "a.avi", *noises(3)))  # a colon, and no scheme
    with Recorder(tmp_path / "a.mcap") as recorder:
        recorder.frame(Frame(noise(), 0, 0))
    for spec, kind in {
        "f": FolderSource,
        "f/frame_0.png": FolderSource,
        "a.mkv": VideoSource,
        "run:2.avi": VideoSource,
        "a.mcap": RecordingSource,
        "mcap:a.mcap?topic=/camera/image": RecordingSource,
    }.items():
        assert isinstance(open_source(spec), kind)
    with pytest.raises(SourceError, match="unknown key 'tpic'"):
        open_source("mcap:a.mcap?tpic=x")


def test_an_entry_point_opens_its_scheme(monkeypatch: pytest.MonkeyPatch) -> None:
    points = [
        EntryPoint("mine", "tests.edge.sources.test_sources:open_mine", "voronoi_touch.sources"),
        EntryPoint("torn", "no_such_package_here:open", "voronoi_touch.sources"),
    ]
    monkeypatch.setattr(
        sources, "_from_packages", lambda name=None: [p for p in points if name in (None, p.name)]
    )
    assert open_source("mine:x?seed=4", rate_hz=7.0).name == "mine x 4 7.0"
    for spec, stated in (("torn:", "no_such_package_here"), ("sim:", r"voronoi-touch\[calib\]")):
        with pytest.raises(SourceError, match=stated):
            open_source(spec)


def open_mine(where: str, options: Options) -> Any:
    return SimpleNamespace(name=f"mine {where} {options.extra['seed']} {options.rate_hz}")


def test_a_folder_and_a_lossless_video_are_exact(tmp_path: Path) -> None:
    folder = FolderSource(folder_of(tmp_path / "f", 12), rate_hz=50.0)
    (tmp_path / "f" / "notes.txt").write_text("not an image, and not named like one")
    assert [p.name for p in folder.paths] == [f"frame_{i}.png" for i in range(12)]  # in natural order
    video = VideoSource(video_of(tmp_path / "a.mkv", *noises(12)))
    for source, late_ns in ((folder, 0), (video, 1e6)):
        frames = list(source)
        assert (source.size_px, source.rate_hz) == ((64, 48), 50.0)
        for i, frame in enumerate(frames):
            assert np.array_equal(frame.image, noise(i))
        assert np.allclose([f.capture_ns for f in frames], 20e6 * np.arange(12), rtol=0, atol=late_ns)
        assert [f.sequence for f in frames] == list(range(12))
        assert {frame.clock for frame in frames} == {Clock.RECORDED}
        assert len(list(source)) == 12
    assert not video.faults["truncated"]


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.png", b"\x89PNG\r\n\x1a\n broken"),
        ("text.png", b"hello"),
        ("empty.png", b""),
        ("a.png", b"GIF89a" + bytes(20)),
        ("a.png", b"v/1\x01" + bytes(20)),  # OpenEXR's
        ("a.avi", b""),
        ("a.avi", b"text, not a video"),
        ("a.avi", b"RIFF\x00\x00\x00\x00AVI LIST"),
    ],
)
def test_files_that_are_not_images_or_videos_are_refused(
    tmp_path: Path, name: str, content: bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / name).write_bytes(content)
    message = one_line(SourceError, open_source, str(tmp_path / name))
    assert re.search(r"not an image|damaged|not a video|no frame", message)
    assert name in message
    assert capfd.readouterr().err == ""  # OpenCV's own messages are suppressed


def test_missing_and_odd_images_of_a_folder_are_named(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="no such file"):
        read_image(tmp_path / "b.png")
    with pytest.raises(SourceError, match="no images in it"):
        open_source(str(tmp_path))
    folder = folder_of(tmp_path / "f", 4)
    (folder / "frame_2.png").write_bytes(b"gone")  # a damaged one in the middle is counted
    source = FolderSource(folder)
    assert [f.sequence for f in source] == [0, 1, 3]
    assert source.faults["damaged frame"] == 1
    cv2.imwrite(str(folder / "frame_1.png"), noise(0, (32, 32)))
    with pytest.raises(SourceError, match=r"frame_1\.png is 32x32, the first one 64x48"):
        list(FolderSource(folder))


def timed_video(path: Path, times_10ms: list[int]) -> Path:
    """A Matroska file whose header states 100 images a second, with these times."""
    raw = [cv2.VIDEOWRITER_PROP_RAW_VIDEO, 1]
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"MJPG"), 100.0, (64, 48), raw)
    for i, at in enumerate(times_10ms):
        writer.set(cv2.VIDEOWRITER_PROP_PTS, at)
        writer.write(cv2.imencode(".jpg", noise(i))[1].reshape(1, -1))
    writer.release()
    return path


@pytest.mark.parametrize(
    ("times_10ms", "rate_hz"),
    [
        pytest.param([5 * i for i in range(30)], 20.0, id="at another rate than stated"),
        pytest.param([i + 9 * (i // 7) for i in range(30)], 100.0, id="variable rate"),
        pytest.param([i + 900 for i in range(30)], 100.0, id="later start"),
    ],
)
def test_a_whole_video_has_its_own_times(tmp_path: Path, times_10ms: list[int], rate_hz: float) -> None:
    """Though its header's count of images is an estimate from its length."""
    source = VideoSource(timed_video(tmp_path / "a.mkv", times_10ms))
    frames = list(source)
    assert [f.capture_ns for f in frames] == [(at - times_10ms[0]) * 10_000_000 for at in times_10ms]
    assert source.frames_n > len(frames) == len(times_10ms)
    assert not source.faults
    assert source.rate_hz == pytest.approx(rate_hz)


@pytest.mark.parametrize(
    ("own_ms", "times_ms"),
    [
        pytest.param([0, 10, 20, 20, 40], [0, 10, 20, 25, 40], id="repeated"),
        pytest.param([0, 10, 20, 20, 20, 50], [0, 10, 20, 25, 30, 50], id="repeated twice"),
        pytest.param([0, 10, 30, 20, 40, 50], [0, 10, 30, 35, 40, 50], id="two exchanged"),
        pytest.param([500, 510, 0, 10, 30], [500, 510, 515, 525, 545], id="a clock that was set back"),
        pytest.param([0, 10, 20, 0], [0, 10, 20, 25], id="none at the end"),
    ],
)
def test_times_that_do_not_grow_are_repaired_locally(own_ms: list[int], times_ms: list[int]) -> None:
    frames = [Frame(noise(), at * 1_000_000, n) for n, at in enumerate(own_ms)]
    assert [f.capture_ns for f in growing(frames, 100.0)] == [at * 1_000_000 for at in times_ms]


@pytest.mark.parametrize("name", ["a.avi", "a.mkv"])
def test_truncated_video_plays_as_far_as_it_goes(tmp_path: Path, name: str) -> None:
    path = video_of(tmp_path / name, *noises(40, (320, 240)), codec="MJPG")
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 6 // 10])
    source = VideoSource(path)
    frames = list(source)
    assert 20 <= len(frames) < 30
    assert source.faults == {"truncated": 1}


@pytest.mark.real
@pytest.mark.parametrize(
    ("name", "n", "rate_hz"),
    [("Movement4", 635, 20), ("north", 541, 120), ("west", 400, 120), ("flatSkin", 188, 60)],
)
def test_published_videos_play_to_their_end(real_dir: Path, name: str, n: int, rate_hz: int) -> None:
    source = open_source(str(real_dir / "video" / f"{name}.avi"))
    frames = [(frame.sequence, frame.image.shape) for frame in source]
    assert frames == [(k, (480, 640)) for k in range(n)]
    assert source.rate_hz == rate_hz
    assert isinstance(source, VideoSource)
    assert not source.faults


class Scripted(ThreadedSource):
    """Gives frames when the test asks for them."""

    def __init__(self) -> None:
        super().__init__("scripted")
        self.n, self.size_px = 0, (4, 4)

    def _work(self) -> None:
        self._closing.wait()

    def give(self, n: int) -> None:
        for _ in range(n):
            self._offer(Frame(np.full((4, 4), 200, np.uint8), self.n, self.n))
            self.n += 1


@pytest.fixture
def scripted() -> Iterator[Scripted]:
    with closing(Scripted()) as source:
        source.start()
        yield source


def test_a_slow_reader_gets_the_newest_frame_and_a_count(scripted: Scripted) -> None:
    for n, newest in ((1, 0), (5, 5)):
        scripted.give(n)
        assert present(scripted.read(SOON_S)).sequence == newest
    assert (scripted.dropped_n, scripted.received_n) == (4, 6)
    assert scripted.read(0.0) is None
    scripted.close()
    assert scripted.read(SOON_S) is None
    assert list(scripted) == []


def test_closing_wakes_a_waiting_reader(scripted: Scripted) -> None:
    got: list[Any] = []
    reader = threading.Thread(target=lambda: got.append(list(scripted)))
    reader.start()
    scripted.close()
    reader.join(SOON_S)
    assert got == [[]]


def test_an_error_in_the_thread_reaches_the_reader() -> None:
    class Broken(ThreadedSource):
        def _work(self) -> None:
            raise SourceError("camera: broken")

    source = Broken("broken")
    source.start()
    with pytest.raises(SourceError, match="broken"):
        source.read(SOON_S)
    assert source.read(0) is None


def test_a_stall_is_reported_while_it_lasts(scripted: Scripted) -> None:
    scripted.give(1)
    scripted._last_s -= 1.0
    assert scripted.condition == "stalled"
    scripted.give(1)
    scripted.rate_hz = 0.01  # patience of a slow camera
    assert scripted.condition == ""


def test_watch_sees_frozen_and_black() -> None:
    watch = Watch()
    for i in range(5):
        assert watch.check(Frame(noise(i), i, i)) == ""
    step_ns = round(RUNTIME.stall_s * 1e9 / 4)
    still = [watch.check(Frame(noise(9), step_ns * i, i)) for i in range(5)]
    assert still == ["", "", "", "", "frozen"]
    for i in range(3):  # however slow the camera: two repetitions
        assert watch.check(Frame(noise(8), 10 * step_ns * i, i)) == ("frozen" if i == 2 else "")
    assert watch.check(Frame(noise(10), 0, 0)) == ""
    assert watch.check(Frame(noise(1) // 64, 0, 0)) == "black"
    deep = noise(2).astype(np.uint16)  # up to 255 of 4095: one sixteenth
    assert watch.check(Frame(deep, 0, 0, bits=12)) == ""
    assert watch.check(Frame(deep // 4, 0, 0, bits=12)) == "black"


class Listed(FrameSource):
    """A recording of given times."""

    name, size_px, live = "listed", (4, 4), False

    def __init__(self, times_ns: list[int], rate_hz: float) -> None:
        self.times_ns, self.rate_hz, self.closed = times_ns, rate_hz, False

    def __iter__(self) -> Any:
        for i, t in enumerate(self.times_ns):
            yield Frame(np.full((4, 4), i % 256, np.uint8), t, 10 * i, Clock.RECORDED, truth={"i": i})

    def close(self) -> None:
        self.closed = True


def replayed(times_ns: list[int], recorded_hz: float, **options: Any) -> tuple[list[Frame], Paced, int]:
    """The frames of a recording of these times, and when it ends; of one that is played in a loop, eight.

    Only waiting advances the clock, so that the timing can be tested exactly.
    """
    now_ns, frames = 1_000, list[Frame]()

    def wait(timeout: float) -> None:
        nonlocal now_ns
        now_ns += round(timeout * 1e9) + 300_000  # wakes 0.3 ms late, like a kernel

    def offer(frame: Frame) -> None:
        frames.append(frame)
        if options.get("loop") and len(frames) == 8:
            paced._closing.set()

    paced = Paced(Listed(times_ns, recorded_hz), clock_ns=lambda: now_ns, **options)
    with patch.object(paced._closing, "wait", wait), patch.object(paced, "_offer", offer):
        paced._work()
    return frames, paced, now_ns


def test_replay_keeps_the_recordings_times_without_drift() -> None:
    times = [7_000_000_000 + i * 8_333_333 for i in range(500)]
    times[100:] = [t + 50_000_000 for t in times[100:]]  # a gap
    frames, paced, ended_ns = replayed(times, 120.0)
    start = frames[0].capture_ns
    assert [f.capture_ns - start for f in frames] == [t - times[0] for t in times]
    assert ended_ns - frames[-1].capture_ns <= 300_000  # late wake-ups did not add up
    assert [f.sequence for f in frames] == [10 * i for i in range(500)]
    assert frames[3].truth == {"i": 3}
    assert {f.clock for f in frames} == {Clock.HOST}
    assert paced.live


@pytest.mark.parametrize(
    ("times_ns", "rate_hz", "options", "steps_ns", "paced_hz"),
    [
        pytest.param([0, 10_000_000, 50_000_000], 100.0, {"speed": 2.0}, [5_000_000, 20_000_000], 200.0,
                     id="twice the speed keeps the gaps"),
        pytest.param([9, 9, 9], 100.0, {}, [10_000_000] * 2, 100.0, id="a clock that stands still"),
        pytest.param([0, 1_000_000, 2_000_000], 1000.0, {"loop": True}, [1_000_000] * 7, 1000.0, id="loop"),
    ],
)  # fmt: skip
def test_the_pace_of_a_replay(
    times_ns: list[int], rate_hz: float, options: dict[str, Any], steps_ns: list[int], paced_hz: float
) -> None:
    frames, paced, _ = replayed(times_ns, rate_hz, **options)
    assert np.diff([f.capture_ns for f in frames]).tolist() == steps_ns
    assert paced.rate_hz == paced_hz
    counted = [0, 10, 20, 21, 31, 41, 42, 52] if "loop" in options else [0, 10, 20, 30]  # a loop counts on
    assert [f.sequence for f in frames] == counted[: len(frames)]


def test_a_replay_waits_for_the_reader_of_the_rest_frame() -> None:
    """Time begins when the first images have been read, however long that takes."""
    paced = Paced(Listed([i * 1_000 for i in range(12)], 1e6), rest_n=8)
    paced.start()
    frames: list[Frame] = []
    for n in range(8):
        with paced._changed:
            assert paced._changed.wait_for(lambda: paced.received_n > len(frames), SOON_S)
        assert n == 7 or paced.received_n == n + 1
        frames.append(present(paced.read(SOON_S)))
    paced.close()
    assert [f.sequence for f in frames[:7]] == [10 * i for i in range(7)]
    assert all(step_ns >= 1_000 for step_ns in np.diff([f.capture_ns for f in frames]))


@pytest.mark.parametrize(("times_ns", "rest_n"), [([0, 1, 2], 3), ([0, 3_600_000_000_000], 0)])
def test_closing_ends_a_replay_at_once(times_ns: list[int], rest_n: int) -> None:
    """It waits for its reader, or for an hour."""
    paced = Paced(Listed(times_ns, 1000.0), rest_n=rest_n)
    paced.start()
    present(paced.read(SOON_S))
    paced.close()  # joins the thread
    assert not paced._thread.is_alive()
    assert paced.source.closed  # type: ignore[attr-defined]


def test_a_replay_delivers_its_last_frame_and_ends() -> None:
    paced = Paced(Listed([0, 1, 2], 1000.0), speed=0.2)
    sequences = [f.sequence for f in paced]
    assert sequences[-1] == 20
    assert paced.dropped_n + len(sequences) == 3
    assert paced.ended
