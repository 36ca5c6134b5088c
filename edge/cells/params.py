"""Every chosen number of this stage; the evidence for each is in docs/tuning.md, "Cells"."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CellsParams:
    """Parameters by name. Units: pitches of the pins; rel, a share."""

    ball_pitches: float = 3.0  # radius of the ball that rolls round the pins
    step_pitches: float = 0.7  # largest distance of boundary points along an arc


PARAMS = CellsParams()
