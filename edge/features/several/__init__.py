"""Fits of several contacts, and of bars, to the pins' motion; `[features] several = false` leaves them out.

Without them each region of compressed skin is one contact: two that touch the same region are one, the place
and depth of one beside another are off by what the other moves, and a bar has the direction of its region.

Dots on the skin's surface have no such regions: `dots` finds their contacts by fits alone.
"""

from edge.features.several.dots import DotContacts
from edge.features.several.fitted_contacts import Fits, FittedContacts

__all__ = ["DotContacts", "Fits", "FittedContacts"]
