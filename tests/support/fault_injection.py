"""Fault injection: cameras and links that fail on a schedule, to test the program's promises.

Rules
- A fault is injected where the hardware would cause it, below everything that is meant to detect it: the
  faulty camera's images pass the same check for frozen and black ones as a real camera's.
- Everything follows from the seed and the given clock: the same seed gives the same schedule.
- `EXPECTED` lists the faults that must be announced for an episode; checks of promises use it.
- A fault ends with its episode, by itself.
"""

import time
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from random import Random
from typing import Any

import cv2
import numpy as np

from edge.link.medium import CanFrame, Medium, MediumError, MediumFull
from edge.sources.live import ThreadedSource, Watch
from edge.types import Frame
from hostlink.wire import FaultCode

F = FaultCode
#: Codes of which one must be announced for each kind of fault; none: it need not be announced.
EXPECTED: dict[str, frozenset[FaultCode]] = {
    # camera
    "lost": frozenset({F.CAMERA_LOST}),
    "stall": frozenset({F.CAMERA_STALLED}),
    "freeze": frozenset({F.CAMERA_STALLED}),
    "black": frozenset({F.IMAGE_DARK}),
    "dim": frozenset({F.IMAGE_DARK}),
    "bright": frozenset({F.IMAGE_BRIGHT}),
    "blur": frozenset({F.IMAGE_BLURRED}),
    "shift": frozenset({F.CAMERA_MOVED}),
    "cover": frozenset({F.PINS_LOST, F.TRACKER_LOST}),
    "clock": frozenset({F.CLOCK_STEP}),
    "drop": frozenset(),  # single frames: the status bit FRAMES_DROPPED
    "corrupt": frozenset(),  # a block of noise: pins in it are lost, or nothing is
    "delay": frozenset(),
    # link
    "down": frozenset({F.LINK_DOWN}),
    "full": frozenset({F.LINK_DOWN}),
    "bus off": frozenset({F.BUS_OFF}),
    "noise": frozenset(),  # bits that flip on the way: the receiver's checks must detect them
    # board
    "hot": frozenset({F.OVER_TEMPERATURE}),
    "disk": frozenset({F.DISK_FULL}),
}
CAMERA = (
    "lost", "stall", "freeze", "black", "dim", "bright", "blur", "shift", "cover", "clock", "drop", "corrupt",
    "delay",
)  # fmt: skip
LINK = ("down", "full", "bus off", "noise")
BOARD = ("hot", "disk")

LENGTH_S = (0.3, 1.5)  # of an episode: at least three times the limit for its announcement
PAUSE_S = (0.5, 2.0)  # between two episodes of one row
SHIFT_PX = (0.2, -0.15)  # in pitches of a tip with 331 pins at 320 px: 2.4 px
BLUR_PX = 4.0
CLOCK_S = 5.0
DROP_SHARE = 0.3
DELAY_S = 0.02
HOT_DEGC, COOL_DEGC = 95.0, 45.0
KINDS_KEPT = 256

Clock = Callable[[], float]


@dataclass(frozen=True, slots=True)
class Episode:
    """One fault: from `start_s` on for `length_s`, on the schedule's clock."""

    kind: str
    start_s: float
    length_s: float

    @property
    def end_s(self) -> float:
        return self.start_s + self.length_s


def schedule(
    seed: int,
    seconds: float,
    kinds: Sequence[str],
    *,
    length_s: tuple[float, float] = LENGTH_S,
    pause_s: tuple[float, float] = PAUSE_S,
) -> list[Episode]:
    """Episodes one after the other, never two at once, each kind as often as the others.

    length_s, pause_s  least and most, of an episode and between two
    """
    random = Random(seed)
    episodes: list[Episode] = []
    now, bag = 0.0, list[str]()
    while True:
        if not bag:
            bag = random.sample(list(kinds), len(kinds))
        now += random.uniform(*pause_s)
        lasts_s = random.uniform(*length_s)
        if now + lasts_s > seconds:
            return episodes
        episodes.append(Episode(bag.pop(), now, lasts_s))
        now += lasts_s


class _Row:
    """Which episode holds now. Asked from several threads."""

    def __init__(self, episodes: Iterable[Episode], clock: Clock) -> None:
        self._episodes = sorted(episodes, key=lambda e: e.start_s)
        self._starts = [e.start_s for e in self._episodes]
        self.clock = clock

    def now(self) -> str:
        """Its kind, or "" if there is none."""
        now = self.clock()
        i = bisect_right(self._starts, now) - 1
        return self._episodes[i].kind if i >= 0 and now < self._episodes[i].end_s else ""


class FaultySource(ThreadedSource):
    """A live source, seen through a camera that fails.

    source    a live source; closed with this one
    episodes  kinds out of `CAMERA`
    clock     seconds; the schedule's
    kinds     faults of the newest images, by sequence number; "" none
    """

    def __init__(
        self,
        source: ThreadedSource,
        episodes: Iterable[Episode],
        clock: Clock = time.monotonic,
        seed: int = 0,
    ) -> None:
        super().__init__(source.name)
        self.recorded = getattr(source, "recorded", False)
        self.size_px, self.rate_hz = source.size_px, source.rate_hz
        self._source = source
        self._row = _Row(episodes, clock)
        self._random = np.random.default_rng(seed)
        self._watch = Watch()
        self._frozen: Frame | None = None
        self._clock_ns = 0  # by how much this camera's clock is off
        self._stepped = False
        self.kinds: dict[int, str] = {}

    def _work(self) -> None:
        while not self._closing.is_set():
            frame = self._source.read(0.02)
            kind = self._row.now()
            if kind == "lost":
                self._set_condition("lost")
            elif self._condition == "lost":
                self._set_condition("")
            if frame is None:
                if self._source.ended:
                    return
                continue
            seen = self._see(kind, frame)
            if seen is not None:
                self.kinds[seen.sequence] = kind
                if len(self.kinds) > KINDS_KEPT:
                    self.kinds.pop(next(iter(self.kinds)))
                self._set_condition(self._watch.check(seen))
                self._offer(seen)

    def _see(self, kind: str, frame: Frame) -> Frame | None:
        """The frame that arrives; None: none."""
        if kind != "freeze":
            self._frozen = None
        if kind == "clock" and not self._stepped:
            self._clock_ns += round(CLOCK_S * 1e9)
        self._stepped = kind == "clock"
        frame = replace(frame, capture_ns=frame.capture_ns + self._clock_ns)
        if kind in ("lost", "stall") or (kind == "drop" and self._random.random() < DROP_SHARE):
            return None
        if kind == "freeze":
            self._frozen = self._frozen or frame
            return replace(frame, image=self._frozen.image)
        if kind == "delay":
            self._closing.wait(DELAY_S)
        picture = _PICTURES.get(kind)
        return frame if picture is None else replace(frame, image=picture(frame.image, self._random))

    def close(self) -> None:
        super().close()
        self._source.close()


def _shifted(image: Any, random: Any) -> Any:
    pitch_px = 12.0 * image.shape[1] / 320
    moved = np.array([[1.0, 0.0, SHIFT_PX[0] * pitch_px], [0.0, 1.0, SHIFT_PX[1] * pitch_px]])
    return cv2.warpAffine(image, moved, image.shape[::-1], borderMode=cv2.BORDER_REPLICATE)


def _noisy(image: Any, random: Any) -> Any:
    """A block of the image holds noise, as after a damaged transfer."""
    height, width = image.shape
    top = int(random.integers(0, height * 3 // 4))
    out = image.copy()
    out[top : top + height // 8] = random.integers(0, 255, (len(out[top : top + height // 8]), width))
    return out


def _covered(image: Any, random: Any) -> Any:
    """An object before the lens leaves a fifth of the view."""
    out = image.copy()
    out[:, image.shape[1] // 5 :] = int(np.median(image))
    noise = random.integers(0, 3, out.shape, dtype=np.uint8)
    return cv2.add(out, noise)


_PICTURES: dict[str, Callable[[Any, Any], Any]] = {
    "black": lambda image, random: random.integers(0, 2, image.shape, dtype=image.dtype),
    "dim": lambda image, random: (image * 0.12 + random.random(image.shape)).astype(image.dtype),
    "bright": lambda image, random: np.maximum(image, 255 - (random.random(image.shape) < 0.05)).astype(
        image.dtype
    ),
    "blur": lambda image, random: cv2.GaussianBlur(image, (0, 0), BLUR_PX),
    "shift": _shifted,
    "corrupt": _noisy,
    "cover": _covered,
}


class FaultyMedium(Medium):
    """A bus that fails; made anew by every opening, while the schedule goes on."""

    def __init__(self, medium: Medium, row: _Row, random: Random, refused: Callable[[float], None]) -> None:
        self._medium, self._row, self._random, self._refused = medium, row, random, refused
        self.instant = medium.instant
        self.broken = medium.broken

    def write(self, item: Any) -> None:
        kind = self._row.now()
        self.bus_off = kind == "bus off" or self._medium.bus_off
        if kind in ("down", "full", "bus off"):
            self._refused(self._row.clock())
        if kind == "down":
            raise MediumError("Network is down (on purpose)")
        if kind in ("full", "bus off"):
            raise MediumFull("no buffer space (on purpose)")
        self._medium.write(_flipped(item, self._random) if kind == "noise" else item)

    def read(self, timeout_s: float) -> Any:
        if self._row.now() == "down":
            raise MediumError("Network is down (on purpose)")
        return self._medium.read(timeout_s)

    def close(self) -> None:
        self._medium.close()


def _flipped(frame: CanFrame, random: Random) -> CanFrame:
    """The frame with one bit flipped, every second time."""
    data = bytearray(frame.data)
    if data and random.random() >= 0.5:
        data[random.randrange(len(data))] ^= 1 << random.randrange(8)
    return replace(frame, data=bytes(data))


def faulty_medium(
    open_medium: Callable[[], Medium],
    episodes: Iterable[Episode],
    clock: Clock = time.monotonic,
    seed: int = 0,
    refused: Callable[[float], None] = lambda at_s: None,
) -> Callable[[], FaultyMedium]:
    """A function that opens a failing medium; for the constructors of the sinks.

    episodes   kinds out of `LINK`
    refused    gets the times at which something was not sent: before, the fault is not observable
    """
    row, random = _Row(episodes, clock), Random(seed)

    def opener() -> FaultyMedium:
        if row.now() == "down":
            raise MediumError("Network is down (on purpose)")
        return FaultyMedium(open_medium(), row, random, refused)

    return opener


class FaultyBoard:
    """Temperature and storage of a failing board.

    episodes  kinds out of `BOARD`
    """

    def __init__(self, episodes: Iterable[Episode], clock: Clock = time.monotonic) -> None:
        self._row = _Row(episodes, clock)

    def temperature(self) -> float:
        """degC; for `BoardMonitor`."""
        return HOT_DEGC if self._row.now() == "hot" else COOL_DEGC

    def storage(self) -> str:
        """For `BoardMonitor`."""
        return "no space left (on purpose)" if self._row.now() == "disk" else ""
