"""Every chosen number of recordings; the evidence for each is in docs/tuning.md, "Recording"."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class RecordingParams:
    """Parameters by name. Units: s, seconds; n, items."""

    # --- writing
    chunk_bytes: int = 1 << 20  # a chunk of the file is closed when it holds so much
    chunk_age_s: float = 0.5  # ... or is so old: a kill costs at most this
    item_bytes: int = 512  # memory of a queued message without its arrays, roughly
    slow_disk_s: float = 1.0  # so long without loss, and the disk counts as fast enough again
    overlay_hz: float = 15.0  # annotations are for viewing only

    # --- reading
    rate_frames_n: int = 16  # intervals that the rate is measured from if the file does not state it


PARAMS = RecordingParams()
