"""Every chosen number of the pictures; the evidence for each is in docs/tuning.md, "Pictures"."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ViewParams:
    """Parameters by name. Units: rel, a share; gain, times as long as the motion; px; in, inches."""

    # --- colours of the cells
    full_change: float = 0.5  # area change that gets the full colour
    change_exponent: float = 0.7  # of an area change; below 1 it emphasises small ones, where a touch begins
    # --- vectors
    local_gain: float = 2.0  # of each pin's motion
    global_gain: float = 6.0  # of the mean motion, which is small beside the largest
    # --- figures for print
    surface_box: tuple[float, float, float, float] = (-0.05, -0.02, 1.0, 1.1)  # left, bottom, width, height;
    # of the figure: the surface fills it, with space for the label of z
    # --- camera image on the live page
    jpeg_quality: int = 80
    side_max_px: int = 720


PARAMS = ViewParams()
