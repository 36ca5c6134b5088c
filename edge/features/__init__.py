"""Touch features from pin positions, cell areas and the rest frame.

    extract               what a demand needs; the order of the steps, in one call a frame
    contact_detector      is the tip in contact? if not, nothing further is computed
    pin_motion            motion since rest, pins in the contact, torsion, noise of a pin; areas, volume
    slip_and_vibration    slip and vibration of the pins in the contact, from frame to frame
    modes                 the motion as polynomial coefficients that turn with the tip
    surface               the grid over the tip, and the constant matrices onto it (`contact_field`)
    contact_field         a frame's fields on that grid, and their peaks
    contacts              which peaks make one contact; its axes; its place, by the pins round it; moments
      several             what fits of a few contacts decide; can be left out
    params                every chosen number

The modules of this package are one stage and may import each other.
"""

from edge.features.extract import FeatureExtractor, FeaturePlan
from edge.features.modes import MODE_NAMES, Modes
from edge.features.several import Fits

__all__ = ["MODE_NAMES", "FeatureExtractor", "FeaturePlan", "Fits", "Modes"]
