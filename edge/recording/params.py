"""Every chosen number of recordings; the evidence for each is in docs/tuning.md, "Recording"."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class RecordingParams:
    """Parameters by name. Units: s, seconds; n, items."""

    # --- writing
    chunk_age_s: float = 0.5  # a chunk of the file is closed at this age, or full: a kill costs so much
    item_bytes: int = 512  # memory of a queued message without its arrays, roughly


PARAMS = RecordingParams()
