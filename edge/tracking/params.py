"""Every chosen number of this stage; the evidence for each is in docs/tuning.md, "Tracking"."""

from __future__ import annotations

from dataclasses import dataclass


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
    residual_max: float = 0.5
    innovation_max: float = 0.25  # change of the residual from one frame to the next
    innovation_max_lost: float = 0.35  # the same of a pin that was lost
    near_seen_min: float = 0.5  # share of a lost pin's nearest that must be seen for it to return
    # --- photometric outliers: brightness or centroid sigma unlike the pin's own
    brightness_sigmas: float = 4.0  # robust sigmas of the frame, from the gain that all pins share
    brightness_change_min: float = 0.03  # ... and at least this share
    sigma_ratio_max: float = 2.0  # to the frame's median, times the pin's own ratio at rest
    outlier_residual_max: float = 0.005  # of such a pin while it is followed
    outlier_residual_max_search: float = 0.04  # ... and after a search
    outlier_residual_ratio: float = 4.0  # ... or this many times what two thirds of its neighbours show
    # --- whether the identities are held
    median_innovation_max: float = (
        0.35  # motion that was not predicted: as near to the next pin as to the own
    )
    seen_share_min: float = 0.4
    baseline_share_min: float = 0.65  # of the baseline: the share seen lately
    baseline_frames: float = 30.0  # time constant of the baseline, frames
    full_share_min: float = 0.85  # of the largest share that a search found; less is searched again ...
    research_frames: int = 60  # ... every so many frames
    leap_innovation: float = 0.1  # so much innovation with fewer than this share of the baseline is a leap
    leap_share_min: float = 0.95
    # --- coarse fits
    schedule: tuple[tuple[int, float], ...] = (
        (1, 0.6), (1, 0.5), (2, 0.5), (2, 0.45), (3, 0.4), (3, 0.4), (4, 0.35), (4, 0.35)
    )  # degree of the polynomial and gate of each round  # fmt: skip
    schedule_reach: float = 2.5  # gates; blobs further away have no weight
    prune_round: int = 3  # round of the schedule after which only the best starts go on
    pruned_n: int = 8
    start_step: float = 0.5  # pitches between the shifts to start from, on a hexagonal grid ...
    start_rings: int = 2  # ... of so many rings
    # --- search
    blobs_min: int = 4  # fewer are not searched: an affine motion needs three, and one more checks it
    coarse_tried_n: int = 5  # coarse fits that are tried
    regions_max: int = 16  # matches grown in all, alternatives included: half a millisecond each
    sweeps_max: int = 24
    region_gate: float = 0.38  # from a pin's prediction to its blob
    seam: float = 0.35  # difference in motion beyond which two neighbours are not linked
    bridge_seam: float = 0.5  # the same for pins further apart, at most
    bridged_n: int = 2  # coarse fits whose largest piece may reach over gaps ...
    bridge_gain_min: float = 1.2  # ... where that makes it so many times as large
    agree: float = 0.22  # difference in motion of a pin and the mean of its neighbours
    raster_px: float = 2.0  # cell of the nearest-blob table
    # --- posterior of a match
    shift_spread: float = 0.5  # pitches; standard deviation of a tip's mean motion
    rotation_spread: float = 0.2  # pitches; of its mean motion around the centre
    found_weights: tuple[float, float, float, float] = (9.7, -4.0, -15.0, 1.5)  # of `search.found_evidence`
    # --- which blob each pin has for certain
    posterior_min: float = 0.98  # that a pin has its blob; that a match is right, which ends a search
    scale_freedom: float = 4.0  # pins that the roughness of the whole frame counts as, beside those near
    slip_spread: float = 0.03  # pitches; beyond this standard deviation a step of a pitch may go unnoticed
    slip_spread_hidden: float = 0.06  # ... where but one sign of a slip is seen
    assign_rounds: int = 6  # of predicting and assigning, at most
