"""Every chosen number of the link; the evidence for each is in docs/tuning.md, "Bus"."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LinkParams:
    """Parameters by name. Units: s, seconds; n, items; rel, a share."""

    # --- a medium that fails
    retry_s: float = 0.1  # between two attempts to open it
    stall_s: float = 0.06  # nothing leaves for this long: the link counts as down
    write_s: float = 0.2  # a medium that accepts nothing for this long is full
    close_s: float = 0.3  # for the queue, and again for the threads

    # --- send queue
    samples_n: int = 4  # older ones are not worth sending
    control_n: int = 256  # answers, also those that are kept for repetitions

    # --- a medium's data
    chunk_bytes: int = 4096  # read from a serial port at once
    noise_bytes: int = 4096  # without a zero: noise, longer than any frame

    # --- answers
    detail_rel: float = 0.3  # share of the link's time for the detail stream, at most
    errors_n: int = 8  # that object 0x1003 holds
    described_s: float = 0.1  # a description is made anew after this; each one costs the loop some time
    idle_s: float = 1.0  # a client that is silent for so long is gone: its transfer and repetitions, too

    # --- reading
    read_s: float = 0.05  # how soon a reader leaves a failed medium
    read_rel: float = 0.3  # share of a processor for reading
    read_window_s: float = 0.2  # over which that share is taken
    read_pause_s: float = 0.005  # shorter pauses cost more than they save


PARAMS = LinkParams()
