"""Configuration of the second process, the form of its messages, and its chosen numbers.

A message is a tuple: the name of what the receiver does, then its arguments. To the worker: "show",
"stopped", and what a `Recorder` does by the same name. To the loop: what `WorkerClient` has in a table.
The evidence for each number is in docs/tuning.md, "Second process".
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from edge.params import PARAMS as RUNTIME
from hostlink.web import Listen


@dataclass(frozen=True, slots=True)
class WorkerConfig:
    listen: Listen | None = None  # where the live page is served; None: no page
    record: Path | None = None  # a file to record from the first frame on; None: none
    overwrite: bool = False  # whether that file may exist already
    recordings: Path = Path(".")  # folder for recordings started on the page
    tip: Mapping[str, str] = field(default_factory=dict)  # about the tip, for recordings
    finger: int = 1  # its number


@dataclass(frozen=True, slots=True)
class WorkerParams:
    """Parameters by name. Units: s, seconds; n, items."""

    nice: int = 5  # added to its priority's number, so that the loop goes first
    lived_s: float = RUNTIME.rarely_s  # a process that lived shorter is not restarted
    end_s: float = 12.0  # for a page to close its viewers, a recording to be written
    memory_bytes: int = 24 << 20  # for messages under way
    report_s: float = RUNTIME.announced_s  # between reports of what is no new result
    recent_s: float = 0.5  # time that the charts' rows in a packet tell of


PARAMS = WorkerParams()
