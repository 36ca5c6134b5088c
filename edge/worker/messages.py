"""What the two processes tell each other, beside pins and images as the loop knows them.

A message is a tuple: the name of what the receiver does, then its arguments. To the worker: "show",
"stopped", and what a `Recorder` does by the same name. To the loop: what `WorkerClient` has in a table.
"""

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
