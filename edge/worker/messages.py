"""What the two processes tell each other, beside pins and images as the loop knows them.

A message is a tuple: the name of what the receiver does, then its arguments. To the worker: "show",
"stopped", and what a `Recorder` does by the same name. To the loop: what `WorkerClient` has in a table.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from hostlink.web import Listen


@dataclass(frozen=True, slots=True)
class WorkerConfig:
    listen: Listen | None = None  # where the live page is served; None: no page
    record: Path | None = None  # a file to record from the first frame on; None: none
    overwrite: bool = False  # whether that file may exist already
    recordings: Path = Path(".")  # folder for recordings started on the page
    tip: Mapping[str, str] = field(default_factory=dict)  # about the tip, for recordings
    finger: int = 1  # its number
