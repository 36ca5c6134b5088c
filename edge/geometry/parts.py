"""Parts of one skin that the image shows apart from each other, as mirrors do: each is as a tip of its own.

Two views of one touch move differently, and no cell reaches from one view into the next. So tracking, cells
and features have a file `regions.py`: it lets the stage of one tip do each part, and joins what comes of them
in the rows of the whole. Where there is one part nothing of that runs.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from edge.geometry.lattice import pitch_of
from edge.geometry.layout import circle_of
from edge.types import Index, Mask, Pins, Rest, Tracks

T = TypeVar("T", bound=np.generic)


def parts_of(rest: Rest) -> list[tuple[Index, Rest]]:
    """Rows of the pins of each part, ascending, and its rest frame, with pitch and circle of its own pins."""
    part = rest.part
    if part is None:
        return [(np.arange(len(rest), dtype=np.int32), rest)]
    rows = [np.flatnonzero(part == k).astype(np.int32) for k in np.unique(part)]
    return [(own, one_part(replace(rest, pattern=rest.views[part[own[0]]]), own)) for own in rows]


def one_part(rest: Rest, rows: Index | Mask) -> Rest:
    """A rest frame of these pins alone."""
    pins, p = pins_of(rest.pins, rows), rest.pattern
    centre_img, radius_px = circle_of(pins.xy_img, p.pin_radius_px)
    pitch_px, n = pitch_of(pins.xy_img), len(pins)
    return Rest(pins, replace(p, pitch_px=pitch_px, centre_img=centre_img, tip_radius_px=radius_px, count=n))


def pins_of(pins: Pins, rows: Index | Mask) -> Pins:
    """These pins alone."""
    return Pins(pins.xy_img[rows], pins.sigma_px[rows], pins.radius_px[rows], pins.brightness[rows])


def tracks_of(tracks: Tracks, rows: Index) -> Tracks:
    """The tracks of these pins alone."""
    seen, t = tracks.seen[rows], tracks
    n_seen = int(np.count_nonzero(seen))
    return Tracks(t.xy_img[rows], t.sigma_px[rows], seen, n_seen, t.confidence, t.autocorrelation)


def joined(rows: Sequence[Index], of_parts: Sequence[NDArray[T]]) -> NDArray[T]:
    """What each part has of its pins, in the rows of the whole."""
    whole = np.concatenate(of_parts)
    whole[np.concatenate(rows)] = whole.copy()
    return whole
