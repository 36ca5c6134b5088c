"""Touch features from pin positions, cell areas and the rest frame.

    gate       is anything touching at all? nothing further is computed otherwise
    surface    area change of the pins -> smooth surface on a grid (one constant matrix); its volume
    contacts   regional maxima of the surface, merged into contact regions
    modes      the motion as polynomial coefficients that turn with the tip
    motion     shear, torsion, slip
    extract    puts them together: only what the demand asks for

The modules of this package are one stage and may import each other.
"""

from edge.features.extract import FeatureExtractor
from edge.features.modes import MODE_NAMES

__all__ = ["MODE_NAMES", "FeatureExtractor"]
