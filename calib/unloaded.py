"""The untouched tip, from frames of which none shows it: the pins' places extrapolated to no load.

    motion of the pins = motion of the rest frame's own + load f(truth) + load^2 g(truth) + noise load^2

The motion is in modes. The truth of each frame is known: its load (depth, or force), shear, tilt and so on.
Without load none of the others has an effect, so that each comes multiplied by it. f and g are polynomials of
second degree (as processes), in each mode those terms that turn as it does when tip and touch are turned
together: ten frames are enough. How large g and the noise are is the likeliest for the motion.

By how much a pin deviates from its neighbours is not extrapolated, which would amplify noise: it is the same
with load and without, so that the mean over the frames is taken, shallow ones counting most.

The estimate is better than the least deformed frame, whose own shear and tilt would be in every value later.
Here they cancel; what remains is nearly the same all round.
"""

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.linalg import cholesky, solve_triangular

from calib.designs import GROUPS
from edge.features.modes import MODE_POWERS
from edge.geometry.lattice import pitch_of
from edge.geometry.parts import own_pins
from edge.pins import detect
from edge.tracking import Tracker
from edge.types import Array, Complex, Image, Rest, Tracks

#: Values that say how hard the tip is pressed; the first that a table has is taken.
LOADS = ("displacement_mm", "force_n")
#: These move the pins by themselves; a shear in mm moves them the more, the harder the tip is pressed.
ALONG = ("force_x_n", "torque_z_nmm")


@dataclass(frozen=True, slots=True)
class UnloadedParams:
    """Parameters of the estimate; evidence in docs/tuning.md, "Rest frame".

    frames_min  with fewer there is no estimate
    reach       of the span of the loads: how far below the least of them no load may be
    frames_max  the least pressed ones count
    """

    frames_min: int = 8
    reach: float = 5.0
    frames_max: int = 200


PARAMS = UnloadedParams()
SPINS = np.array([1 - a + b for a, b in MODE_POWERS])
TRIED = np.exp(np.arange(-5.0, 1.0))  # variances of g and of the noise at the mean load, over that of f


def load_of(values: Mapping[str, Array]) -> Array | None:
    """(n,) how hard the tip is pressed in each frame; None: the table does not say."""
    return next((values[name] for name in LOADS if name in values), None)


def unloaded(rest: Rest, images: Iterable[Image], values: Mapping[str, Array]) -> Rest | None:
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
    if known.sum() < PARAMS.frames_min or load[known].min() > PARAMS.reach * np.ptp(load[known]):
        return None
    modes, used = _modes(rest), np.flatnonzero(known)[np.argsort(load[known])[: PARAMS.frames_max]]
    motion = np.array([_in_modes(modes, xy - rest.xy_img) for xy in places[used]])
    xy = rest.xy_img + _xy(modes @ _at_no_load(motion, load[used], {k: v[used] for k, v in values.items()}))
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
    scalars: list[Complex] = []
    for group in GROUPS:
        parts = [values[name] for name in group.outputs if name in values and name not in LOADS]
        if len(parts) == len(group.outputs) and np.isfinite(parts).all() and np.ptp(parts) > 0:
            column = np.asarray(np.array((1.0, 1j)[: len(parts)]) @ parts, np.complex128)
            if group.outputs[0] in ALONG:
                column = column / load
            column /= np.sqrt((np.abs(column) ** 2).mean())
            (vectors if len(parts) == 2 else scalars).append(column)
    load = np.maximum(load / np.sqrt((load**2).mean()), 1e-3)  # pressed less is as good as untouched
    nothing, found = np.zeros((len(load), len(load)), np.complex128), []
    others = sum((np.outer(v, v) for v in scalars), nothing)
    for ways in itertools.product((False, True), repeat=len(vectors)):
        turning = [v.conj() if mirrored else v for v, mirrored in zip(vectors, ways, strict=True)]
        vector = sum((np.outer(v, v.conj()) for v in turning), nothing)
        # The part of 1 + k + k^2 with each spin, where k = others + Re(vector turned).
        alike = {1: (0.5 + others) * vector, 2: vector**2 / 4.0}
        alike |= {-spin: one.conj() for spin, one in alike.items()}
        alike[0] = 1.0 + others + others**2 + vector * vector.conj() / 2.0
        found += [_likely(bend, noise, alike, motion, load) for bend in TRIED for noise in TRIED]
    return min(found, key=lambda one: one[0])[1]


def _likely(
    bend: float, noise: float, alike: Mapping[int, Complex], motion: Complex, load: Array
) -> tuple[float, Complex]:
    """How unlikely the motion is, and the likeliest at no load (modes,).

    bend, noise  variances of g and of the noise
    alike        (frames, frames) by spin, covariance of f
    """
    cost, found = 0.0, np.zeros(motion.shape[1], np.complex128)
    both = np.column_stack([np.ones(len(load)), motion]) / load[:, None] ** 2
    for spin in np.unique(SPINS):
        covariance = alike.get(spin, 0.0) * (1.0 / np.outer(load, load) + bend) + noise * np.eye(len(load))
        root, these = cholesky(covariance, lower=True), np.flatnonzero(spin == SPINS)
        one, *rows = solve_triangular(root, both[:, [0, *(these + 1)]], lower=True).T
        size = np.vdot(one, one).real
        for mode, row in zip(these, rows, strict=True):
            found[mode] = np.vdot(one, row) / size
            left = np.linalg.norm(row - found[mode] * one) + np.finfo(float).tiny
            cost += np.log(np.diag(root).real).sum() + 0.5 * np.log(size) + (len(load) - 1) * np.log(left)
    return float(cost), found
