"""Touch features from pin positions, cell areas and the rest frame.

    gate       is anything touching at all? nothing further is computed otherwise
    surface    area change of the pins -> smooth surface on a grid (one constant matrix); its volume
    contacts   regional maxima of the surface, merged into contact regions
    motion     shear, polynomial modes, torsion, slip
    extract    puts them together: only what the demand asks for

The modules of this package are one stage and may import each other.
"""

from edge.features.extract import FeatureExtractor
from edge.features.motion import MODE_TERMS

__all__ = ["MODE_TERMS", "FeatureExtractor"]
