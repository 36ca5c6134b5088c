"""Every chosen number of this stage; the evidence for each is in docs/tuning.md, "Cells"."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CellsParams:
    """Parameters by name. Units: pitches of the pins; rel, a share."""

    boundary_pitches: float = 1.0  # of the boundary points from the rim pins: rim cells end half a pitch out
    ball_pitches: float = 3.0  # radius of the ball that rolls round the pins
    step_pitches: float = 0.7  # largest distance of boundary points along an arc
    fence_pitches: float = 2.5  # of the fence from the farthest boundary point, and between its points
    rim_reach_pitches: float = (
        1.0  # Gaussian sigma: how far along the boundary a rim pin's own motion reaches
    )
    guard_reach: float = 16.0  # of the guard points from the middle, in half-widths of the point set
    collapsed_rel: float = 1e-6  # area of all cells over that at rest: the pins fell onto a line or a point


PARAMS = CellsParams()
