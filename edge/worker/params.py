"""Every chosen number of the second process; the evidence for each is in docs/tuning.md, "Second process"."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class WorkerParams:
    """Parameters by name. Units: s, seconds; n, items."""

    # --- the process
    nice: int = 5  # added to its priority's number, so that the loop goes first
    start_s: float = 60.0  # until it has started
    lived_s: float = 5.0  # a process that lived shorter is not restarted
    end_s: float = 2.0  # for a page to close its viewers
    disk_s: float = 12.0  # for a recording to be written

    # --- shared memory
    memory_bytes: int = 24 << 20  # for messages under way
    packet_bytes: int = 1 << 16  # largest packet without arrays

    # --- what viewers ask for
    command_s: float = 2.0  # for a command that runs between two frames
    tare_s: float = 10.0  # for a tare
    # The worker waits for the answer longer than the loop does, so that a late one is not lost.
    command_answer_s: float = 5.0
    tare_answer_s: float = 12.0

    # --- what goes to and from it
    recent_n: int = 256  # samples between two pictures; a slow viewer loses the older ones
    show_s: float = 0.9 / 30.0  # between two pictures
    keepalive_s: float = 0.1  # without a new result, the rest is sent this often
    report_s: float = 0.1  # least time between reports to the loop; only changes are reported
    drain_s: float = 5.0  # for messages under way when a recording ends


PARAMS = WorkerParams()
