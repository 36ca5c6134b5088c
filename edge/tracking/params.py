"""Every chosen number of this stage; the evidence for each is in docs/tuning.md, "Tracking"."""

from dataclasses import dataclass

from edge.params import ASTRAY_REL


@dataclass(frozen=True, slots=True)
class TrackingParams:
    """Parameters by name. Lengths are in local pitches (a pin's distance to the next one) unless the name
    says px or the comment says pitches (the median of the tip); counts are pins, shares are of all pins.
    """

    # --- prediction from the neighbours
    gradient_ridge: float = 0.05  # on the local map's gradient, in neighbours' weights
    support_min: float = 1.2  # sum of the neighbours' weights that carries a prediction: two near ones
    velocity_damping: float = 0.7  # share of the last motion that is expected again
    # --- which followed pins are seen: residual = motion off the neighbours' map
    innovation_max: float = 0.25  # change of the residual from one frame to the next
    # --- photometric outliers: brightness or centroid sigma unlike the pin's own
    # Multiples of the scatter of the others: robust sigmas of the frame's brightness, from the gain that
    # all pins share; what two thirds of the neighbours are off by
    outlier_ratio: float = 4.0
    brightness_change_min: float = 0.03  # least change of brightness, as a share
    sigma_ratio_max: float = 2.0  # to the frame's median, times the pin's own ratio at rest
    outlier_residual_max: float = 0.005  # of such a pin
    # --- whether the identities are held
    baseline_share_min: float = 0.65  # of the baseline: the share seen lately
    baseline_frames: float = 30.0  # time constant of the baseline, frames
    leap_innovation: float = 0.1  # with fewer than all pins of the baseline: a leap
    # --- coarse fits, search
    gate: float = 0.33  # of a blob from a coarse fit; of neighbours' motions; of a tip's median innovation
    region_gate: float = 0.38  # of a blob from where matched neighbours predict it
    coarse_degrees: tuple[int, ...] = (1, 1, 2, 2, 3, 3, 4, 4)  # of the polynomial of each round
    coarse_n: int = 5  # fits that go on after the affine rounds, each to be tried
    # --- posterior of a match
    shift_spread: float = 0.5  # pitches; standard deviation of a tip's mean motion
    rotation_spread: float = 0.2  # pitches; of its mean motion around the centre
    found_weights: tuple[float, float, float, float] = (12.0, -4.0, -8.0, 1.6)  # of `search.found_evidence`
    # --- which blob each pin has for certain
    posterior_min: float = 0.98  # that a pin has its blob; that a match is right, which ends a search
    scale_freedom: float = 4.0  # pins that the roughness of the whole frame counts as, beside those near
    # Pitches: beyond this standard deviation a step of a pitch may go unnoticed, beyond twice as much where
    # one of the two signs of a slip is not seen
    slip_spread: float = 0.03

    @property
    def full_share_min(self) -> float:
        """Share of the baseline, or of the largest that a search found, that counts as all pins."""
        return 1.0 - ASTRAY_REL
