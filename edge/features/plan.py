"""What is computed of a frame for a demand: `NEEDS` maps each feature to the quantities that it needs."""

from __future__ import annotations

from enum import StrEnum

from edge.features.several import Fits
from edge.types import Feature

__all__ = ["NEEDS", "FeaturePlan", "Quantity"]


class Quantity(StrEnum):
    """What can be computed, as opposed to what can be demanded."""

    SHEAR = "shear"
    MODES = "modes"
    VOLUME = "volume"
    SURFACE = "surface"
    CONTACTS = "contacts"
    TORSION = "torsion"
    SLIP = "slip"
    VIBRATION = "vibration"


NEEDS: dict[Feature, frozenset[Quantity]] = {
    feature: frozenset(map(Quantity, feature.needs)) for feature in Feature
}


class FeaturePlan:
    """What is computed of a frame for a demand: `NEEDS`, resolved once.

    moments        False: the contacts' moments are not wanted; they are NaN
    fits           the contacts that are wanted as fitted to the pins' motion
    modes_at_rest  False: modes are not wanted of an untouched tip
    """

    def __init__(
        self,
        demand: frozenset[Feature],
        *,
        moments: bool = True,
        fits: Fits = Fits.ALL,
        modes_at_rest: bool = True,
    ) -> None:
        self.needs: frozenset[Quantity] = frozenset().union(*(NEEDS[feature] for feature in demand))
        self.moments, self.fits, self.modes_at_rest = moments, fits, modes_at_rest
