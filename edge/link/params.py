"""Every chosen number of the link; the evidence for each is in docs/tuning.md, "Bus"."""

from dataclasses import dataclass

from edge.params import PARAMS as RUNTIME
from hostlink.wire.e2e import P5_COUNTERS


@dataclass(frozen=True, slots=True)
class LinkParams:
    """Parameters by name. Units: s, seconds; n, items; rel, a share."""

    # --- a medium that fails
    retry_s: float = RUNTIME.announced_s
    stall_s: float = RUNTIME.stall_s  # nothing leaves for this long: the link counts as down
    check_s: float = RUNTIME.check_s  # between looks at the link and at the device, which cost the loop time
    write_s: float = 0.2  # a medium that accepts nothing for this long is full
    close_s: float = RUNTIME.close_s  # for the queue, and again for the threads

    # --- send queue
    samples_n: int = 4  # older ones are not worth sending
    control_n: int = P5_COUNTERS  # answers that wait or are known: no two have the same counter

    # --- answers
    spaced_rel: float = 0.3  # share of the link's time for detail, and for block transfers, at most
    idle_s: float = RUNTIME.patience_s  # a client that is silent for so long is gone, and its transfer

    # --- reading
    read_s: float = RUNTIME.wait_s  # how soon a reader leaves a failed medium
    read_rel: float = 0.3  # share of a processor for reading
    read_pause_s: float = RUNTIME.wait_s  # shorter pauses cost more than they save

    @property
    def repeat_s(self) -> float:
        """A numbered request within this after an equal one is the same: hosts ask three times, in 1.5 s."""
        return 2.0 * self.idle_s


PARAMS = LinkParams()
