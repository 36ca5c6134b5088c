"""What the models of a calibration depend on: inputs made of a frame's features, or of one contact.

Rules
- Inputs are named and dimensionless: lengths are divided by the tip's radius, areas by its square, so that
  a weight does not depend on the camera's resolution. A star behind a name means the complex conjugate.
- Vectors are complex numbers x + i y: modes of motion `c_ab` (`edge.features.modes`), place `p` on the disc.
- A feature that was not computed is NaN.

A kernel: compiled by Cython, and the same when it is not. To set one number of an array costs NumPy 600
instructions, to divide a few 8,000.
"""

# mypy: disable-error-code="no-any-return,untyped-decorator,valid-type"

from __future__ import annotations

from collections.abc import Sequence

import cython
import numpy as np

from edge.types import Array, Complex, ContactRegion, Features, PinPattern

if cython.compiled:
    from cython.cimports.libc.math import M_PI, NAN, sqrt
else:
    from math import nan as NAN  # noqa: N812
    from math import pi as M_PI  # noqa: N812
    from math import sqrt

MODES = tuple(f"c{a}{d - a}" for d in range(6) for a in range(d, -1, -1))  # as `edge.features.modes` has them

#: Inputs made of a frame's features; the order is that of `frame_inputs`. `volume` is real, `shear` the
#: plain mean of the pins' motion, `c_ab` the modes of motion; `p`, `peak`, `size` are of the strongest
#: contact, as below, all 0 if a touch is too weak for one; `gap` is real, the uncertainty due to lost pins,
#: `gap_place` their mean place on the tip's unit disc, weighted by it, 0 if none is lost.
FRAME_INPUTS: tuple[str, ...] = ("volume", "shear", *MODES, "p", "peak", "size", "gap", "gap_place")
#: First moments about a contact's middle: computed only for models that depend on them.
MOMENTS = ("divergence_moment", "curl_moment")
#: Inputs of a contact fitted to the pins' motion (`edge.types.FittedContact`), computed of several contacts:
#: its place on the tip's unit disc, the others in pitches.
FITTED = ("fitted_p", "fitted_potential", "fitted_width", "fitted_shear", "fitted_dipole")
#: Inputs made of one contact: place on the tip's unit disc, height of the maximum, the frame's mean motion
#: (a shear moves the maximum within the contact), the root of the contact's area; where the contact's middle
#: lies at rest, and the first moments of divergence and curl about it; and those of the fit.
CONTACT_INPUTS: tuple[str, ...] = ("p", "peak", "shear", "size", "middle", *MOMENTS, *FITTED)


@cython.cclass
class InputRow:
    """The inputs of one frame, or of one contact, written into the same memory again and again.

    values  complex128, dimensionless; NaN where a feature was not computed: (28,) of a frame as in
            `FRAME_INPUTS`, (12,) of a contact as in `CONTACT_INPUTS`
    """

    values = cython.declare(object, visibility="readonly")
    _numbers: cython.double[::1]  # the same memory: real part, imaginary part
    _n: cython.Py_ssize_t
    _pattern: PinPattern | None  # given last
    _x0: cython.double  # its centre and the tip's radius, px
    _y0: cython.double
    _radius: cython.double

    def __init__(self, inputs: Sequence[str]) -> None:
        self._n, self._pattern = len(inputs), None
        self._x0 = self._y0 = self._radius = 0.0
        self.values = np.zeros(len(inputs), np.complex128)
        self._numbers = self.values.view(np.float64)

    def write_frame(self, features: Features, pattern: PinPattern) -> None:
        """Those of one frame. Raises ValueError: sizes that do not fit, a tip without a radius."""
        n: cython.Py_ssize_t = len(MODES)
        first: cython.Py_ssize_t = 2 + n
        i: cython.Py_ssize_t
        self._must_have(first + 5, pattern)
        r: cython.double = self._radius
        volume, modes, contacts = features.volume_px2, features.modes_px, features.contacts
        if volume is None:
            self._set(0, NAN, 0.0)
        else:
            self._set(0, volume / (M_PI * r * r), 0.0)
        self._set_vector(1, features.shear_px, r)
        if modes is None:
            for i in range(n):
                self._set(2 + i, NAN, 0.0)
        else:
            modes_px: cython.const[cython.doublecomplex][::1] = modes
            if modes_px.shape[0] != n:
                raise ValueError(f"modes ({n},) are wanted, not {modes.shape}")
            mode: cython.doublecomplex
            for i in range(n):
                mode = modes_px[i]
                self._set(2 + i, mode.real / r, mode.imag / r)
        if contacts:
            self._set_place_peak_size(contacts[0], first, first + 1, first + 2)
        else:
            nothing: cython.double = NAN if contacts is None else 0.0
            for i in range(first, first + 3):
                self._set(i, nothing, 0.0)
        self._set(first + 3, features.gap, 0.0)
        if features.gap_img is None:
            self._set(first + 4, 0.0, 0.0)
        else:
            self._set_place(first + 4, features.gap_img)

    def write_contact(self, contact: ContactRegion, features: Features, pattern: PinPattern) -> None:
        """Those of one contact of a frame. Raises ValueError: as of `write_frame`."""
        i: cython.Py_ssize_t
        self._must_have(12, pattern)
        r: cython.double = self._radius
        self._set_place_peak_size(contact, 0, 1, 3)
        self._set_vector(2, features.shear_px, r)
        self._set_place(4, contact.middle_img)
        self._set_vector(5, contact.divergence_moment_px, r)
        self._set_vector(6, contact.curl_moment_px, r)
        fitted = contact.fitted
        if fitted is None:
            for i in range(7, 12):
                self._set(i, NAN, 0.0)
        else:
            self._set_place(7, fitted.place_img)
            self._set(8, fitted.potential, 0.0)
            self._set(9, fitted.width, 0.0)
            self._set_vector(10, fitted.shear, 1.0)
            self._set_vector(11, fitted.dipole, 1.0)

    @cython.cfunc
    def _must_have(self, n: cython.Py_ssize_t, pattern: PinPattern) -> cython.bint:
        """Raises ValueError: this row has another size; the tip has no radius."""
        if self._n != n:
            raise ValueError(f"{n} inputs are wanted, not {self._n}")
        if pattern is not self._pattern:
            r: cython.double = pattern.tip_radius_px
            if not (r > 0 and r * r > 0):  # areas are shares of its square
                raise ValueError(f"tip_radius_px: above 0 is wanted, not {r}")
            self._x0, self._y0 = pattern.centre_img.tolist()
            self._radius, self._pattern = r, pattern
        return True

    @cython.cfunc
    @cython.exceptval(check=False)
    def _set(self, i: cython.Py_ssize_t, re: cython.double, im: cython.double) -> cython.void:
        self._numbers[2 * i] = re
        self._numbers[2 * i + 1] = im

    @cython.cfunc
    def _set_vector(self, i: cython.Py_ssize_t, xy: Array | None, scale: cython.double) -> cython.bint:
        """(2,) divided by a scale; None: not computed."""
        if xy is None:
            self._set(i, NAN, 0.0)
        else:
            pair: list[float] = xy.tolist()  # to read an array's element costs as much as both so
            x: cython.double = pair[0]
            y: cython.double = pair[1]
            self._set(i, x / scale, y / scale)
        return True

    @cython.cfunc
    def _set_place(self, i: cython.Py_ssize_t, xy_img: Array) -> cython.bint:
        """A place on the tip's unit disc."""
        place: list[float] = xy_img.tolist()
        x: cython.double = place[0]
        y: cython.double = place[1]
        self._set(i, (x - self._x0) / self._radius, (y - self._y0) / self._radius)
        return True

    @cython.cfunc
    def _set_place_peak_size(
        self,
        contact: ContactRegion,
        place: cython.Py_ssize_t,
        peak: cython.Py_ssize_t,
        size: cython.Py_ssize_t,
    ) -> cython.bint:
        self._set_place(place, contact.xy_img)
        self._set(peak, contact.peak, 0.0)
        area_px2: cython.double = contact.area_px2
        self._set(size, sqrt(area_px2) / self._radius, 0.0)
        return True


def frame_inputs(features: Features, pattern: PinPattern) -> Complex:
    """The inputs `FRAME_INPUTS` of one frame, as of `InputRow`; a new array."""
    row = InputRow(FRAME_INPUTS)
    row.write_frame(features, pattern)
    values: Complex = row.values
    return values


def contact_inputs(contact: ContactRegion, features: Features, pattern: PinPattern) -> Complex:
    """The inputs `CONTACT_INPUTS` of one contact of a frame, as of `InputRow`; a new array."""
    row = InputRow(CONTACT_INPUTS)
    row.write_contact(contact, features, pattern)
    values: Complex = row.values
    return values


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
