"""Injected faults have the effect of their kind."""

import queue
from collections.abc import Iterator
from functools import partial
from itertools import pairwise, repeat

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from edge.link.medium import MediumError, MediumFull
from edge.sources import ThreadedSource
from edge.types import Clock, Frame
from hostlink.wire import FaultCode
from tests.support.fault_injection import (
    BOARD,
    CAMERA,
    EXPECTED,
    LENGTH_S,
    LINK,
    PAUSE_S,
    Episode,
    FaultyBoard,
    FaultySource,
    faulty_medium,
    schedule,
)
from tests.support.media import Wire
from tests.support.waiting import SOON_S


@given(st.integers(0, 1000), st.floats(10.0, 500.0), st.sampled_from([CAMERA, LINK, BOARD]))
def test_a_schedule_is_seeded_ordered_and_fair(seed: int, seconds: float, kinds: tuple[str, ...]) -> None:
    episodes = schedule(seed, seconds, kinds)
    assert episodes == schedule(seed, seconds, kinds)
    for a, b in pairwise(episodes):
        assert b.start_s - a.end_s >= PAUSE_S[0]
    assert all(LENGTH_S[0] <= e.length_s <= LENGTH_S[1] and e.end_s <= seconds for e in episodes)
    counts = [sum(e.kind == kind for e in episodes) for kind in kinds]
    assert max(counts) - min(counts) <= 1


def test_every_camera_link_and_board_fault_of_the_table_can_be_made() -> None:
    made = frozenset().union(*EXPECTED.values())
    not_made_here = {
        FaultCode.CALIBRATION_MISSING,  # a matter of files
        FaultCode.CALIBRATION_FOREIGN,
        FaultCode.TARE_IMPLAUSIBLE,
        FaultCode.OVERLOAD,  # a matter of the skin
    }
    assert made == set(FaultCode) - not_made_here
    assert set(EXPECTED) == {*CAMERA, *LINK, *BOARD}


class Manual(ThreadedSource):
    """Frames one by one, released by the test."""

    def __init__(self) -> None:
        super().__init__("manual")
        self.size_px, self.rate_hz = (64, 48), 100.0
        self.frames: queue.Queue[Frame | None] = queue.Queue()
        self.n = 0

    def _work(self) -> None:
        while (frame := self.frames.get()) is not None:
            self._offer(frame)

    def show(self) -> Frame:
        image = np.random.default_rng(self.n).integers(20, 200, (48, 64), dtype=np.uint8)
        frame = Frame(image, self.n * 10_000_000, self.n, Clock.HOST)
        self.n += 1
        self.frames.put(frame)
        return frame

    def close(self) -> None:
        self.frames.put(None)
        super().close()


class Bench:
    """A faulty source on a clock that the test sets; its fault lasts from 1 to 2 s."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.manual = Manual()

    def fail(self, kind: str) -> None:
        self.source = FaultySource(self.manual, [Episode(kind, 1.0, 1.0)], lambda: self.now_s, seed=1)

    def next(self, now_s: float, patience_s: float = SOON_S) -> tuple[Frame, Frame | None]:
        """(true image, image received)."""
        self.now_s = now_s
        shown = self.manual.show()
        return shown, self.source.read(patience_s)


@pytest.fixture
def bench() -> Iterator[Bench]:
    made = Bench()
    yield made
    made.source.close()


@pytest.mark.parametrize("kind", ["freeze", "black", "bright", "dim", "blur", "corrupt", "shift"])
def test_pictures_change_within_the_episode_only(bench: Bench, kind: str) -> None:
    bench.fail(kind)
    for now_s, same in ((0.5, True), (1.2, None), (1.5, False), (2.5, True)):
        shown, seen = bench.next(now_s)
        assert seen is not None
        assert (seen.capture_ns, seen.sequence) == (shown.capture_ns, shown.sequence)
        if same is not None:
            assert np.array_equal(shown.image, seen.image) is same


@pytest.mark.parametrize(
    ("kind", "condition", "at_once"), [("freeze", "frozen", False), ("black", "black", True)]
)
def test_an_image_that_shows_nothing_is_reported_with_its_own_frame(
    bench: Bench, kind: str, condition: str, at_once: bool
) -> None:
    bench.fail(kind)
    seen = []
    for _ in range(12):
        bench.next(1.5)
        seen.append(bench.source.frame_condition)
    assert seen[0] == seen[1] == (condition if at_once else "")
    assert seen[-1] == condition
    bench.next(2.5)
    assert bench.source.frame_condition == ""


@pytest.mark.parametrize(("kind", "condition"), [("lost", "lost"), ("stall", "stalled")])
def test_a_dead_camera_carries_nothing_and_is_reported(bench: Bench, kind: str, condition: str) -> None:
    bench.fail(kind)
    assert bench.next(0.5)[1] is not None
    assert bench.next(1.5, 0.2)[1] is None
    assert bench.source.condition == condition
    assert bench.next(2.5)[1] is not None
    assert bench.source.condition == ""


def test_a_clock_steps_once_and_stays(bench: Bench) -> None:
    bench.fail("clock")
    pairs = [bench.next(now_s) for now_s in (0.5, 1.2, 1.5, 2.5)]
    steps_s = [(seen.capture_ns - shown.capture_ns) / 1e9 for shown, seen in pairs if seen]
    assert steps_s == [0.0, 5.0, 5.0, 5.0]


@pytest.mark.parametrize(
    ("kind", "error"), [("down", MediumError), ("full", MediumFull), ("bus off", MediumFull)]
)
def test_links_refuse_within_the_episode_only(kind: str, error: type[Exception]) -> None:
    now, wire, refused = [0.5], Wire(), list[float]()
    opener = faulty_medium(lambda: wire, [Episode(kind, 1.0, 1.0)], lambda: now[0], refused=refused.append)
    medium = opener()
    medium.write(b"a")
    now[0] = 1.5
    with pytest.raises(error):
        medium.write(b"b")
    assert medium.bus_off is (kind == "bus off")
    assert refused == [1.5]
    if kind == "down":
        with pytest.raises(MediumError):
            opener()
        with pytest.raises(MediumError):
            medium.read(0.0)
    now[0] = 2.0
    medium.write(b"c")
    assert wire.items == [b"a", b"c"]
    assert not medium.bus_off


def test_noise_flips_one_bit_of_half_of_the_items_the_same_for_the_same_seed() -> None:
    wires = Wire(), Wire()
    noise = [Episode("noise", 0.0, 1.0)]
    for wire in wires:
        medium = faulty_medium(partial(next, repeat(wire)), noise, lambda: 0.5, seed=3)()
        for _ in range(200):
            medium.write(bytes(8))
    turned = [sum(byte.bit_count() for byte in item) for item in wires[0].items]
    assert set(turned) == {0, 1}
    assert 60 < sum(turned) < 140
    assert wires[0].items == wires[1].items


def test_boards_are_hot_and_full_within_the_episode_only() -> None:
    now = [0.0]
    board = FaultyBoard([Episode("hot", 1.0, 1.0), Episode("disk", 3.0, 1.0)], lambda: now[0])
    seen = []
    for now[0] in (0.5, 1.5, 2.5, 3.5, 4.5):
        seen.append((board.temperature() > 80.0, bool(board.storage())))
    assert seen == [(False, False), (True, False), (False, False), (False, True), (False, False)]
