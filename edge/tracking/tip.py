"""The stage's model of a tip: made once from the rest frame, shared by all its parts."""

import numpy as np

from edge.geometry.lattice import Lattice
from edge.tracking.outliers import LocalAffine, PhotometricFilter
from edge.tracking.params import TrackingParams
from edge.types import Array, Rest


class TrackedTip:
    """One tip at rest.

    rest         row i is pin i
    lattice      its places, pitches and neighbours
    affine       the motion that near pins predict for each pin
    photometric  rejects pins whose brightness or sigma is unlike their own at rest
    radial       (n, 2) unit vectors away from the tip's centre
    tangential   (n, 2) unit vectors around it
    """

    def __init__(self, rest: Rest) -> None:
        """Raises DegenerateLayout: fewer than 4 pins at rest, or all on a line."""
        self.rest, self.params = rest, TrackingParams()
        self.lattice = Lattice(rest.xy_img, rest.pattern.pitch_px)
        self.affine = LocalAffine(self.lattice, self.params.gradient_ridge)
        self.photometric = PhotometricFilter(self.affine, rest.pins, self.lattice.local_pitch_px, self.params)
        out = rest.xy_img - rest.pattern.centre_img
        self.radial: Array = out / np.maximum(np.hypot(*out.T), 1e-9)[:, None]
        self.tangential: Array = np.stack([-self.radial[:, 1], self.radial[:, 0]], axis=1)

    def __len__(self) -> int:
        return len(self.rest)
