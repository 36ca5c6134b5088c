"""Which pin is which: identity against the rest frame, kept from frame to frame, found again after a jump.

    Pins, one row a pin --follow--> Tracks        steady state: nearest neighbour with prediction
    Pins, unordered  --identify--> Tracks         start-up, jump, after the dark: no prior needed

`field` holds the geometry of the rest lattice (who is whose neighbour, smooth motion fields over it),
`identity` the search after a jump, `tracker` the state between frames.
"""

from edge.track.tracker import Tracker

__all__ = ["Tracker"]
