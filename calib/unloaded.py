"""The untouched tip, from frames of which none shows it: the pins' places extrapolated to no load.

    motion of the pins = motion of the rest frame's own + load (a + b . rest of the truth)

The motion is in modes. The truth of each frame is known: its load (depth, or force), shear, tilt and so on.
Without load none of the others has an effect, so that each of them comes multiplied by it, and each only in
the modes that turn as it does when tip and touch are turned together: ten frames are enough for the unknowns
that are left. What the formula leaves out begins with the square of the load, which is therefore the scale of
its error: shallow frames count most, deep ones little.

By how much a pin deviates from its neighbours is not extrapolated, which would amplify noise: it is the same
with load and without, so that the mean over the frames is taken, with the same weights.

The estimate is better than the least deformed frame, whose own shear and tilt would be in every value later.
Here they cancel; what remains is nearly the same all round.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from calib.designs import GROUPS
from calib.process_likelihood import Symmetry
from edge.features.modes import MODE_POWERS
from edge.geometry.lattice import pitch_of
from edge.geometry.parts import own_pins
from edge.pins import detect
from edge.tracking import Tracker
from edge.types import Array, Complex, Image, Rest, Tracks

__all__ = ["LOADS", "UnloadedParams", "load_of", "unloaded"]

#: Values that say how hard the tip is pressed; the first that a table has is taken.
LOADS = ("displacement_mm", "force_n")


@dataclass(frozen=True, slots=True)
class UnloadedParams:
    """Parameters of the estimate; evidence in docs/tuning.md, "Rest frame".

    frames_min  with fewer there is no estimate
    reach       of the span of the loads: how far below the least of them no load may be
    """

    frames_min: int = 8
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
    modes = _modes(rest)
    motion = np.array([_in_modes(modes, xy - rest.xy_img) for xy in places[known]])
    xy = rest.xy_img + _xy(modes @ _at_no_load(motion, load[known], {k: v[known] for k, v in values.items()}))
    mean = _mean(places[known], load[known])
    mean = np.where(np.isfinite(mean), mean, xy)
    xy = mean + _xy(modes @ _in_modes(modes, xy - mean))
    (x, y), reach = cv2.minEnclosingCircle(xy.astype(np.float32))
    pattern = replace(
        rest.pattern,
        pitch_px=pitch_of(xy),
        centre_img=np.array([x, y]),
        tip_radius_px=float(reach) + rest.pattern.pin_radius_px,
    )
    return Rest(replace(rest.pins, xy_img=xy), pattern)


def _mean(places: Array, load: Array) -> Array:
    """(pins, 2) NaN: a pin is seen in no frame."""
    weight = np.where(np.isfinite(places[:, :, :1]), load[:, None, None] ** -2.0, 0.0)
    total = weight.sum(axis=0)
    mean = np.nansum(weight * places, axis=0) / np.where(total > 0, total, 1.0)
    return np.asarray(np.where(total > 0, mean, np.nan))


def _modes(rest: Rest) -> Complex:
    """(pins, modes) complex128, the motion of each pin by a mode."""
    z = np.asarray((rest.xy_img - rest.pattern.centre_img) / rest.pattern.tip_radius_px @ (1, 1j))
    return np.column_stack([z**a * z.conj() ** b for a, b in MODE_POWERS])


def _in_modes(modes: Complex, motion: Array) -> Complex:
    """(modes,) of the motion (pins, 2), of the pins that it is known of."""
    seen = np.isfinite(motion[:, 0])
    return np.asarray(np.linalg.lstsq(modes[seen], motion[seen] @ (1, 1j), rcond=None)[0], np.complex128)


def _xy(motion: Complex) -> Array:
    return np.column_stack([motion.real, motion.imag])


def _at_no_load(motion: Complex, load: Array, values: Mapping[str, Array]) -> Complex:
    """(modes,) of the motion (frames, modes), whichever way each vector's axes lie in the image."""
    vectors: list[Complex] = []
    others: list[Any] = [np.ones_like(load)]
    for group in GROUPS:
        parts = [values[name] for name in group.outputs if name in values and name not in LOADS]
        if len(parts) == len(group.outputs) and np.isfinite(parts).all() and np.ptp(parts) > 0:
            column = parts[0] + (1j * parts[1] if group.symmetry is Symmetry.TURNING else 0.0)
            column = column / np.sqrt((np.abs(column) ** 2).mean())
            (vectors if group.symmetry is Symmetry.TURNING else others).append(column)
    best, least = np.zeros(motion.shape[1], np.complex128), np.inf
    for ways in itertools.product((False, True), repeat=len(vectors)):
        turning = [v.conj() if mirrored else v for v, mirrored in zip(vectors, ways, strict=True)]
        of_spin = {0: others, 1: turning, -1: [v.conj() for v in turning]}
        found, left = np.zeros_like(best), 0.0
        for k, (a, b) in enumerate(MODE_POWERS):
            columns = [np.ones_like(load), *(load * one for one in of_spin.get(1 - a + b, ()))]
            design = np.column_stack(columns).astype(np.complex128) / load[:, None] ** 2
            weights = np.linalg.lstsq(design, motion[:, k] / load**2, rcond=None)[0]
            left += float((np.abs(design @ weights - motion[:, k] / load**2) ** 2).sum())
            found[k] = weights[0]
        if left < least:
            best, least = found, left
    return best
