"""Every chosen number of this stage; the evidence for each is in docs/tuning.md, "Features"."""

from dataclasses import dataclass
from math import log, pi, sqrt

from edge.params import PARAMS as RUNTIME

#: Relative noise of a cell's area, and of the mean over a pin and its six neighbours, per pin noise in
#: pitches, on a hexagonal lattice to first order. A pin that moves outwards by d moves the side of length
#: 1 / sqrt(3) that it shares with a neighbour's cell by d / 2; neighbours' noise cancels in the mean.
CELL_NOISE = (2.0 / 3.0) ** 0.5
RING_NOISE = 4.0 / (7.0 * 3.0**0.5)
#: Noise of a median over that of a mean, of normal noise.
MEDIAN_NOISE = (0.5 * pi) ** 0.5

#: The size of the tables of contacts: as many as a sample can count.
CONTACTS_MAX = 14


def largest_noise(n: int) -> float:
    """The level that n values of normal noise hardly exceed, in standard deviations: one among n passes
    `hypot(a, largest_noise(n))` as rarely as a single one passes a.

    Source  Donoho and Johnstone, "Ideal spatial adaptation by wavelet shrinkage", Biometrika 81, 1994
    """
    return sqrt(2.0 * log(n))


@dataclass(frozen=True, slots=True)
class FeatureParams:
    """Parameters by name. Units: sigma, standard deviations of noise; rel, a share; pitch; n, a number."""

    # --- contact: a ring's mean area change, a cell's, a height, a motion
    contact_sigma: float = RUNTIME.noise_sigma
    noise_ratio_max: float = 3.0  # learnt noise over predicted noise, and its inverse
    noise_frames_n: int = 64  # untouched frames over which the noise is learnt
    min_area_change: float = 0.01  # smallest relative area change beyond drift of brightness and focus

    # --- grid of the surface
    grid_steps_per_pitch: float = 1.5
    grid_min: int = 24  # points along a side

    # --- contacts: peaks of the contact field, merged
    divergence_rel: float = 0.7  # share of the divergence in the contact field; the rest is the surface
    shallow_rel: float = 0.3  # of a peak: what is lower is outside of its contact, a valley less deep is none
    min_oriented_elongation: float = 1.5  # ratio of the axes above which a direction is given
    place_radius_pitch: float = 2.0  # pins within this radius of the middle make a contact's place
    place_radius_axis: float = 1.25  # ... or within so many semi-axes, where that is more

    # --- contacts fitted to the pins' motion: one or two?
    close_pitch: float = 2.5  # closer contacts may be one region; a contact's surroundings

    # --- slip
    slip_prior_odds: float = 40.0  # against more than a third of the contact sliding
    slip_span_frames: int = 4  # over which motion is taken
    slip_pressing_rel: float = 0.7  # net over total area change; above it the contact is pressed or released

    # --- vibration
    vibration_from_hz: float = 10.0  # slower motion is shear


PARAMS = FeatureParams()
