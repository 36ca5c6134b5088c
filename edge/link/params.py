"""Every chosen number of the link; the evidence for each is in docs/tuning.md, "Bus"."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["PARAMS", "LinkParams"]


@dataclass(frozen=True, slots=True)
class LinkParams:
    """Parameters by name. Units: s, seconds; n, items; rel, a share."""

    # --- a medium that fails
    retry_s: float = 0.1  # between two attempts to open it
    stall_s: float = 0.06  # nothing leaves for this long: the link is down, whatever the medium says
    write_s: float = 0.2  # a medium that takes nothing for this long is full
    close_s: float = 0.3  # for what still waits to be sent, and again for the threads

    # --- what waits to be sent
    samples_n: int = 4  # older ones are not worth sending
    control_n: int = 256  # answers

    # --- reading
    read_s: float = 0.05  # how soon a reader leaves a failed medium
    read_rel: float = 0.3  # of a processor that reading may take
    read_window_s: float = 0.2  # over which that share is taken
    read_pause_s: float = 0.005  # shorter pauses cost more than they save


PARAMS = LinkParams()
