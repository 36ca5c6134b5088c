"""The messages between the two processes: data from the loop, control messages both ways."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from edge.pipeline import Result
from edge.types import Frame, Rest
from hostlink.web import Listen
from hostlink.wire import State


@dataclass(frozen=True, slots=True)
class Begin:
    listen: Listen | None  # where to serve the page; None: no page
    source: str  # the camera's name
    rate_hz: float  # the camera's
    recordings: str  # folder for recordings started on the page
    record: str  # file to record from the start; "": none
    overwrite: bool  # whether it may exist already
    tip: dict[str, str]  # about the tip
    finger: int  # its number
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
