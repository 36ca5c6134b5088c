"""The untouched tip, from frames of which none shows it: the pins' places extrapolated to no load.

    place of a pin = place at rest + load (a + B . rest of the truth)

The truth of each frame is known: its load (depth, or force), shear, tilt and so on. Without load none of the
others has an effect, so that each of them comes multiplied by it. What the formula leaves out begins with the
square of the load, which is therefore the scale of its error: shallow frames count most, deep ones little.

That gives the smooth part of the pins' places, of which the modes of motion are capable. By how much a pin
deviates from its neighbours is not extrapolated, which would amplify noise: it is the same with load and
without, so that the mean over the frames is taken, with the same weights.

The estimate is better than the least deformed frame, whose own shear and tilt would be in every value later.
Here they cancel; what remains is nearly the same all round.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import cv2
import numpy as np

from edge.features.modes import MODE_POWERS
from edge.geometry.lattice import pitch_of
from edge.geometry.parts import own_pins
from edge.pins import detect
from edge.tracking import Tracker
from edge.types import Array, Image, Rest, Tracks

__all__ = ["LOADS", "UnloadedParams", "load_of", "unloaded"]

#: Values that say how hard the tip is pressed; the first that a table has is taken.
LOADS = ("displacement_mm", "force_n")


@dataclass(frozen=True, slots=True)
class UnloadedParams:
    """Parameters of the estimate; evidence in docs/tuning.md, "Rest frame".

    frames_min    with fewer there is no estimate
    frames_terms  frames for each unknown of a pin: with fewer the rest of the truth is not used
    reach         of the span of the loads: how far below the least of them no load may be
    """

    frames_min: int = 12
    frames_terms: int = 4
    reach: float = 5.0


PARAMS = UnloadedParams()


def load_of(values: Mapping[str, Array]) -> Array | None:
    """(n,) how hard the tip is pressed in each frame; None: the table does not say."""
    return next((values[name] for name in LOADS if name in values), None)


def unloaded(
    rest: Rest, images: Iterable[Image], values: Mapping[str, Array], params: UnloadedParams = PARAMS
) -> Rest | None:
    """The rest frame with its pins where they would be without load.

    rest    of one of the images, to identify the pins
    values  truth by name, (n,) of each image
    Returns None: the table has no load, too few frames show the pins, or no load is too far from them all
    """
    load = load_of(values)
    if load is None:
        return None
    tracker = Tracker(rest)
    places = np.full((len(load), len(rest), 2), np.nan)
    for k, image in enumerate(images):
        tracks = tracker.identify(own_pins(detect(image, rest.pattern), rest))
        if tracks.confidence >= Tracks.LOW_CONFIDENCE:
            places[k] = tracks.xy_img
    known = np.isfinite(places).any(axis=(1, 2)) & (load > 0)
    if known.sum() < params.frames_min or load[known].min() > params.reach * np.ptp(load[known]):
        return None
    xy = _at_no_load(places[known], load[known], _others(values, known, params))
    mean = _mean(places[known], load[known])
    xy = np.where(np.isfinite(xy), xy, rest.xy_img)
    mean = np.where(np.isfinite(mean), mean, xy)
    xy = mean + _smooth(xy - mean, rest)
    (x, y), reach = cv2.minEnclosingCircle(xy.astype(np.float32))
    pattern = replace(
        rest.pattern,
        pitch_px=pitch_of(xy),
        centre_img=np.array([x, y]),
        tip_radius_px=float(reach) + rest.pattern.pin_radius_px,
    )
    return Rest(replace(rest.pins, xy_img=xy), pattern)


def _others(values: Mapping[str, Array], known: Array, params: UnloadedParams) -> Array:
    """(n, k) the rest of the truth, columns with mean 0 and deviation 1; none if the frames are too few."""
    columns = [v[known] for name, v in values.items() if name not in LOADS and np.isfinite(v[known]).all()]
    columns = [(c - c.mean()) / c.std() for c in columns if c.std() > 0]
    n = int(known.sum())
    if n < params.frames_terms * (2 + len(columns)):
        columns = []
    return np.column_stack(columns) if columns else np.empty((n, 0))


def _mean(places: Array, load: Array) -> Array:
    """(pins, 2) NaN: a pin is seen in no frame."""
    weight = np.where(np.isfinite(places[:, :, :1]), load[:, None, None] ** -2.0, 0.0)
    total = weight.sum(axis=0)
    mean = np.nansum(weight * places, axis=0) / np.where(total > 0, total, 1.0)
    return np.asarray(np.where(total > 0, mean, np.nan))


def _smooth(motion: Array, rest: Rest) -> Array:
    """(pins, 2) what the modes of motion make of it."""
    z = np.asarray((rest.xy_img - rest.pattern.centre_img) / rest.pattern.tip_radius_px @ (1, 1j))
    modes = np.column_stack([z**a * z.conj() ** b for a, b in MODE_POWERS])
    w = modes @ np.linalg.lstsq(modes, motion @ (1, 1j), rcond=None)[0]
    return np.column_stack([w.real, w.imag])


def _at_no_load(places: Array, load: Array, others: Array) -> Array:
    """(pins, 2) NaN: a pin is seen too rarely."""
    design = np.column_stack([np.ones_like(load), load, load[:, None] * others]) / load[:, None] ** 2
    observed = places / load[:, None, None] ** 2
    found = np.full(places.shape[1:], np.nan)
    for pin in range(places.shape[1]):
        seen = np.isfinite(observed[:, pin, 0])
        if seen.sum() > design.shape[1]:
            found[pin] = np.linalg.lstsq(design[seen], observed[seen, pin], rcond=None)[0][0]
    return found
