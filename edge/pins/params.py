"""Every chosen number of this stage; the evidence for each is in docs/tuning.md, "Pins"."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PinParams:
    """Parameters by name; lengths in px, or in units of the pin's radius, the pitch, the image's side."""

    # --- full-frame search: scales
    search_radius_min_px: float = 1.7  # smallest disc that has an inside
    search_radius_max_side: float = 1 / 22  # largest disc, of the image's shorter side
    search_radius_step: float = 1.3  # ratio of one scale to the next
    scale_range: tuple[float, float] = (0.7, 1.4)  # radii that one scale sees well, ratios to it
    reduced_radius_px: float = 2.5  # a pin's radius in the reduced image that is searched
    unlike_pins_max: float = 1.15  # unevenness of the neighbours plus the variation that discs do not explain
    depth_min_pins: float = 0.3  # a spot's depth, of the pins' median depth
    # --- shape of a single spot, along rays
    ray_step_radii: float = 0.25  # a ray is read in such steps, ...
    ray_steps_n: int = 10  # ... so many, from 0 on
    ray_spread_max: float = 0.6  # 20..80 percentile range of the distance of the half fall over its median
    gap_ray_spread_max: float = 1.5  # the same for a spot that fills a gap of the pattern
    # --- against the neighbours: log ratios of size, depth and spacing
    scatter_min: tuple[float, float, float] = (0.08, 0.13, 0.13)  # bounds of the tip's own scatter
    scatter_max: tuple[float, float, float] = (0.11, 0.20, 0.20)
    outlier_max_outside: float = 9.0  # outside of the hull of what is connected
    link_pitches_outside: float = 1.9  # to the nearest pin, of one outside or beyond the known edge
    gap_pitches_min: float = 0.8  # from a pin to the nearest; nearer than this, two spots may be one
    # --- pins that a border cuts
    cut_area_range: tuple[float, float] = (0.12, 1.05)  # share of the disc that is left
    cut_facing_min: float = 0.4  # cosine between the arc's slope and straight outwards
    # --- rest frame
    rest_gap_radii: float = 0.5  # from a pin's centre to the image's border, pin radii
    steady_radii: float = 0.1  # images are of one place if four of five pins moved less beyond their noise
    # --- centroids in the windows of known pins
    steps_max: int = 8  # of the fit, from the prediction
    near_phases: float = 0.75  # a step shorter than this share of a subpixel phase is the last
    radius_kind_step: float = 1.05  # ratio of one template's radius to the next
    # A pin has this share at least: of its window's variation, explained by the disc; of the disc, at the
    # image's border; of its brightness at rest, after the common gain; of the neighbours', where cut
    pin_share_min: float = 0.25
    # A spot nearer than this is the pin predicted; an arc nearer than this is of the same pin, or housing
    own_pitches: float = 0.6


PARAMS = PinParams()
