"""Every chosen number of the second process; the evidence for each is in docs/tuning.md, "Second process"."""

from dataclasses import dataclass

from edge.params import PARAMS as RUNTIME


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
