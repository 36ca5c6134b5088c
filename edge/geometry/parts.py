"""Parts of one skin that the image shows apart from each other, as mirrors do: each is as a tip of its own.

Two views of one touch move differently, and no cell reaches from one view into the next. So the stages know
one part alone; `edge.frame` lets them do each, and `edge.views` joins what comes of it in the rows of the
whole.
"""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from edge.geometry.lattice import pitch_of
from edge.geometry.layout import circle_of
from edge.geometry.neighbours import nearest_of
from edge.types import Index, Mask, PinPattern, Pins, Rest, Tracks

T = TypeVar("T", bound=np.generic)
Table = TypeVar("Table")  # a dataclass of arrays of one length


def rows_of(table: Table, rows: NDArray[np.integer[Any]] | Mask) -> Table:
    """The chosen rows of all columns."""
    given: Any = table
    chosen: Table = type(given)(*(getattr(table, column.name)[rows] for column in fields(given)))
    return chosen


def stack(tables: Sequence[Table]) -> Table:
    """Several tables in one, one after the other."""
    given: Any = tables[0]
    columns = ([getattr(table, column.name) for table in tables] for column in fields(given))
    whole: Table = type(given)(*map(np.concatenate, columns))
    return whole


def parts_of(rest: Rest) -> list[tuple[Index, Rest]]:
    """Rows of the pins of each part, ascending, and its rest frame, with pitch and circle of its own pins."""
    part = rest.part
    if part is None:
        return [(np.arange(len(rest), dtype=np.int32), rest)]
    parts: list[tuple[Index, Rest]] = []
    for k in np.unique(part):
        rows = np.flatnonzero(part == k).astype(np.int32)
        pattern = replace(rest.views[k], on_surface=rest.pattern.on_surface)
        own = one_part(replace(rest, pattern=pattern), rows)
        since = one_part(replace(rest.since, pattern=pattern), rows) if rest.since else None
        parts.append((rows, replace(own, beside_img=rest.xy_img[part != k], since=since)))
    return parts


def one_part(rest: Rest, rows: Index | Mask) -> Rest:
    """A rest frame of these pins alone."""
    pins, p = rows_of(rest.pins, rows), rest.pattern
    centre_img, radius_px = circle_of(pins.xy_img, p.pin_radius_px)
    pitch_px, n = pitch_of(pins.xy_img), len(pins)
    return Rest(pins, replace(p, pitch_px=pitch_px, centre_img=centre_img, tip_radius_px=radius_px, count=n))


def of_parts(rests: Sequence[Rest], pattern: PinPattern) -> Rest:
    """One rest frame of those of all parts; pattern: what they have in common."""
    pins = stack([rest.pins for rest in rests])
    part = np.repeat(np.arange(len(rests), dtype=np.int32), [len(rest) for rest in rests])
    whole = one_part(Rest(pins, pattern), np.ones(len(part), np.bool_))
    return replace(whole, part=part, views=tuple(rest.pattern for rest in rests))


def own_pins(pins: Pins, rest: Rest) -> Pins:
    """Those of one part: as no pin leaves its part, a blob belongs to that of the nearest pin at rest."""
    if rest.beside_img is None or len(pins) == 0:
        return pins
    away = (nearest_of(xy, pins.xy_img)[0][:, 0] for xy in (rest.xy_img, rest.beside_img))
    return rows_of(pins, np.less_equal(*away))


def tracks_of(tracks: Tracks, rows: Index) -> Tracks:
    """The tracks of these pins alone."""
    seen, t = tracks.seen[rows], tracks
    n_seen = int(np.count_nonzero(seen))
    return Tracks(t.xy_img[rows], t.sigma_px[rows], seen, n_seen, t.confidence, t.autocorrelation)


def tracks_joined(rows: Sequence[Index], of_parts: Sequence[Tracks]) -> Tracks:
    """The tracks of all parts, as certain as the least certain one."""
    columns = zip(*((t.xy_img, t.sigma_px, t.seen) for t in of_parts), strict=True)
    xy_img, sigma_px, seen = (joined(rows, column) for column in columns)
    return Tracks.of(xy_img, sigma_px, seen, min(t.confidence for t in of_parts))


def pins_joined(rows: Sequence[Index], of_parts: Sequence[Pins]) -> Pins:
    """The pins of all parts."""
    return rows_of(stack(of_parts), np.argsort(np.concatenate(rows)))


def joined(rows: Sequence[Index], of_parts: Sequence[NDArray[T]]) -> NDArray[T]:
    """What each part has of its pins, in the rows of the whole."""
    whole = np.concatenate(of_parts)
    whole[np.concatenate(rows)] = whole.copy()
    return whole
