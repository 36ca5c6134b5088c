"""The stage's model of a tip: made once from the rest frame, shared by all its parts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from edge.geometry.lattice import Lattice
from edge.tracking.outliers import LocalAffine, PhotometricFilter
from edge.tracking.params import TrackingParams
from edge.types import Array, Rest


@dataclass(frozen=True, slots=True)
class TrackedTip:
    """One tip at rest.

    rest         row i is pin i
    lattice      its places, pitches and neighbours
    affine       the motion that near pins predict for each pin
    photometric  rejects pins whose brightness or sigma is unlike their own at rest
    radial       (n, 2) unit vectors away from the tip's centre
    tangential   (n, 2) unit vectors around it
    """

    params: TrackingParams
    rest: Rest
    lattice: Lattice
    affine: LocalAffine
    photometric: PhotometricFilter
    radial: Array
    tangential: Array

    @classmethod
    def of(cls, rest: Rest, params: TrackingParams | None = None) -> TrackedTip:
        """Raises DegenerateLayout: fewer than 4 pins at rest, or all on a line."""
        params = params or TrackingParams()
        lattice = Lattice(rest.xy_img, rest.pattern.pitch_px)
        affine = LocalAffine(lattice, params.gradient_ridge)
        out = rest.xy_img - rest.pattern.centre_img
        radial = out / np.maximum(np.hypot(*out.T), 1e-9)[:, None]
        tangential = np.stack([-radial[:, 1], radial[:, 0]], axis=1)
        photometric = PhotometricFilter(affine, rest.pins, lattice.local_pitch_px, params)
        return cls(params, rest, lattice, affine, photometric, radial, tangential)

    def __len__(self) -> int:
        return len(self.rest)
