# cython: infer_types=True
"""The models of a calibration, evaluated together. Compiled; runs uncompiled too.

Idea: every model but a curve is a sum of products of inputs whose weights are known with their covariance: a
Gaussian process with a kernel of third degree (`calib.process_likelihood`) is one, a polynomial that was
fitted by least squares is one with the same noise in every frame. A frame costs a product for each term and a
few rows of the covariance's root, instead of a kernel for each point of the data.

    value     = sum_k weight_k psi_k                             psi_k = product of inputs
    variance  = sigma^2 (noise + learnt + lost)
    noise     = exp(sum_k noise_weight_k Re psi'_k)              within the range seen in the data
    learnt    = |L psi|^2                                        the uncertainty of the weights
    lost      = exp(scale + sum_k lost_weight_k Re psi"_k) gap^gap_power volume^volume_power
                                                                 the uncertainty due to lost pins

Two outputs are a vector with a different noise along its direction u and across it: when the contact slips,
the length of a shear is less certain than its direction. The noise of x is then u_x^2 along + u_y^2 across,
that of y u_y^2 along + u_x^2 across.

Rules
- Terms of all models share one tree: a product is its parent times one input. Of two that are each other's
  conjugate it has one, as their parts differ in a sign only.
- Every sum is over the real and imaginary parts of products, with real weights.
- Only the models in demand are evaluated, and only the products that they need.
- L has real rows: of a complex row, its real and its imaginary part are two. Of a process with one output the
  real part counts alone.
- A value outside of `valid` is set to its end. That, and `learnt` above `far`, is reported as out of range.
  Outside of `own`, where another tip's model holds on, sigma grows by the distance.
- A NaN among a model's inputs gives NaN. So does a gap larger than any that the fit tried.
- The GIL is held: the scratch belongs to the object, and the work is short.
"""

import math
from collections.abc import Sequence
from sys import intern

import cython
import msgspec
import numpy as np
from cython.cimports.libc.math import exp, hypot, isfinite, isnan, log, sqrt

from edge.calibration.file import CONTACT_OUTPUTS, JOINT_OUTPUTS, Curve, Lost, Model, Process
from edge.calibration.inputs import MODES
from edge.types import Array, Complex, ContactRegion, Feature, Features, Index, PinPattern

if cython.compiled:
    from cython.cimports.edge.geometry.copies import Copies, numbers_of
else:
    from edge.geometry.copies import Copies, numbers_of

HUGE_VAL = cython.declare(cython.double, float("inf"))
M_PI = cython.declare(cython.double, math.pi)
NAN = cython.declare(cython.double, float("nan"))
#: Rows of L that are summed together: their sums stay in registers.
ROWS = 8
LOST_MAX = cython.declare(cython.double, 100.0)  # of the logarithm: more is no number any more
VOLUME_MIN = cython.declare(cython.double, 1e-6)  # of the tip's circle times its radius: no load at all
_NONE = cython.declare(frozenset, frozenset())
_N_MODES = cython.declare(cython.Py_ssize_t, len(MODES))
#: Lengths of `Features`, and the values that the scale makes of them.
_SCALED = cython.declare(list, [(f"{name}_px", f"{name}_mm") for row in Feature for name in row.scaled])


@cython.final
@cython.cclass
class InputRow:
    """The inputs of one frame, or of one contact, written into the same memory again and again.

    values  complex128, dimensionless; NaN where a feature was not computed: (28,) of a frame as in
            `FRAME_INPUTS`, (12,) of a contact as in `CONTACT_INPUTS`
    """

    values = cython.declare(object, visibility="readonly")
    numbers = cython.declare(cython.double[::1], visibility="readonly")  # the same memory, real and imaginary
    x0 = cython.declare(cython.double, visibility="readonly")  # the tip's centre, px
    y0 = cython.declare(cython.double, visibility="readonly")
    _n: cython.Py_ssize_t
    _pattern: PinPattern | None  # given last
    _radius: cython.double  # the tip's, px
    needed: cython.uchar[::1]  # the vectors among them that anybody reads; others are left as they were

    def __init__(self, inputs: Sequence[str]) -> None:
        self._n, self._pattern = len(inputs), None
        self.x0 = self.y0 = self._radius = 0.0
        self.values = np.zeros(len(inputs), np.complex128)
        self.numbers, self.needed = self.values.view(np.float64), np.ones(len(inputs), np.uint8)

    @cython.ccall
    @cython.exceptval(check=True)
    def write_frame(self, features: Features, pattern: PinPattern) -> cython.void:
        """Write the inputs of one frame. Raises ValueError: sizes that do not fit, a tip without a radius."""
        n: cython.Py_ssize_t = _N_MODES
        first: cython.Py_ssize_t = 2 + n
        self._must_have(first + 5, pattern)
        r: cython.double = self._radius
        volume, modes, contacts = features.volume_px2, features.modes_px, features.contacts
        self._set(0, NAN if volume is None else volume / (M_PI * r * r), 0.0)
        self._set_vector(1, features.shear_px, r)
        if modes is None:
            for i in range(n):
                self._set(2 + i, NAN, 0.0)
        else:
            parts = numbers_of(modes, n, True)
            for i in range(n):
                self._set(2 + i, parts[2 * i] / r, parts[2 * i + 1] / r)
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

    @cython.ccall
    @cython.exceptval(check=True)
    def write_contact(self, contact: ContactRegion, features: Features, pattern: PinPattern) -> cython.void:
        """Write the inputs of one contact. Raises ValueError: as of `write_frame`."""
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
    def _must_have(self, n: cython.Py_ssize_t, pattern: PinPattern) -> cython.void:
        """Raises ValueError: this row has another size; the tip has no radius."""
        if self._n != n:
            raise ValueError(f"{n} inputs are wanted, not {self._n}")
        if pattern is not self._pattern:
            r: cython.double = pattern.tip_radius_px
            if not (r > 0 and r * r > 0):  # areas are shares of its square
                raise ValueError(f"tip_radius_px: above 0 is wanted, not {r}")
            self.x0, self.y0 = pattern.centre_img.tolist()
            self._radius, self._pattern = r, pattern

    @cython.cfunc
    @cython.exceptval(check=False)
    def _set(self, i: cython.Py_ssize_t, re: cython.double, im: cython.double) -> cython.void:
        self.numbers[2 * i] = re
        self.numbers[2 * i + 1] = im

    @cython.cfunc
    def _set_vector(
        self, i: cython.Py_ssize_t, xy: Array | None, scale: cython.double, x0: cython.double = 0.0,
        y0: cython.double = 0.0,
    ) -> cython.void:  # fmt: skip
        """(2,) from a place, divided by a scale; None: not computed."""
        if xy is None:
            self._set(i, NAN, 0.0)
        elif self.needed[i]:
            pair: list[float] = xy.tolist()  # to read an array's element costs as much as both so
            x: cython.double = pair[0]
            y: cython.double = pair[1]
            self._set(i, (x - x0) / scale, (y - y0) / scale)

    @cython.cfunc
    def _set_place(self, i: cython.Py_ssize_t, xy_img: Array) -> cython.void:
        """A place on the tip's unit disc."""
        self._set_vector(i, xy_img, self._radius, self.x0, self.y0)

    @cython.cfunc
    def _set_place_peak_size(
        self,
        contact: ContactRegion,
        place: cython.Py_ssize_t,
        peak: cython.Py_ssize_t,
        size: cython.Py_ssize_t,
    ) -> cython.void:
        self._set_place(place, contact.weighted_img)
        self._set(peak, contact.peak, 0.0)
        area_px2: cython.double = contact.area_px2
        self._set(size, sqrt(area_px2) / self._radius, 0.0)


@cython.final
@cython.cclass
class ModelKernel:
    """Models of the same inputs.

    names    of the outputs, in the order of the models
    sigmas   each output's, near the data
    Raises   KeyError: a term names an unknown input; ValueError: sizes that do not fit
    """

    names = cython.declare(tuple, visibility="readonly")
    _unknown: dict[str, float]  # of each output
    sigmas = cython.declare(tuple, visibility="readonly")
    _inputs: InputRow
    _models: list[Process]
    _knots: list[Array | None]
    _nodes: list[Index]  # all that each model needs
    _parent: cython.int[::1]  # of each product; the root, 1, is its own
    _column: cython.uchar[::1]  # the input that the parent is multiplied by
    _sign: cython.schar[::1]  # -1 where it is the input's conjugate
    _active: cython.int[::1]
    _wanted: list[bool]
    _in_pairs: list[bool]  # whether blocks of each model's L are `_blocks_of_pairs`
    # (models + 1, 6) first part, noise term, output, term of `lost`, block of L, knot
    _first: cython.int[:, ::1]
    _part: cython.int[::1]  # numbers in `_parts` that the models sum up
    _weight: cython.double[:, ::1]  # (2, n) of each: for the real part of the value, and the imaginary
    _block: cython.int[::1]  # (blocks + 1,) where each begins in the next two
    _factor_part: cython.int[::1]  # numbers in `_parts`
    _factor: cython.double[:, ::1]
    _noise_node: cython.int[::1]
    _noise_weight: cython.double[:, ::1]  # (2, n) along and across
    _lost_node: cython.int[::1]
    _lost_weight: cython.double[::1]
    # (models, 9) far, range of the noise's logarithm, and across; scale, gap_power, volume_power, gap_max
    _limits: cython.double[:, ::1]
    _valid: cython.double[:, ::1]  # (outputs, 5) low, high, sigma; own low, high
    _knot: cython.double[:, ::1]  # of curves: input, output
    _parts: cython.double[::1]  # real and imaginary part of each product of the current frame
    _outputs: cython.double[:, ::1]  # (outputs, 3) value, sigma, whether out of range

    def __init__(self, inputs: Sequence[str], models: Sequence[Model]) -> None:
        parts = [_as_process(model) for model in models]
        for part in parts:
            _check_sizes(part)
        self._models, self._inputs = parts, InputRow(inputs)
        # Interned names are looked up by what they are, not by what they say.
        self.names = tuple(intern(name) for part in parts for name in part.outputs)
        self._unknown = dict.fromkeys(self.names, NAN)
        self.sigmas = tuple(sigma for part in parts for sigma in part.sigma)
        lost = [_lost_of(part) for part in parts]
        knots = [model.knots if isinstance(model, Curve) else [] for model in models]
        tree = _Tree(inputs)
        terms = [tree.nodes(part.terms) for part in parts]
        sums = [_sums_of(part, *of_part) for part, of_part in zip(parts, terms, strict=True)]
        summed = [numbers for numbers, _, _ in sums]
        noise = [tree.nodes(part.noise_terms)[0] for part in parts]
        of_lost = [tree.nodes(part.terms)[0] for part in lost]
        nodes = zip(summed, noise, of_lost, strict=True)
        self._nodes = [np.concatenate([numbers // 2, *others]) for numbers, *others in nodes]
        self._part, self._noise_node, self._lost_node = map(_joined, (summed, noise, of_lost))
        parent, column, sign = np.array(tree.products).T
        self._parent, self._column = parent.astype(np.int32), column.astype(np.uint8)
        self._sign = sign.astype(np.int8)
        self._in_pairs = [
            len(part.outputs) == 2 and len(set(nodes.tolist())) == len(nodes)
            for part, (nodes, _) in zip(parts, terms, strict=True)
        ]
        blocks = [
            _blocks_of_pairs(part, *of_part) if in_pairs else _blocks_of(factor, numbers)
            for part, of_part, in_pairs, (numbers, _, factor) in zip(
                parts, terms, self._in_pairs, sums, strict=True
            )
        ]
        rows = zip(summed, noise, [part.outputs for part in parts], of_lost, blocks, knots, strict=True)
        counts = [tuple(map(len, row)) for row in rows]
        self._first = np.cumsum([(0,) * 6, *counts], axis=0, dtype=np.int32)
        self._weight = np.concatenate([np.empty((2, 0)), *(weights for _, weights, _ in sums)], axis=1)
        used = [numbers for of_model in blocks for numbers, _ in of_model]
        self._block = np.cumsum([0, *map(len, used)], dtype=np.int32)
        self._factor_part = _joined(used)
        self._factor = np.concatenate([np.empty((0, ROWS)), *(f for of_model in blocks for _, f in of_model)])
        along = [w for part in parts for w in part.noise_weights]
        across = [w for part in parts for w in (part.across_weights or part.noise_weights)]
        self._noise_weight = np.array([along, across], np.float64)
        self._lost_weight = np.array([w for part in lost for w in part.weights], np.float64)
        self._limits = _table([_limits(*part) for part in zip(parts, lost, strict=True)], 9)
        owns = [part.own or [(-math.inf, math.inf)] * len(part.outputs) for part in parts]
        ranges = [zip(p.valid, p.sigma, own, strict=True) for p, own in zip(parts, owns, strict=True)]
        self._valid = _table([(*v, s, *o) for of_model in ranges for v, s, o in of_model], 5)
        self._knot = _table([knot for curve in knots for knot in curve], 2)
        self._parts = np.zeros(2 * len(tree.products))
        self._outputs = np.zeros((len(self.names), 3))
        self.want(None)

    def want(self, outputs: frozenset[str] | None) -> None:
        """Evaluate from now on the models of these outputs; others become NaN. None: all."""
        self._wanted = [outputs is None or not outputs.isdisjoint(model.outputs) for model in self._models]
        parent, needed = np.asarray(self._parent), np.zeros(len(self._parent), np.bool_)
        for nodes, wanted in zip(self._nodes, self._wanted, strict=True):
            needed[nodes] |= wanted
        for k in range(len(needed) - 1, 0, -1):
            needed[parent[k]] |= needed[k]
        self._active = active = np.flatnonzero(needed[1:]).astype(np.int32) + np.int32(1)
        columns = np.arange(self._inputs._n)
        np.asarray(self._inputs.needed)[:] = np.isin(columns, np.asarray(self._column)[active])

    def of_frame(
        self, features: Features, pattern: PinPattern
    ) -> tuple[dict[str, float], dict[str, float], frozenset[str]]:
        """Values and sigmas of a frame, and the names of the known values that are out of range; all new."""
        self._inputs.write_frame(features, pattern)
        self._run()
        values: dict[str, float] = self._unknown.copy()
        sigmas: dict[str, float] = self._unknown.copy()
        outside = _NONE
        for i in range(self._outputs.shape[0]):
            name = self.names[i]
            values[name] = self._outputs[i, 0]
            sigmas[name] = self._outputs[i, 1]
            if self._outputs[i, 2] != 0.0:
                outside |= {name}
        return values, sigmas, outside

    def of_inputs(self, z: Complex) -> Array:
        """(outputs, 3) value, sigma, and whether out of range, of (inputs,) complex128; a new array."""
        self._inputs.values[:] = z
        self._run()
        return np.array(self._outputs)

    @cython.cfunc
    def _run(self) -> cython.void:
        z: cython.double[::1] = self._inputs.numbers
        parts: cython.double[::1] = self._parts
        parts[0] = 1.0
        for i in range(self._active.shape[0]):
            k = self._active[i]
            p = 2 * self._parent[k]
            a = 2 * self._column[k]
            x = z[a]
            y = self._sign[k] * z[a + 1]
            parts[2 * k] = parts[p] * x - parts[p + 1] * y
            parts[2 * k + 1] = parts[p] * y + parts[p + 1] * x
        for i in range(len(self._wanted)):
            if self._wanted[i]:
                self._evaluate(i)
            else:
                for k in range(self._first[i, 2], self._first[i + 1, 2]):
                    self._outputs[k, 0] = self._outputs[k, 1] = NAN
                    self._outputs[k, 2] = 0.0

    @cython.cfunc
    def _evaluate(self, m: cython.Py_ssize_t) -> cython.void:
        first: cython.Py_ssize_t = self._first[m, 2]
        re: cython.double = 0.0
        im: cython.double = 0.0
        for k in range(self._first[m, 0], self._first[m + 1, 0]):
            re += self._weight[0, k] * self._parts[self._part[k]]
        if self._first[m + 1, 2] - first == 2:
            for k in range(self._first[m, 0], self._first[m + 1, 0]):
                im += self._weight[1, k] * self._parts[self._part[k]]
        learnt: cython.double = self._learnt(m)
        # Written so that a NaN is reported as out of range too.
        known: cython.bint = learnt <= self._limits[m, 0]
        if self._first[m, 5] < self._first[m + 1, 5]:
            known = self._knot[self._first[m, 5], 0] <= re <= self._knot[self._first[m + 1, 5] - 1, 0]
            re = self._along_curve(m, re)
        spread: cython.double = learnt + self._lost(m)
        along: cython.double = self._noise(m, 0)
        if self._first[m + 1, 2] - first == 1:
            self._write(first, re, spread + along, known)
            return
        across: cython.double = self._noise(m, 1)
        square: cython.double = re * re + im * im
        share: cython.double = 0.5  # of x in the direction
        if square > 0.0:
            share = re * re / square
        self._write(first, re, spread + share * along + (1.0 - share) * across, known)
        self._write(first + 1, im, spread + share * across + (1.0 - share) * along, known)

    @cython.cfunc
    def _learnt(self, m: cython.Py_ssize_t) -> cython.double:
        """|L psi|^2."""
        sums: cython.double[16] = [0.0] * 16
        factor: cython.double[:, ::1] = self._factor
        parts: cython.double[::1] = self._parts
        part: cython.int[::1] = self._factor_part
        in_pairs: cython.bint = self._in_pairs[m]
        total: cython.double = 0.0
        for b in range(self._first[m, 4], self._first[m + 1, 4]):
            for r in range(16):
                sums[r] = 0.0
            if in_pairs:
                for k in range(self._block[b], self._block[b + 1], 2):
                    x = parts[part[k]]
                    y = part[k + 1] * parts[part[k] + 1]
                    for r in range(8):
                        sums[r] += factor[k, r] * x + factor[k + 1, r] * y
                    for r in range(8):
                        sums[8 + r] += factor[k, r] * y - factor[k + 1, r] * x
            else:
                for k in range(self._block[b], self._block[b + 1]):
                    x = parts[part[k]]
                    for r in range(8):
                        sums[r] += factor[k, r] * x
            for r in range(16):
                total += sums[r] * sums[r]
        return total

    @cython.cfunc
    def _along_curve(self, m: cython.Py_ssize_t, x: cython.double) -> cython.double:
        """Linear between the knots, flat beyond them; NaN stays NaN."""
        k: cython.Py_ssize_t = self._first[m, 5]
        last: cython.Py_ssize_t = self._first[m + 1, 5] - 1
        knot: cython.double[:, ::1] = self._knot
        if x <= knot[k, 0]:
            return knot[k, 1]
        if x >= knot[last, 0]:
            return knot[last, 1]
        while k + 1 < last and x >= knot[k + 1, 0]:
            k += 1
        slope: cython.double = (knot[k + 1, 1] - knot[k, 1]) / (knot[k + 1, 0] - knot[k, 0])
        return slope * (x - knot[k, 0]) + knot[k, 1]

    @cython.cfunc
    def _noise(self, m: cython.Py_ssize_t, across: cython.Py_ssize_t) -> cython.double:
        """Variance of the noise, in units of sigma^2."""
        h: cython.double = 0.0
        for k in range(self._first[m, 1], self._first[m + 1, 1]):
            h += self._noise_weight[across, k] * self._parts[2 * self._noise_node[k]]
        return exp(min(max(h, self._limits[m, 1 + 2 * across]), self._limits[m, 2 + 2 * across]))

    @cython.cfunc
    def _lost(self, m: cython.Py_ssize_t) -> cython.double:
        """Variance from pins that are not seen, in units of sigma^2; NaN: more than the fit tried."""
        if self._limits[m, 5] == -HUGE_VAL:  # without a model of it
            return 0.0
        gap: cython.double = self._parts[2 * self._lost_node[self._first[m, 3]]]
        volume: cython.double = self._parts[2 * self._lost_node[self._first[m, 3] + 1]]
        if gap <= 0.0:
            return 0.0
        if not gap <= self._limits[m, 8]:
            return NAN
        h: cython.double = self._limits[m, 5]
        for k in range(self._first[m, 3], self._first[m + 1, 3]):
            h += self._lost_weight[k] * self._parts[2 * self._lost_node[k]]
        h += self._limits[m, 6] * log(gap) + self._limits[m, 7] * log(max(volume, VOLUME_MIN))
        return exp(min(h, LOST_MAX))

    @cython.cfunc
    def _write(
        self, o: cython.Py_ssize_t, value: cython.double, variance: cython.double, known: cython.bint
    ) -> cython.void:
        low: cython.double = self._valid[o, 0]
        high: cython.double = self._valid[o, 1]
        sigma: cython.double = self._valid[o, 2] * sqrt(variance)
        beyond: cython.double = max(self._valid[o, 3] - value, value - self._valid[o, 4])
        if beyond > 0.0:
            sigma = sqrt(sigma * sigma + beyond * beyond)
        if isnan(variance):
            value = NAN
        elif value < low or value > high:
            value = low if value < low else high
            known = False
        self._outputs[o, 0] = value
        self._outputs[o, 1] = sigma
        self._outputs[o, 2] = 0.0 if known or isnan(value) else 1.0


@cython.final
@cython.cclass
class Places:
    """Places and depths of contacts, as in `Reading.contacts`.

    models     of a contact, and of one that was fitted together with others
    mm_per_px  of a place that no model gives; NaN: it is not known
    own_depth  a single contact's depth is its models', if they give one
    """

    _models: tuple[ModelKernel, ModelKernel]
    _columns: list[list[int]]  # of each output
    _scale: cython.double
    _own_depth: cython.bint
    _place: cython.double[::1]
    _copies: Copies  # of one contact's place

    def __init__(self, models: tuple[ModelKernel, ModelKernel], mm_per_px: float, own_depth: bool) -> None:
        place, names = np.empty((1, 3)), CONTACT_OUTPUTS + JOINT_OUTPUTS
        own, joint = models  # ValueError: others
        self._columns = [[names.index(name) % 3 for name in model.names] for model in (own, joint)]
        self._models, self._scale, self._own_depth = models, mm_per_px, own_depth
        self._place, self._copies = place.ravel(), Copies(place)

    def of_frame(
        self, found: Sequence[ContactRegion], features: Features, pattern: PinPattern, depth_mm: float | None
    ) -> tuple[Array, int]:
        """(k, 3) mm of k contacts, 1 or more; and what of any is out of range: a bit each for x, y, depth.

        depth_mm  of a single contact, with a range of its own; None: not known
        """
        beyond: cython.int = 0
        k: cython.Py_ssize_t = len(found)
        place: cython.double[::1] = self._place
        rows: list[list[float]] = []
        for contact in found:
            far: cython.int = 0
            place[0] = place[1] = place[2] = NAN
            if not isnan(self._scale):
                (x, y), (x0, y0) = contact.xy_img.tolist(), pattern.centre_img.tolist()
                place[0], place[1] = (x - x0) * self._scale, (y - y0) * self._scale
            for j in range(2 if k > 1 and contact.fitted is not None else 1):
                models: ModelKernel = self._models[j]
                if models._outputs.shape[0]:
                    models._inputs.write_contact(contact, features, pattern)
                    models._run()
                for i in range(models._outputs.shape[0]):
                    column: cython.int = self._columns[j][i]
                    place[column] = models._outputs[i, 0]
                    is_far: cython.int = models._outputs[i, 2] != 0.0
                    far = far & ~(1 << column) | is_far << column
            if k == 1 and depth_mm is not None and not (self._own_depth and isfinite(place[2])):
                place[2] = depth_mm
                far &= 3
            beyond |= far
            if k > 1:
                rows.append([place[0], place[1], place[2]])
        return (self._copies.take() if k == 1 else np.array(rows)), beyond


@cython.ccall
def area_mm2(
    found: tuple[ContactRegion, ...] | None, values: dict[str, float], mm_per_px: float | None
) -> float | None:
    """Area of all contacts: a model's, else that of the contacts in the image; None: not known."""
    if "contact_area_mm2" in values:
        return values["contact_area_mm2"]
    if found is None or mm_per_px is None:
        return None
    return sum([c.area_px2 for c in found]) * mm_per_px**2


def derive(
    features: Features, found: tuple[ContactRegion, ...] | None, values: dict[str, float],
    sigmas: dict[str, float], interval_s: float | None, mm_per_px: float | None,
) -> None:  # fmt: skip
    """Add the values that follow from others and the scale; see the head of `edge.calibration.model`."""
    in_contact: cython.bint = features.in_contact
    area = area_mm2(found, values, mm_per_px)
    if area is not None:
        values["contact_area_mm2"] = area
    if found:
        values["orientation_deg"] = found[0].orientation_rad * (180.0 / M_PI)
    if area is not None and "force_n" in values:
        if not in_contact:
            values["pressure_kpa"] = 0.0
        elif area > 0.0:
            pressure = 1e3 * values["force_n"] / area
            values["pressure_kpa"] = pressure
            if "contact_area_mm2" in sigmas:
                of_force = 1e3 * sigmas["force_n"] / area
                sigmas["pressure_kpa"] = hypot(of_force, pressure * sigmas["contact_area_mm2"] / area)
    slip_px, probability = features.slip_px, features.slip_probability
    of_twist = features.twist_slip_probability
    if slip_px is not None and probability is not None:
        values["slip_probability"] = probability
        if of_twist is not None:
            values["twist_slip_probability"] = of_twist
        if not in_contact:
            values["slip_speed_mm_s"] = 0.0
        elif mm_per_px is not None and interval_s is not None and interval_s > 0.0:
            values["slip_speed_mm_s"] = slip_px * mm_per_px / interval_s
    for length, name in _SCALED:
        length_px = getattr(features, length)
        if length_px is not None and mm_per_px is not None:
            values[name] = length_px * mm_per_px


class _Tree:
    """Products of inputs, each its parent times one input; node 0 is 1."""

    def __init__(self, inputs: Sequence[str]) -> None:
        self._letter = {
            f"{name}{star}": (column, sign)
            for star, sign in (("", 1), ("*", -1))
            for column, name in enumerate(inputs)
        }
        self._node: dict[tuple[tuple[int, int], ...], int] = {(): 0}
        self.products = [(0, 0, 1)]  # of each node: its parent, the input's column, -1: its conjugate, else 1

    def nodes(self, terms: Sequence[Sequence[str]]) -> tuple[Index, Array]:
        """Numbers of the products that terms are, added with their parents if new; and what their imaginary
        parts are to be multiplied by: 1, -1 where a term is the product's conjugate, 0 where it is real.
        """
        nodes, signs = np.empty(len(terms), np.int32), np.empty(len(terms))
        for i, term in enumerate(terms):
            letters = tuple(sorted(self._letter[name] for name in term))
            conjugate = tuple(sorted((column, -sign) for column, sign in letters))
            nodes[i] = self._add(min(letters, conjugate))
            signs[i] = (letters < conjugate) - (letters > conjugate)
        return nodes, signs

    def _add(self, letters: tuple[tuple[int, int], ...]) -> int:
        if letters not in self._node:
            last = len(letters) - 1
            parent = self._add(letters[:last])
            self._node[letters] = len(self.products)
            self.products.append((parent, *letters[last]))
        return self._node[letters]


def _joined(nodes: Sequence[Index]) -> Index:
    return np.concatenate([np.empty(0, np.int32), *nodes])


def _table(rows: Sequence[Sequence[float]], columns: int) -> Array:
    return np.array(rows, np.float64).reshape(-1, columns)


def _as_process(model: Model) -> Process:
    """A curve's or a polynomial's terms, outputs, and sigmas; the noise is the same in every frame."""
    if isinstance(model, Process):
        if model.lost is None:
            return model
        # Gap and volume come first: their values are read.
        terms, weights = [["gap"], ["volume"], *model.lost.terms], [0.0, 0.0, *model.lost.weights]
        lost = msgspec.structs.replace(model.lost, terms=terms, weights=weights)
        return msgspec.structs.replace(model, lost=lost)
    if isinstance(model, Curve):
        if len(model.knots) < 2:
            raise ValueError(f"curve: two knots or more are wanted, not {len(model.knots)}")
        free = [(-math.inf, math.inf)]
        return Process([model.output], [[model.input]], [(1.0, 0.0)], free, [model.sigma], [], math.inf)
    # The imaginary part of L psi counts too where there is one output: it is the real part of -i L psi.
    turned = [[(im, -re) for re, im in row] for row in model.spread] if len(model.outputs) == 1 else []
    factor = [*model.spread, *turned]
    return Process(model.outputs, model.terms, model.weights, model.valid, model.sigma, factor, math.inf)


def _sums_of(model: Process, nodes: Index, signs: Array) -> tuple[Index, Array, Array]:
    """A model as sums of parts of products, with real weights.

    nodes, signs  of its terms, as of `_Tree.nodes`
    Returns       (n,) numbers of the parts: 2 k is the real part of product k, 2 k + 1 the imaginary; weights
                  (2, n) of the value's real and imaginary part; (rows, n) rows of L
    """
    weights = np.array(model.weights, np.float64).reshape(-1, len(nodes), 2) @ (1, 1j)
    factor = np.array(model.factor, np.float64).reshape(-1, len(nodes), 2) @ (1, 1j)
    if len(model.outputs) == 2:
        factor = np.concatenate([factor, -1j * factor])
    rows = np.concatenate([weights, -1j * weights, factor])
    used, place = np.unique(nodes, return_inverse=True)
    sums = np.zeros((len(used), 2, len(rows)))
    np.add.at(sums[:, 0], place, rows.real.T)
    np.add.at(sums[:, 1], place, (-signs * rows.imag).T)
    needed = np.ones((len(used), 2), np.bool_)
    needed[place, 1] = signs != 0.0
    parts = np.column_stack([2 * used, 2 * used + 1])[needed]
    columns = sums[needed].T
    return parts.astype(np.int32), columns[:2], columns[2:]


def _blocks_of(factor: Array, parts: Index) -> list[tuple[Index, Array]]:
    """The rows of L (rows, n), `ROWS` together: the parts (k,) that they weigh, and how (k, ROWS).

    Weights that are nothing but the rounding of others of the same part are left out.
    """
    least = np.finfo(np.float64).eps ** (2.0 / 3.0) * np.abs(factor).max(axis=0, initial=0.0)
    rows = np.pad(factor, ((0, -len(factor) % ROWS), (0, 0)))
    blocks = rows.reshape(-1, ROWS, len(parts)).transpose(0, 2, 1)
    return [(parts[used], block[used]) for block in blocks for used in [np.abs(block).max(axis=1) > least]]


def _limits(model: Process, lost: Lost) -> tuple[float, ...]:
    """One row of `_limits`."""
    across = model.across_range if model.across_weights else model.noise_range
    of_lost = (lost.scale, lost.gap_power, lost.volume_power, lost.gap_max)
    return (model.far, *model.noise_range, *across, *of_lost)


def _lost_of(model: Process) -> Lost:
    """Its own, or one that adds nothing."""
    return model.lost or Lost(-math.inf, 0.0, 0.0, math.inf)


def _check_sizes(model: Process) -> None:
    """Raises ValueError: lists that belong together differ in length."""
    lost, noise, outputs = _lost_of(model), len(model.noise_terms), len(model.outputs)
    sizes = len(model.terms), noise, noise if model.across_weights else 0, outputs, outputs, len(lost.terms)
    lists = (model.weights, model.noise_weights, model.across_weights, model.valid, model.sigma, lost.weights)
    given = tuple(len(part) for part in lists)
    if given != sizes or outputs not in (1, 2):
        raise ValueError(f"{sizes} weights, noise, across, valid, sigma, lost are wanted, not {given}")


def _blocks_of_pairs(model: Process, nodes: Index, signs: Array) -> list[tuple[Index, Array]]:
    """The complex rows of L, `ROWS` together: of each term its product's real part and -1 if it is the
    conjugate, else 1; and the real part of its weights, and the imaginary one less than 0.
    """
    rows = np.array(model.factor, np.float64).reshape(-1, len(nodes), 2) @ (1, 1j)
    rows = np.pad(rows, ((0, -len(rows) % ROWS), (0, 0)))
    parts = np.column_stack([2 * nodes, np.where(signs < 0.0, -1, 1)]).ravel().astype(np.int32)
    blocks = rows.reshape(-1, ROWS, len(nodes)).transpose(0, 2, 1)
    return [(parts, np.stack([b.real, -b.imag], axis=1).reshape(-1, ROWS)) for b in blocks]
