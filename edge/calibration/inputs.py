"""What the models of a calibration depend on: inputs made of a frame's features, or of one contact.

Rules
- Inputs are named and dimensionless: lengths are divided by the tip's radius, areas by its square, so that
  a weight does not depend on the camera's resolution. A star behind a name means the complex conjugate.
- Vectors are complex numbers x + i y: modes of motion `c_ab` (`edge.features.modes`), place `p` on the disc.
- A feature that was not computed is NaN.

A kernel: compiled by Cython, and the same when it is not. To set one number of an array costs NumPy 600
instructions, to divide a few 8,000.
"""

# mypy: disable-error-code="valid-type"

from __future__ import annotations

import math
from collections.abc import Sequence

import cython
import numpy as np

from edge.types import Array, Complex, ContactRegion, Features, PinPattern

MODES = tuple(f"c{a}{d - a}" for d in range(6) for a in range(d, -1, -1))  # as `edge.features.modes` has them

#: Inputs made of a frame's features; the order is that of `frame_inputs`. `volume` is real, `shear` the
#: plain mean of the pins' motion, `c_ab` the modes of motion; `p`, `peak`, `size` are of the strongest
#: contact, as below, all 0 if a touch is too weak for one; `gap` is real, the uncertainty due to lost pins,
#: `gap_place` their mean place on the tip's unit disc, weighted by it, 0 if none is lost.
FRAME_INPUTS: tuple[str, ...] = ("volume", "shear", *MODES, "p", "peak", "size", "gap", "gap_place")
#: First moments about a contact's middle: computed only for models that depend on them.
MOMENTS = ("divergence_moment", "curl_moment")
#: Of a contact fitted to the pins' motion (`edge.types.FittedContact`), computed of several contacts: its
#: place on the tip's unit disc, the others in pitches.
FITTED = ("fitted_p", "fitted_potential", "fitted_width", "fitted_shear", "fitted_dipole")
#: Inputs made of one contact: place on the tip's unit disc, height of the maximum, the frame's mean motion
#: (a shear moves the maximum within the contact), the root of the contact's area; where the contact's middle
#: lies at rest, and the first moments of divergence and curl about it; and those of the fit.
CONTACT_INPUTS: tuple[str, ...] = ("p", "peak", "shear", "size", "middle", *MOMENTS, *FITTED)


def frame_inputs(features: Features, pattern: PinPattern, z: Complex | None = None) -> Complex:
    """The inputs `FRAME_INPUTS` of one frame, NaN where a feature was not computed.

    z        written, and returned; None: a new array
    Returns  (28,) complex128, dimensionless
    Raises   ValueError: sizes that do not fit, a tip without a radius
    """
    n: cython.Py_ssize_t = len(MODES)
    first: cython.Py_ssize_t = 2 + n
    i: cython.Py_ssize_t
    r: cython.double = _radius_px(pattern)
    volume, modes, contacts = features.volume_px2, features.modes_px, features.contacts
    if z is None:
        z = np.empty(len(FRAME_INPUTS), np.complex128)
    row: cython.doublecomplex[::1] = _row(z, len(FRAME_INPUTS))
    row[0] = math.nan if volume is None else volume / (math.pi * r * r)
    row[1] = _shear(features) / r
    if modes is None:
        row[2:first] = math.nan
    else:
        modes_px: cython.const[cython.doublecomplex][::1] = _row(modes, n)
        for i in range(n):
            row[2 + i] = modes_px[i] / r
    if contacts is None:
        row[first] = row[first + 1] = row[first + 2] = math.nan
    elif contacts:
        row[first], row[first + 1], row[first + 2] = _place_peak_size(contacts[0], pattern)
    else:
        row[first] = row[first + 1] = row[first + 2] = 0.0
    row[first + 3] = features.gap
    row[first + 4] = 0.0 if features.gap_img is None else _on_disc(features.gap_img, pattern)
    return z


def _radius_px(pattern: PinPattern) -> float:
    r = pattern.tip_radius_px
    if not (r > 0 and r * r > 0):  # areas are shares of its square
        raise ValueError(f"tip_radius_px: above 0 is wanted, not {r}")
    return r


def _row(z: Complex, n: int) -> Complex:
    if z.shape != (n,):
        raise ValueError(f"({n},) is wanted, not {z.shape}")
    return z


def _shear(features: Features) -> complex:
    """px; NaN: not computed."""
    return math.nan if features.shear_px is None else complex(*features.shear_px.tolist())


def _place_peak_size(contact: ContactRegion, pattern: PinPattern) -> tuple[complex, float, float]:
    size = math.sqrt(contact.area_px2) / pattern.tip_radius_px
    return _on_disc(contact.xy_img, pattern), contact.peak, size


def _on_disc(xy_img: Array, pattern: PinPattern) -> complex:
    """A place on the tip's unit disc."""
    x, y = xy_img.tolist()
    x0, y0 = pattern.centre_img.tolist()
    r = pattern.tip_radius_px
    return complex((x - x0) / r, (y - y0) / r)


def contact_inputs(
    contact: ContactRegion, features: Features, pattern: PinPattern, z: Complex | None = None
) -> Complex:
    """The inputs `CONTACT_INPUTS` of one contact of a frame.

    z        written, and returned; None: a new array
    Returns  (12,) complex128, dimensionless; NaN where it was not computed
    Raises   ValueError: sizes that do not fit, a tip without a radius
    """
    if z is None:
        z = np.empty(len(CONTACT_INPUTS), np.complex128)
    i: cython.Py_ssize_t
    row: cython.doublecomplex[::1] = _row(z, len(CONTACT_INPUTS))
    r = _radius_px(pattern)
    row[0], row[1], row[3] = _place_peak_size(contact, pattern)
    row[2] = _shear(features) / r
    row[4] = _on_disc(contact.middle_img, pattern)
    row[5] = complex(*contact.divergence_moment_px.tolist()) / r
    row[6] = complex(*contact.curl_moment_px.tolist()) / r
    fitted = contact.fitted
    if fitted is None:
        for i in range(7, 12):
            row[i] = math.nan
    else:
        row[7] = _on_disc(fitted.place_img, pattern)
        row[8], row[9] = fitted.potential, fitted.width
        row[10], row[11] = complex(*fitted.shear.tolist()), complex(*fitted.dipole.tolist())
    return z


def term_columns(terms: Sequence[Sequence[str]], inputs: Sequence[str]) -> list[list[int]]:
    """The factors of each term as columns of the row (inputs, conjugates of inputs).

    Raises  KeyError: a term names an unknown input
    """
    column = {name: i for i, name in enumerate((*inputs, *(f"{name}*" for name in inputs)))}
    return [[column[name] for name in term] for term in terms]


def evaluate_terms(z: Complex, terms: Sequence[Sequence[int]]) -> Complex:
    """Products of inputs.

    z        (n, k) complex128, one row a frame
    terms    from `term_columns`
    Returns  (n, n_terms) complex128
    """
    row = np.hstack([z, z.conj()])
    result = np.ones((len(z), len(terms)), dtype=np.complex128)
    for products, term in zip(result.T, terms, strict=True):
        for column in term:
            products *= row[:, column]
    return result
