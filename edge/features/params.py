"""Every chosen number of this stage; the evidence for each is in docs/tuning.md, "Features"."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class FeatureParams:
    """Parameters by name. Units: sigma, in standard deviations of the noise; rel, a share; pitch, in pin
    pitches.
    """

    # --- contact detector: is the tip in contact?
    cell_noise: float = 0.83  # relative noise of a cell's area, per pin noise in pitches
    ring_noise: float = 0.33  # ... of the mean over a pin and its six neighbours
    median_noise: float = 1.25  # noise of a median over that of a mean
    raise_sigma: float = 6.0  # a contact begins above this mean area change of a ring
    clear_sigma: float = 5.0  # ... and ends below this one
    coherent_peak_rel: float = (
        5.0 / 6.0
    )  # share of that limit that remains with ring medians, where it is highest
    coherent_any_rel: float = 1.0  # ... or anywhere
    min_ring_known: int = 4  # pins of a ring that must be known for it to count
    noise_ratio_max: float = 3.0  # learnt noise over predicted noise, and its inverse
    noise_learning_rate: float = 1.0 / 64.0  # weight of one untouched frame in the learnt noise

    # --- thresholds within a contact
    contact_sigma: float = 5.0  # a peak, or a compressed pin, counts above this
    volume_sigma: float = 3.0  # heights below this are left out of the volume
    min_area_change: float = 0.01  # smallest relative area change beyond drift of brightness and focus
    fill_min_seen_rel: float = 0.5  # share of the pins that must be seen for the others to be predicted

    # --- grid of the surface
    grid_steps_per_pitch: float = 1.5
    grid_min: int = 24  # points along a side
    grid_max: int = 64

    # --- contacts: peaks of the contact field, merged
    divergence_rel: float = 0.7  # share of the divergence in the contact field; the rest is the surface
    min_prominence_rel: float = 0.35  # depth of the valley that separates two contacts, of the lower peak
    min_prominence_sigma: float = 10.0  # ... of the pins' noise
    region_level_rel: float = 0.3  # a contact's region is what lies above this share of its peak
    peaks_max: int = 24  # of the contact field that are kept, the highest
    contacts_max: int = 8
    visibility_radius_pitch: float = 2.5  # radius round a contact's middle in which pins are counted
    min_visible_rel: float = 0.4  # share of them that must be seen for a second contact
    min_oriented_elongation: float = 1.5  # ratio of the axes above which a direction is given
    place_radius_pitch: float = 2.0  # pins within this radius of the middle make a contact's place
    place_radius_axis: float = 1.25  # ... or within this many semi-axes, if that is more

    # --- sharper field: one long contact, or two close ones?
    split_max_pitch: float = 3.0  # long semi-axis of the regions that are tested, distance of the two peaks
    split_steps_per_pitch: float = 2.5  # of its grid

    # --- modes
    modes_ridge: float = 1e-3  # of the normal equations, pins: keeps high terms bounded when pins are lost

    # --- slip
    slip_model_rel: float = 0.03  # error of Mindlin's curve, of the motion around the contact
    slip_prior_odds: float = 10.0  # against more than half of the contact sliding
    slip_span_frames: int = 4  # over which motion is taken
    slip_pressing_rel: float = 0.7  # net over total area change; above it the contact is pressed or released


PARAMS = FeatureParams()
