"""Which pin is which: identity against the rest frame, kept from frame to frame, found again after a jump.

    Pins, one row a pin --follow--> Tracks        steady state: nearest neighbour with prediction
    Pins, unordered  --identify--> Tracks         start-up, jump, after dark frames: no prior needed

tracker    the state between frames, and whether the identities are held
follow     which followed pins are seen (a kernel), without the photometric outliers (`outliers`, a kernel)
search     identities after a jump: `coarse` fits, matches grown from them (`match`, a kernel)
hypothesis the posterior of a match, by the motion's prior (`motion_model`), and which of its pins are certain
tip        what all of them share: the rest lattice and its local affine maps
params     all thresholds
"""

from edge.tracking.tracker import Tracker

__all__ = ["Tracker"]
