"""Sources: specifications, errors of bad ones, and the timing of a replay."""

from __future__ import annotations

import threading
from contextlib import closing
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from edge.errors import SourceError
from edge.recording.reader import RecordingSource
from edge.recording.writer import Recorder
from edge.sources import (
    FolderSource,
    Paced,
    ThreadedSource,
    VideoSource,
    known_schemes,
    open_source,
    read_image,
)
from edge.sources.live import PARAMS, Watch
from edge.sources.options import Options, parse_spec
from edge.types import Clock, Frame, Lens, Polarity
from tests.support.waiting import SOON_S


def noise(seed: int = 0, size: tuple[int, int] = (64, 48)) -> np.ndarray[Any, Any]:
    return np.random.default_rng(seed).integers(0, 256, (size[1], size[0]), dtype=np.uint8)


def folder_of(path: Path, n: int, names: str = "frame_{}.png") -> Path:
    path.mkdir()
    for i in range(n):
        cv2.imwrite(str(path / names.format(i)), noise(i))
    return path


def video_of(
    path: Path, n: int, rate_hz: float = 50.0, codec: str = "FFV1", size: tuple[int, int] = (64, 48)
) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*codec), rate_hz, size)
    assert writer.isOpened()
    for i in range(n):
        grey = noise(i, size)
        writer.write(cv2.merge([grey, grey, grey]))
    writer.release()
    return path


# -- specifications ------------------------------------------------------------------------------


def test_schemes_of_this_installation() -> None:
    assert {"images", "mcap", "oak", "v4l2", "video"} <= set(known_schemes())


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
    assert (spec.scheme, spec.where, spec.options.exposure_us, spec.options.extra) == (
        scheme,
        where,
        exposure_us,
        extra,
    )


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
        ("nowhere/", "no such file"),
        ("", "no such file"),
        ("a\0b", "no such file"),
        ("ftp:somewhere", "no scheme 'ftp'; known: images:, mcap:"),
        ("v4l2:99", "no such camera; give v4l2:NUMBER, v4l2:SERIAL or .*; cameras here"),
        ("/dev/video99", "no such camera"),
        ("v4l2:SERIAL-4711", "no such camera"),
        (
            "v4l2:0?exposure_us=long",
            "exposure_us=long: give a whole number from 0 to 1000000, e.g. exposure_us=1",
        ),
        ("sim:press?rate_hz=nan", "rate_hz=nan: give a number from 0 to 2000, e.g. rate_hz=1"),
        ("v4l2:0?width=-1", "width=-1: give a whole number from 0 to 8192, e.g. width=1"),
        ("v4l2:0?pins=white", "pins=white: give dark or bright, e.g. pins=dark"),
        ("v4l2:0?exposre_us=3", "unknown key 'exposre_us'|no such camera"),
        ("video:nowhere.avi", "no such file"),
        ("images:nowhere", "no such file"),
    ],
)
def test_bad_specifications_are_one_line(spec: str, stated: str) -> None:
    with pytest.raises(SourceError, match=stated) as caught:
        open_source(spec)
    assert "\n" not in str(caught.value)


def test_a_file_with_a_colon_in_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    video_of(tmp_path / "a.avi", 3).rename(tmp_path / "run:2.avi")
    assert isinstance(open_source("run:2.avi"), VideoSource)


def test_plain_paths(tmp_path: Path) -> None:
    assert isinstance(open_source(str(folder_of(tmp_path / "f", 2))), FolderSource)
    assert isinstance(open_source(str(tmp_path / "f" / "frame_0.png")), FolderSource)
    assert isinstance(open_source(str(video_of(tmp_path / "a.mkv", 3))), VideoSource)
    with Recorder(tmp_path / "a.mcap") as recorder:
        recorder.frame(Frame(noise(), 0, 0))
    assert isinstance(open_source(str(tmp_path / "a.mcap")), RecordingSource)
    assert isinstance(open_source(f"mcap:{tmp_path / 'a.mcap'}?topic=/camera/image"), RecordingSource)
    with pytest.raises(SourceError, match="unknown key 'tpic'"):
        open_source(f"mcap:{tmp_path / 'a.mcap'}?tpic=x")


def test_an_entry_point_opens_its_scheme(monkeypatch: pytest.MonkeyPatch) -> None:
    from importlib.metadata import EntryPoint

    import edge.sources as sources

    points = [
        EntryPoint("mine", "tests.edge.sources.test_sources:open_mine", "voronoi_touch.sources"),
        EntryPoint("torn", "no_such_package_here:open", "voronoi_touch.sources"),
    ]
    monkeypatch.setattr(
        sources, "_from_packages", lambda name=None: [p for p in points if name in (None, p.name)]
    )
    assert open_source("mine:x?seed=4", rate_hz=7.0).name == "mine x 4 7.0"
    with pytest.raises(SourceError, match="no_such_package_here"):
        open_source("torn:")
    with pytest.raises(SourceError, match=r"voronoi-touch\[calib\]"):
        open_source("sim:")


def open_mine(where: str, options: Options) -> Any:
    class Mine:
        name = f"mine {where} {options.extra['seed']} {options.rate_hz}"

    return Mine()


# -- folders ---------------------------------------------------------------------------------------


def test_folder_in_natural_order(tmp_path: Path) -> None:
    source = FolderSource(folder_of(tmp_path / "f", 12), rate_hz=10.0)
    (tmp_path / "f" / "notes.txt").write_text("not an image, and not named like one")
    frames = list(source)
    assert source.size_px == (64, 48)
    assert [p.name for p in source.paths] == [f"frame_{i}.png" for i in range(12)]
    for i, frame in enumerate(frames):
        assert np.array_equal(frame.image, noise(i))
    assert [f.capture_ns for f in frames] == [i * 100_000_000 for i in range(12)]
    assert [f.sequence for f in frames] == list(range(12))
    assert len(list(source)) == 12


def test_colour_and_depth(tmp_path: Path) -> None:
    (tmp_path / "f").mkdir()
    colour = np.zeros((48, 64, 3), np.uint8)
    colour[:] = (0, 0, 255)  # red, as OpenCV orders it
    cv2.imwrite(str(tmp_path / "f/1.png"), colour)
    cv2.imwrite(str(tmp_path / "f/2.png"), np.full((48, 64), 4095, np.uint16))
    first, second = FolderSource(tmp_path / "f")
    assert first.image.shape == (48, 64)
    assert np.all(first.image == 76)
    assert second.image.dtype == np.uint16
    assert second.bits == 16
    assert np.all(second.image == 4095)


@pytest.mark.parametrize("name", ["a.png", "text.png", "empty.png"])
def test_files_that_are_not_images_are_refused(
    tmp_path: Path, name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / name).write_bytes(
        {"a.png": b"\x89PNG\r\n\x1a\n broken", "text.png": b"hello", "empty.png": b""}[name]
    )
    with pytest.raises(SourceError, match=r"not an image|damaged") as caught:
        open_source(str(tmp_path / name))
    assert name in str(caught.value)
    assert capfd.readouterr().err == ""  # OpenCV's own messages are suppressed


def test_one_image(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), noise(3))
    assert np.array_equal(read_image(tmp_path / "a.png"), noise(3))
    with pytest.raises(SourceError, match="no such file"):
        read_image(tmp_path / "b.png")


def test_empty_folder(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="no images in it"):
        open_source(str(tmp_path))


def test_mixed_sizes(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "f", 3)
    cv2.imwrite(str(folder / "frame_1.png"), noise(0, (32, 32)))
    with pytest.raises(SourceError, match=r"frame_1\.png is 32x32, the first one 64x48"):
        list(FolderSource(folder))


def test_a_damaged_image_in_the_middle_is_counted(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "f", 4)
    (folder / "frame_2.png").write_bytes(b"gone")
    source = FolderSource(folder)
    assert [f.sequence for f in source] == [0, 1, 3]
    assert source.faults["damaged frame"] == 1


# -- videos ----------------------------------------------------------------------------------------


def test_lossless_video_is_exact(tmp_path: Path) -> None:
    source = VideoSource(video_of(tmp_path / "a.mkv", 10))
    frames = list(source)
    assert source.size_px == (64, 48)
    assert source.rate_hz == 50.0
    for i, frame in enumerate(frames):
        assert np.array_equal(frame.image, noise(i))
        assert frame.clock is Clock.RECORDED
    assert [f.sequence for f in frames] == list(range(10))
    assert np.allclose(np.diff([f.capture_ns for f in frames]), 20e6, atol=1e6)
    assert not source.truncated
    assert len(list(source)) == 10


def test_truncated_video_plays_as_far_as_it_goes(tmp_path: Path) -> None:
    path = video_of(tmp_path / "a.avi", 40, codec="MJPG", size=(320, 240))
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 6 // 10])
    source = VideoSource(path)
    frames = list(source)
    assert 20 <= len(frames) < 30
    assert source.truncated or source.frames_n <= len(frames) + 1  # FFmpeg may count what is left


@pytest.mark.parametrize("content", [b"", b"text, not a video", b"RIFF\x00\x00\x00\x00AVI LIST"])
def test_files_that_are_not_videos_are_refused(
    tmp_path: Path, content: bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.avi").write_bytes(content)
    with pytest.raises(SourceError, match=r"not a video|no frame") as caught:
        open_source(str(tmp_path / "a.avi"))
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().err == ""


@pytest.mark.real
@pytest.mark.parametrize(
    ("name", "n", "rate_hz"),
    [("Movement4", 635, 20), ("north", 541, 120), ("west", 400, 120), ("flatSkin", 188, 60)],
)
def test_published_videos_play_to_their_end(real_dir: Path, name: str, n: int, rate_hz: int) -> None:
    source = open_source(str(real_dir / "video" / f"{name}.avi"))
    count = 0
    for frame in source:
        assert frame.image.shape == (480, 640)
        assert frame.sequence == count
        count += 1
    assert count == n
    assert source.rate_hz == rate_hz
    assert isinstance(source, VideoSource)
    assert not source.faults


@pytest.mark.real
def test_published_stills_open(real_dir: Path) -> None:
    source = open_source(str(real_dir / "tactip331_binary" / "frames"))
    assert isinstance(source, FolderSource)
    assert len(source.paths) == 600
    numbers = [int(p.stem.split("_")[1]) for p in source.paths]
    assert numbers == sorted(numbers)


# -- live ------------------------------------------------------------------------------------------


class Scripted(ThreadedSource):
    """Gives a frame when the test releases it."""

    def __init__(self) -> None:
        super().__init__("scripted")
        self.go = threading.Semaphore(0)
        self.done = threading.Semaphore(0)
        self.n = 0
        self.size_px = (4, 4)

    def _work(self) -> None:
        while not self._closing.is_set():
            self.go.acquire()
            if self._closing.is_set():
                return
            self._offer(Frame(np.full((4, 4), 200, np.uint8), self.n, self.n))
            self.n += 1
            self.done.release()

    def give(self, n: int) -> None:
        for _ in range(n):
            self.go.release()
            self.done.acquire()

    def close(self) -> None:
        self._closing.set()
        self.go.release()
        super().close()


def test_a_slow_reader_gets_the_newest_frame_and_a_count() -> None:
    source = Scripted()
    source.start()
    source.give(1)
    assert source.read(SOON_S).sequence == 0  # type: ignore[union-attr]
    source.give(5)
    assert source.read(SOON_S).sequence == 5  # type: ignore[union-attr]
    assert source.dropped_n == 4
    assert source.received_n == 6
    assert source.read(0.0) is None
    source.close()
    assert source.read(SOON_S) is None
    assert list(source) == []


def test_closing_wakes_a_waiting_reader() -> None:
    source = Scripted()
    source.start()
    got: list[Any] = []
    reader = threading.Thread(target=lambda: got.append(list(source)))
    reader.start()
    source.close()
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


def test_a_stall_is_reported_while_it_lasts() -> None:
    source = Scripted()
    source.start()
    source.give(1)
    source._last_s -= 1.0
    assert source.condition == "stalled"
    source.give(1)
    source.rate_hz = 0.01  # patience of a slow camera
    assert source.condition == ""
    source.close()


def test_watch_sees_frozen_and_black() -> None:
    watch = Watch()
    for i in range(5):
        assert watch.check(Frame(noise(i), i, i)) == ""
    still = [watch.check(Frame(noise(9), i, i)) for i in range(PARAMS.frozen_frames_n + 1)]
    assert still == [""] * PARAMS.frozen_frames_n + ["frozen"]
    assert watch.check(Frame(noise(10), 0, 0)) == ""
    assert watch.check(Frame(noise(1) // 64, 0, 0)) == "black"
    deep = noise(2).astype(np.uint16)  # up to 255 of 4095: one sixteenth
    assert watch.check(Frame(deep, 0, 0, bits=12)) == ""
    assert watch.check(Frame(deep // 4, 0, 0, bits=12)) == "black"


# -- replay ----------------------------------------------------------------------------------------


class Clocked:
    """A clock that only waiting advances, so that a replay's timing can be tested exactly."""

    def __init__(self, paced: Paced) -> None:
        self.now_ns = 1_000
        self.waits: list[float] = []
        closing = paced._closing
        real_wait = closing.wait

        def wait(timeout: float | None = None) -> bool:
            assert timeout is not None
            self.waits.append(timeout)
            self.now_ns += round(timeout * 1e9) + 300_000  # wakes 0.3 ms late, like a kernel
            return real_wait(0)

        closing.wait = wait  # type: ignore[method-assign]
        paced._clock_ns = lambda: self.now_ns


class Listed:
    """A recording of given times."""

    polarity = Polarity.FOUND
    lens: Lens | None = None
    name, size_px, live, dropped_n = "listed", (4, 4), False, 0

    def __init__(self, times_ns: list[int], rate_hz: float) -> None:
        self.times_ns, self.rate_hz, self.closed = times_ns, rate_hz, False

    def __iter__(self) -> Any:
        for i, t in enumerate(self.times_ns):
            yield Frame(np.full((4, 4), i % 256, np.uint8), t, 10 * i, Clock.RECORDED, truth={"i": i})

    def close(self) -> None:
        self.closed = True


def replayed(paced: Paced) -> list[Frame]:
    frames: list[Frame] = []
    paced._offer = frames.append  # type: ignore[method-assign,assignment]
    paced._work()
    return frames


def test_replay_keeps_the_recordings_times_without_drift() -> None:
    times = [7_000_000_000 + i * 8_333_333 for i in range(500)]
    times[100:] = [t + 50_000_000 for t in times[100:]]  # a gap
    paced = Paced(Listed(times, 120.0))
    clock = Clocked(paced)
    frames = replayed(paced)
    start = frames[0].capture_ns
    assert [f.capture_ns - start for f in frames] == [t - times[0] for t in times]
    assert clock.now_ns - frames[-1].capture_ns <= 300_000  # late wake-ups did not add up
    assert [f.sequence for f in frames] == [10 * i for i in range(500)]
    assert frames[3].truth == {"i": 3}
    assert {f.clock for f in frames} == {Clock.HOST}
    assert paced.live


def test_replay_at_a_given_rate() -> None:
    paced = Paced(Listed([0, 5, 5, 5], 30.0), rate_hz=1000.0)
    Clocked(paced)
    frames = replayed(paced)
    assert np.diff([f.capture_ns for f in frames]).tolist() == [1_000_000] * 3


def test_replay_at_twice_the_speed_keeps_the_gaps() -> None:
    paced = Paced(Listed([0, 10_000_000, 50_000_000], 100.0), speed=2.0)
    Clocked(paced)
    assert np.diff([f.capture_ns for f in replayed(paced)]).tolist() == [5_000_000, 20_000_000]
    assert paced.rate_hz == 200.0


def test_replay_of_a_clock_that_stands_still() -> None:
    paced = Paced(Listed([9, 9, 9], 100.0))
    Clocked(paced)
    assert np.diff([f.capture_ns for f in replayed(paced)]).tolist() == [10_000_000] * 2


def test_replay_in_a_loop_goes_on_counting() -> None:
    listed = Listed([0, 1_000_000, 2_000_000], 1000.0)
    paced = Paced(listed, loop=True)
    Clocked(paced)
    frames: list[Frame] = []

    def offer(frame: Frame) -> None:
        frames.append(frame)
        if len(frames) == 8:
            paced._closing.set()

    paced._offer = offer  # type: ignore[method-assign]
    paced._work()
    assert [f.sequence for f in frames] == [0, 10, 20, 21, 31, 41, 42, 52]
    assert np.diff([f.capture_ns for f in frames]).tolist() == [1_000_000] * 7


def test_a_replay_waits_for_the_reader_of_the_rest_frame() -> None:
    """Time begins when the first images have been read, however long that takes."""
    paced = Paced(Listed([i * 1_000 for i in range(12)], 1e6), rest_n=8)
    paced.start()
    frames: list[Frame] = []
    for n in range(8):
        with paced._changed:
            assert paced._changed.wait_for(lambda: paced.received_n > len(frames), SOON_S)
        assert n == 7 or paced.received_n == n + 1
        frame = paced.read(SOON_S)
        assert frame is not None
        frames.append(frame)
    paced.close()
    assert [f.sequence for f in frames[:7]] == [10 * i for i in range(7)]
    assert all(step_ns >= 1_000 for step_ns in np.diff([f.capture_ns for f in frames]))


def test_closing_ends_a_replay_that_waits_for_its_reader() -> None:
    paced = Paced(Listed([0, 1, 2], 1000.0), rest_n=3)
    paced.start()
    assert paced.read(SOON_S) is not None
    paced.close()
    assert not paced._thread.is_alive()


def test_closing_ends_a_replay_at_once() -> None:
    paced = Paced(Listed([0, 3_600_000_000_000], 1.0))
    paced.start()
    assert paced.read(SOON_S) is not None
    paced.close()  # joins the thread, which would otherwise wait for an hour
    assert not paced._thread.is_alive()
    assert paced.source.closed  # type: ignore[attr-defined]


def test_a_replay_delivers_its_last_frame_and_ends() -> None:
    paced = Paced(Listed([0, 1, 2], 1000.0), rate_hz=200.0)
    sequences = [f.sequence for f in paced]
    assert sequences[-1] == 20
    assert paced.dropped_n + len(sequences) == 3
    assert paced.ended


def test_the_address_sets_whether_pins_are_dark(data_dir: Path) -> None:
    source = open_source(f"mcap:{data_dir / 'press.mcap'}?pins=dark")
    paced = Paced(source)
    assert source.polarity is paced.polarity is Polarity.DARK
    assert open_source(str(data_dir / "press.mcap")).polarity is Polarity.FOUND
    paced.close()
