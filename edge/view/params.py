"""Every chosen number of the pictures; the evidence for each is in docs/tuning.md, "Pictures"."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ViewParams:
    """Parameters by name. Units: rel, a share; gain, times as long as the motion; px."""

    # --- colours of the cells
    full_change: float = 0.5  # area change that gets the full colour
    # --- vectors
    local_gain: float = 2.0  # of each pin's motion
    global_gain: float = 6.0  # of the mean motion, which is small beside the largest
    # --- camera image on the live page
    jpeg_quality: int = 80
    side_max_px: int = 720


PARAMS = ViewParams()
