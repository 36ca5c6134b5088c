"""The messages between the two processes: data from the loop, control messages both ways."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from edge.types import Frame, Rest, Result
from hostlink.web import Listen
from hostlink.wire import State


@dataclass(frozen=True, slots=True)
class WorkerConfig:
    listen: Listen | None = None  # where the live page is served; None: no page
    record: Path | None = None  # a file to record from the first frame on; None: none
    overwrite: bool = False  # whether that file may exist already
    recordings: Path = Path(".")  # folder for recordings started on the page
    tip: Mapping[str, str] = field(default_factory=dict)  # about the tip, for recordings
    finger: int = 1  # its number


@dataclass(frozen=True, slots=True)
class Begin:
    config: WorkerConfig
    source: str  # the camera's name
    rate_hz: float  # the camera's
    log_level: int  # of the program


@dataclass(frozen=True, slots=True)
class Ready:
    port: int = 0  # where the page is served
    refused: str = ""  # the user's mistake, as text; "": none
    kind: str = ""  # of the error, a class of `edge.errors`


@dataclass(frozen=True, slots=True)
class Show:
    """New data for viewers since the last such message.

    now_s, last_s  monotonic time: now, and of the newest result
    result, state  the newest; None: as before
    """

    now_s: float
    last_s: float
    seen_n: int  # results since the start
    rows: list[tuple[float, ...]]  # of the charts: one a sample
    frame: Frame | None  # the newest image, with or without a result; None: as before
    result: Result | None
    state: State | None
    rest: Rest | None  # the rest frame; None: as before
    about: dict[str, Any]  # data that do not come from a frame


@dataclass(frozen=True, slots=True)
class Take:
    """One turn of the loop, to be recorded.

    lost_n  turns lost before this one: the memory was full
    """

    frame: Frame
    result: Result | None
    state: State
    lost_n: int


@dataclass(frozen=True, slots=True)
class Event:
    """A line of the log, to be recorded."""

    level: str
    text: str


@dataclass(frozen=True, slots=True)
class Attach:
    """A file to store in the recording.

    data  (n,) uint8
    """

    name: str
    data: Any


@dataclass(frozen=True, slots=True)
class Stopped:
    """The loop has stopped recording; everything before this was sent."""


@dataclass(frozen=True, slots=True)
class Ask:
    """A viewer's command for the loop: "tare", "start_recording", "stop_recording"."""

    number: int
    what: str
    force: bool = False


@dataclass(frozen=True, slots=True)
class Answer:
    """refused  why nothing was done; "": done"""

    number: int
    refused: str = ""


@dataclass(frozen=True, slots=True)
class Wants:
    """The features that all viewers request together; None: nobody watches."""

    wants: frozenset[str] | None


@dataclass(frozen=True, slots=True)
class PageReport:
    """The page: present viewers, packets sent and viewers disconnected so far."""

    viewers_n: int = 0
    sent_n: int = 0
    cut_off_n: int = 0


@dataclass(frozen=True, slots=True)
class RecordingReport:
    """The recording: images written, messages lost, why it ended."""

    frames_n: int = 0
    dropped_n: int = 0
    fault: str | None = None
