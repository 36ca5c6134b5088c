# cython: infer_types=True
r"""A few parametric contacts fitted to the pins' motion together: place, size, strength and shear of each.

    motion(x) = sum over contacts + affine motion

    press    -grad of a potential h f, with f = 1 / (1 + r^2 / 2 s^2): width s, height h
    shear    t f + (v . d) d f^2 / s^2, with d = x - place
    line     the same press and t, mean over the points of a line: a bar, an edge. With Hertz's pressure along
             it, as of a bar on a dome or a bar with round ends, or with an even one

    dots     on the surface of a gel: the same press, t f and a core (c + k d) exp(-r^2 / 2 b^2), or the means
             over a line, d from its middle. The core is what lies under the tool: a camera sees its dots come
             nearer, and the tool drags them along

Idea: motions of several contacts add up, their areas, peaks and regions do not. So what one contact does is
what is left when the fitted others are taken away, and the depth of the skin at its place is the sum of all
potentials there. The rational quadratic potential is a mean over Gaussian ones of all widths: nothing but a
place, a width and a height has to be known of the tool.

Rules
- Levenberg and Marquardt's steps on all parameters at once, from given places, or from where the last fit of
  the same shape ended, if that is near them; a fixed number at most, so that a frame's time is bounded. Weak
  Gaussian priors keep shears and widths finite where pins cannot tell.
- A step from where the last fit ended is the last one where the error became what the linear model had
  promised.
- Seen pins near the given places count, no predicted ones.
- Place and motion are where the skin lies at rest: a shear that drags the skin does not move them.

Source  More, The Levenberg-Marquardt algorithm, Lecture Notes in Mathematics 630, 1978; Johnson, Contact
        Mechanics, chapter 3 (fields of several loads add up); Rasmussen and Williams, Gaussian Processes,
        MIT Press 2006, section 4.2 (rational quadratic as a mean over widths)
"""

import cython
import numpy as np
from cython.cimports.libc.math import erf, exp, hypot, log, sqrt

from edge.features.params import PARAMS
from edge.geometry.motion_field import SHARP
from edge.types import Array

#: Contacts of one fit: with more a frame would take too long.
FITS_MAX = 4

_FITS_MAX = cython.declare(cython.Py_ssize_t, FITS_MAX)
_EVEN = cython.declare(cython.Py_ssize_t, FITS_MAX + 1)  # beside 0, a line, and so many points: an even line
#: Parameters of a contact: place (2), logarithm of the width, strength, t (2), v or half a line (2); and with
#: dots on the surface c (2), the logarithm of the core's width, and k.
_OWN = cython.declare(cython.Py_ssize_t, 8)
_OWN_OF_DOT = cython.declare(cython.Py_ssize_t, 12)
_COMMON = cython.declare(cython.Py_ssize_t, 6)
#: Damping of the first step; a tenth of it after one that helped, else tenfold. At 0.1 some lines get short.
_DAMPING = cython.declare(cython.double, 1.0)
_ENOUGH = cython.declare(cython.double, 1e-2)  # relative gain of a step that is the last one


def _nodes_n(error: float) -> int:
    """Points of a line over which a mean is a weighted sum, for the longest line and the width that a fit
    begins with: Gauss' rule errs by 1 / r^(2 n + 2), where r is the sum of the semi-axes of the ellipse about
    the line, in halves of it, through the nearest pole: of f at sqrt(2) widths.
    """
    pole = sqrt(2.0) / PARAMS.grid_steps_per_pitch / (2.0 * PARAMS.close_pitch)
    return round(np.ceil(-log(error) / (2.0 * log(pole + sqrt(1.0 + pole * pole))) - 1.0))


_NODES = cython.declare(cython.Py_ssize_t, _nodes_n(_ENOUGH))
#: Normal noise has this density in the middle, and its error function this scale.
_NORMAL = cython.declare(cython.double, 1.0 / sqrt(2.0 * np.pi))
_ROOT_HALF = cython.declare(cython.double, sqrt(0.5))
_POINT = cython.declare(cython.double, 1e-6)  # half of a line over the core's width: below it is a point
_NO_LIMIT = cython.declare(cython.double, float("inf"))


@cython.cclass
class ContactFit:
    """Fits contacts to the motion of the n pins of one tip. Results are of the last fit.

    place      (FITS_MAX, 2) float64 px, at rest
    width      (FITS_MAX,) float64 pitches, s
    height     (FITS_MAX,) float64 squared pitches, of the own potential
    total      (FITS_MAX,) float64 squared pitches, of all potentials at this contact's place
    shear      (FITS_MAX, 2) float64 pitches, t
    dipole     (FITS_MAX, 2) float64 pitches, v; of a line: half of the line
    core       (FITS_MAX,) float64 pitches, b; 0 with pins
    least      squared pitches, what the squared error could still fall to if steps went on
    n_pins     pins that count

    rest_xy, pitch_px  (n, 2) px, and their pitch
    dots               they are dots on the surface: all count, from any place
    Raises             ValueError: sizes that do not fit
    """

    place = cython.declare(cython.double[:, ::1], visibility="readonly")
    width = cython.declare(cython.double[::1], visibility="readonly")
    height = cython.declare(cython.double[::1], visibility="readonly")
    total = cython.declare(cython.double[::1], visibility="readonly")
    shear = cython.declare(cython.double[:, ::1], visibility="readonly")
    dipole = cython.declare(cython.double[:, ::1], visibility="readonly")
    core = cython.declare(cython.double[::1], visibility="readonly")
    least = cython.declare(cython.double, visibility="readonly")
    n_pins = cython.declare(cython.Py_ssize_t, visibility="readonly")
    _own: cython.Py_ssize_t
    _rest: cython.double[:, ::1]  # pitches
    _pitch_px: cython.double
    _pin: cython.int[::1]  # the pins that count
    _place: cython.double[:, ::1]  # theirs at rest, pitches
    _motion: cython.double[:, ::1]  # theirs, pitches
    _marked: cython.double[:, ::1]  # the same in an earlier frame
    _lost: cython.int[::1]  # others as near, which were not seen
    _lost_n: cython.Py_ssize_t
    _near: cython.double[:, ::1]  # the places that they were chosen for, px
    _near_n: cython.Py_ssize_t
    _left: cython.double[:, ::1]  # what is left of it
    _middle_x: cython.double  # of the affine part, pitches
    _middle_y: cython.double
    _m: cython.Py_ssize_t  # contacts
    _is_line: cython.bint
    _start: cython.double[::1]  # parameters
    _now: cython.double[::1]
    _next: cython.double[::1]
    _scale: cython.double[::1]  # of each parameter's prior: noise over its standard deviation
    _rows: cython.double[:, ::1]  # two of each pin: derivatives of its motion, and what is left of it
    _normal: cython.double[:, ::1]  # normal equations: Hessian to first order, last row gradient and cost
    _damped: cython.double[:, ::1]
    _step: cython.double[::1]
    _node: cython.double[::1]  # of a line, from -1 to 1
    _weight: cython.double[:, ::1]  # with Hertz's pressure, with an even one
    _evenly: cython.bint
    _sums: cython.double[:, ::1]  # of each pin over a line's nodes
    _radius: cython.double  # pins count within it; any scale of that size would do for the affine part
    _reach: cython.double
    _width: cython.double
    _core: cython.double
    _prior: cython.double[::1]  # of a contact's parameters, likewise
    _error: cython.double  # squared, at the present parameters
    _limit: cython.double  # of it
    _promise: cython.double  # by how much a step reduces the squared error, to first order
    _last: cython.double[:, ::1]  # where the last fit of each shape ended: a line, one point, two ..., _EVEN
    _is_known: cython.uchar[::1]  # of each shape
    _is_taken: cython.uchar[::1]  # of a last fit's contacts

    def __init__(self, rest_xy: Array, pitch_px: float, dots: bool = False) -> None:
        self._own = _OWN_OF_DOT if dots else _OWN
        n, size = len(rest_xy), self._own * FITS_MAX + _COMMON
        if rest_xy.shape != (n, 2):
            raise ValueError(f"rest_xy (n, 2) is wanted, not {rest_xy.shape}")
        self.place, self.width = np.zeros((FITS_MAX, 2)), np.zeros(FITS_MAX)
        self.height, self.total = np.zeros(FITS_MAX), np.zeros(FITS_MAX)
        self.shear, self.dipole = np.zeros((FITS_MAX, 2)), np.zeros((FITS_MAX, 2))
        self.core = np.zeros(FITS_MAX)
        self._rest, self._pitch_px = np.array(rest_xy / pitch_px, np.float64, order="C"), pitch_px
        self._pin, self._lost = np.zeros((2, n), np.int32)
        self._lost_n, self._place = 0, np.zeros((n, 2))
        self._motion, self._marked, self._left = np.zeros((n, 2)), np.zeros((n, 2)), np.zeros((n, 2))
        self._near, self._near_n = np.zeros((FITS_MAX, 2)), 0
        self._start, self._now, self._next = np.zeros(size), np.zeros(size), np.zeros(size)
        self._scale, self._step, self._damped = np.zeros(size), np.zeros(size), np.zeros((size, size))
        columns = 4 * (size // 4 + 1)  # with what is left of the motion; as `_sum_products` takes it
        self._rows, self._normal = np.zeros((2 * n + 2, columns)), np.zeros((columns, columns))
        self._last, self._error, self._promise = np.zeros((FITS_MAX + 2, size)), 0.0, 0.0
        self._is_known, self._is_taken = np.zeros((2, FITS_MAX + 2), np.uint8)
        self.least = self._middle_x = self._middle_y = 0.0
        self.n_pins, self._m, self._is_line = 0, 0, False
        self._radius, self._reach = 2.0 * PARAMS.close_pitch, PARAMS.place_radius_pitch
        self._width = self._core = 1.0 / PARAMS.grid_steps_per_pitch
        # Gauss and Chebyshev's second kind, for a weight of sqrt(1 - z^2); Fejer's second, for an even one.
        angle, odd = np.pi * np.arange(1, _NODES + 1) / (_NODES + 1), np.arange(1, _NODES + 1, 2)
        sine, even = np.sin(angle), (np.sin(np.outer(angle, odd)) / odd).sum(axis=1)
        self._node, self._weight = np.cos(angle), 2.0 / (_NODES + 1) * sine * np.array([sine, even])
        self._evenly, self._sums = False, np.zeros((n, 14))
        noise, shear = SHARP.noise, SHARP.noise / SHARP.curl  # errors of the model; a shear against a press
        self._prior = np.array([0.0, 0.0, noise, noise / 10.0, shear, shear, shear, shear])
        if dots:
            # A gel is about as thick as the reach; how far a dot's shear goes is for the dots to tell.
            self._radius = float(np.hypot(*np.ptp(rest_xy, axis=0))) / pitch_px
            self._width, self._core = self._reach, self._width
            drag = noise / 10.0
            self._prior = np.array([0.0, 0.0, noise, drag, *[noise] * 4, drag, drag, noise, drag])

    def forget(self) -> None:
        """The next frame does not follow the last one."""
        for i in range(_EVEN + 1):
            self._is_known[i] = False

    def choose(
        self,
        xy: cython.const[cython.double][:, ::1],
        seen: cython.const[cython.uchar][::1],
        places: cython.const[cython.double][:, ::1],
    ) -> None:
        """From now on the seen pins within the fit's radius of one of these places count, with this motion.

        xy       (n, 2) float64 px, where the pins are; finite where seen
        seen     (n,) bool
        places   (k, 2) float64 px, at rest; k 1 to FITS_MAX
        Raises   ValueError: sizes that do not fit
        """
        self._check(xy, seen, places)
        k = places.shape[0]
        n = 0
        radius2 = self._radius * self._radius
        self._middle_x = 0.0
        self._middle_y = 0.0
        for j in range(k):
            self._middle_x += places[j, 0] / (self._pitch_px * k)
            self._middle_y += places[j, 1] / (self._pitch_px * k)
            self._near[j, 0], self._near[j, 1] = places[j, 0], places[j, 1]
        self._lost_n = 0
        for i in range(self._rest.shape[0]):
            for j in range(k):
                x = self._rest[i, 0] - places[j, 0] / self._pitch_px
                y = self._rest[i, 1] - places[j, 1] / self._pitch_px
                if x * x + y * y <= radius2:
                    if seen[i]:
                        self._pin[n] = cython.cast(cython.int, i)
                        self._place[n, 0], self._place[n, 1] = self._rest[i, 0], self._rest[i, 1]
                        n += 1
                    else:
                        self._lost[self._lost_n] = cython.cast(cython.int, i)
                        self._lost_n += 1
                    break
        self.n_pins, self._near_n = n, k
        self._take_motion(xy)
        self.mark()

    def mark(self) -> None:
        """Say later how far the motion is from the present one."""
        for i in range(self.n_pins):
            self._marked[i, 0], self._marked[i, 1] = self._motion[i, 0], self._motion[i, 1]

    def again(
        self,
        xy: cython.const[cython.double][:, ::1],
        seen: cython.const[cython.uchar][::1],
        places: cython.const[cython.double][:, ::1],
    ) -> float:
        """The motion of another frame, of the same pins.

        xy, seen, places  as of `choose`
        Returns           pitches, root of the squared distance from the motion that was marked, or with which
                          they were chosen; infinite: other pins are seen near these places, or a place is
                          another point of the grid
        Raises            ValueError: sizes that do not fit
        """
        self._check(xy, seen, places)
        square: cython.double = 0.0
        if places.shape[0] != self._near_n:
            return _NO_LIMIT
        for i in range(self._near_n):
            x, y = places[i, 0] - self._near[i, 0], places[i, 1] - self._near[i, 1]
            if not hypot(x, y) <= self._width * self._pitch_px:
                return _NO_LIMIT
        for i in range(self.n_pins):
            if not seen[self._pin[i]]:
                return _NO_LIMIT
        for i in range(self._lost_n):
            if seen[self._lost[i]]:
                return _NO_LIMIT
        self._take_motion(xy)
        for i in range(self.n_pins):
            x = self._motion[i, 0] - self._marked[i, 0]
            y = self._motion[i, 1] - self._marked[i, 1]
            square += x * x + y * y
        return sqrt(square)

    @cython.cfunc
    def _check(
        self,
        xy: cython.const[cython.double][:, ::1],
        seen: cython.const[cython.uchar][::1],
        places: cython.const[cython.double][:, ::1],
    ) -> cython.void:
        n = self._rest.shape[0]
        if xy.shape[0] != n or xy.shape[1] != 2 or seen.shape[0] != n:
            raise ValueError(f"xy ({n}, 2) and seen ({n},) are wanted")
        if not 0 < places.shape[0] <= _FITS_MAX or places.shape[1] != 2:
            raise ValueError(
                f"places (1 to {FITS_MAX}, 2) are wanted, not ({places.shape[0]}, {places.shape[1]})"
            )

    @cython.cfunc
    def _take_motion(self, xy: cython.const[cython.double][:, ::1]) -> cython.void:
        """Take the motion of the pins that count."""
        for i in range(self.n_pins):
            p = self._pin[i]
            self._motion[i, 0] = xy[p, 0] / self._pitch_px - self._rest[p, 0]
            self._motion[i, 1] = xy[p, 1] / self._pitch_px - self._rest[p, 1]

    def fit_points(
        self,
        starts: cython.const[cython.double][:, ::1],
        n: cython.Py_ssize_t,
        limit: cython.double = _NO_LIMIT,
    ) -> float:
        """Fit round contacts.

        starts   (n or more, 2) float64 px, where to begin
        n        contacts, 1 to FITS_MAX
        limit    squared error, in squared pitches, above which the result is of no use
        Returns  the squared error left, in squared pitches; 0 where no pin counts
        Raises   ValueError: another number of contacts
        """
        if not 0 < n <= _FITS_MAX or starts.shape[0] < n or starts.shape[1] != 2:
            raise ValueError(f"starts (1 to {FITS_MAX}, 2) are wanted, and n of them: {n}")
        self._m, self._is_line, self._limit = n, False, limit
        self._clear()
        for i in range(n):
            self._start[self._own * i] = starts[i, 0] / self._pitch_px
            self._start[self._own * i + 1] = starts[i, 1] / self._pitch_px
        return self._solve()

    def fit_line(
        self,
        x: cython.double,
        y: cython.double,
        half_x: cython.double,
        half_y: cython.double,
        limit: cython.double = _NO_LIMIT,
        evenly: cython.bint = False,
    ) -> float:
        """Fit one long contact.

        x, y, half_x, half_y  px, where to begin: the middle, and half of the line
        limit                 as of `fit_points`
        evenly                with an even pressure along it, not Hertz's
        Returns               the squared error left, in squared pitches; 0 where no pin counts
        """
        self._m, self._is_line, self._evenly, self._limit = 1, True, evenly, limit
        self._clear()
        self._start[0] = x / self._pitch_px
        self._start[1] = y / self._pitch_px
        for i in range(4, 8):
            # A line and its shear, which pins show well, as a width; dots move less than pins.
            self._scale[i] = self._prior[3 if self._own == _OWN_OF_DOT else 2]
        self._start[6] = half_x / self._pitch_px
        self._start[7] = half_y / self._pitch_px
        return self._solve()

    def last_error(self, points: cython.Py_ssize_t) -> float:
        """The motion that so many points, 0 a line, leave as they were fitted last, in whatever frame.

        points   1 to FITS_MAX, or 0
        Returns  squared error, squared pitches; infinite: they were not fitted yet
        Raises   ValueError: another number
        """
        if not 0 <= points <= _FITS_MAX:
            raise ValueError(f"0 to {FITS_MAX} points are wanted, not {points}")
        if not self._is_known[points]:
            return _NO_LIMIT
        self._m, self._is_line, self._evenly = max(points, 1), points == 0, False
        return self._explain(self._last[points], False)

    def left_over(self) -> Array:
        """(n, 2) float64 pitches, the motion that the last fit left; 0 of pins that do not count; new."""
        all_left = np.zeros((self._rest.shape[0], 2))
        self._explain(self._now, False)
        all_left[np.asarray(self._pin)[: self.n_pins]] = np.asarray(self._left)[: self.n_pins]
        return all_left

    @cython.cfunc
    def _clear(self) -> cython.void:
        """Parameters to begin with, but for places and lines; and their priors."""
        for i in range(self._m):
            for j in range(self._own):
                self._start[self._own * i + j] = 0.0
                self._scale[self._own * i + j] = self._prior[j]
            self._start[self._own * i + 2] = log(self._width)
            if self._own == _OWN_OF_DOT:
                self._start[self._own * i + 10] = log(self._core)
        for j in range(self._own * self._m, self._own * self._m + _COMMON):
            self._start[j] = 0.0
            self._scale[j] = self._prior[3]

    @cython.cfunc
    def _solve(self) -> cython.double:
        """Fit, and write the results."""
        size = self._own * self._m + _COMMON
        shape = self._m if not self._is_line else _EVEN if self._evenly else 0
        if not (self._follow(shape) and self._descend_on()):
            self._now[:size] = self._start[:size]
            self._sum_up()
            # Strengths are zero still: the first step finds them, with places, widths and a line as they are.
            self._find_step(0.0)
            self._now[:size] = self._next[:size]
            if self._is_line:
                self._now[6:8] = self._start[6:8]
            self._descend()
        self._last[shape, :size] = self._now[:size]
        self._is_known[shape] = True
        self._write()
        return self._error

    @cython.cfunc
    def _descend_on(self) -> cython.bint:
        """Two steps at most from an earlier frame's optimum, since more of them often end in another one.
        Whether they end in an optimum, or out of reach of the limit.
        """
        size = self._own * self._m + _COMMON
        self._error = self._sum_up()
        for left in range(1, -1, -1):
            if not self._find_step(0.0):
                break
            before = self._error
            other = self._explain(self._next, False)
            if other < before:
                self._now[:size] = self._next[:size]
                self._error = other
            self.least = self._error
            if abs(before - self._promise - other) < _ENOUGH * other:
                return True
            self.least = max(self._error - self._promise, 0.0)
            if self.least > self._limit:
                return True
            if not other < before:
                break
            if left:
                self._sum_up()
        return False

    @cython.cfunc
    def _descend(self) -> cython.void:
        """Steps while they gain."""
        size = self._own * self._m + _COMMON
        damping = _DAMPING
        steps = size  # so that a frame's time is bounded
        self._error = self._sum_up()
        while steps:  # what a step promises falls with its damping, and ends it
            steps -= 1
            before = self._error
            other = self._explain(self._next, False) if self._find_step(damping) else before
            if not other < before:
                if self._promise < _ENOUGH * before:
                    break
                damping *= 10.0
                continue
            self._now[:size] = self._next[:size]
            self._error = other
            if before - other < _ENOUGH * before and damping < _DAMPING:  # a damped step is short by itself
                break
            damping *= 0.1
            if steps:
                self._sum_up()
        self.least = self._error

    @cython.cfunc
    def _follow(self, shape: cython.Py_ssize_t) -> cython.bint:
        """Begin where the last frame's fit ended; False: there is none, or not near where to begin."""
        own = self._own * self._m
        if not self._is_known[shape]:
            return False
        for i in range(self._m):
            self._is_taken[i] = False
        for p in range(0, own, self._own):
            nearest, least = -1, self._reach
            for j in range(self._m):
                far = hypot(
                    self._last[shape, self._own * j] - self._start[p],
                    self._last[shape, self._own * j + 1] - self._start[p + 1],
                )
                if far <= least and not self._is_taken[j]:
                    nearest, least = j, far
            if nearest < 0:
                return False
            self._is_taken[nearest] = True
            self._now[p : p + self._own] = self._last[shape, self._own * nearest : self._own * (nearest + 1)]
        self._now[own : own + _COMMON] = self._last[shape, own : own + _COMMON]
        return True

    @cython.cfunc
    def _sum_up(self) -> cython.double:
        """Normal equations at the present parameters; the squared error."""
        size = self._own * self._m + _COMMON
        n = 2 * self.n_pins
        h: cython.double[:, ::1] = self._normal
        cost: cython.double = self._explain(self._now, True)
        if n % 4:
            self._rows[n : n + 2, : size + 1] = 0.0
            n += 2
        for j in range(size + 1):
            for k in range(j + 1):
                h[j, k] = 0.0
        for j in range(size):
            h[j, j] = self._scale[j] * self._scale[j]
            h[size, j] = -h[j, j] * self._off(self._now, j)
        self._sum_products(n, size + 1)
        return cost

    @cython.cfunc
    def _sum_products(self, n: cython.Py_ssize_t, columns: cython.Py_ssize_t) -> cython.void:
        """Add the products of each two columns of the first n rows to `_normal`, four rows at a time: n
        and the width are multiples of 4. What is above the diagonal is of no use.
        """
        rows: cython.double[:, ::1] = self._rows
        sums: cython.double[:, ::1] = self._normal
        for i in range(0, n, 4):
            for j in range(columns):
                a, b, c, d = rows[i, j], rows[i + 1, j], rows[i + 2, j], rows[i + 3, j]
                for k in range(j // 4 * 4 + 4):
                    sums[j, k] += (a * rows[i, k] + b * rows[i + 1, k]) + (
                        c * rows[i + 2, k] + d * rows[i + 3, k]
                    )

    @cython.cfunc
    def _explain(self, parameters: cython.double[::1], derive: cython.bint) -> cython.double:
        """The pins' motion that contacts and affine motion leave, and its rows; the squared error."""
        base = self._own * self._m
        cost: cython.double = 0.0
        rows: cython.double[:, ::1] = self._rows
        left: cython.double[:, ::1] = self._left
        for j in range(base + _COMMON):
            off = self._scale[j] * self._off(parameters, j)
            cost += off * off
        for i in range(self.n_pins):
            x = (self._place[i, 0] - self._middle_x) / self._radius
            y = (self._place[i, 1] - self._middle_y) / self._radius
            if derive:
                rows[2 * i, base] = rows[2 * i + 1, base + 3] = 1.0
                rows[2 * i, base + 1] = rows[2 * i + 1, base + 4] = x
                rows[2 * i, base + 2] = rows[2 * i + 1, base + 5] = y
                rows[2 * i, base + 3] = rows[2 * i, base + 4] = rows[2 * i, base + 5] = 0.0
                rows[2 * i + 1, base] = rows[2 * i + 1, base + 1] = rows[2 * i + 1, base + 2] = 0.0
            off = x * parameters[base + 4] + y * parameters[base + 5]
            left[i, 0] = self._motion[i, 0] - (
                parameters[base] + x * parameters[base + 1] + y * parameters[base + 2]
            )
            left[i, 1] = self._motion[i, 1] - (parameters[base + 3] + off)
        if self._own == _OWN_OF_DOT:
            for j in range(self._m):
                self._add_core(parameters, self._own * j, derive)
                self._add_bulge(parameters, self._own * j, derive)
        elif self._is_line:
            self._add_line(parameters, derive)
        else:
            for j in range(self._m):
                self._add_point(parameters, self._own * j, derive)
        for i in range(self.n_pins):
            cost += left[i, 0] * left[i, 0] + left[i, 1] * left[i, 1]
            if derive:
                rows[2 * i, base + _COMMON], rows[2 * i + 1, base + _COMMON] = left[i, 0], left[i, 1]
        return cost

    @cython.cfunc
    def _off(self, parameters: cython.double[::1], j: cython.Py_ssize_t) -> cython.double:
        """How far a parameter is from its prior's mean: that of a width is where the fit begins."""
        if j < self._own * self._m and (j % self._own == 2 or j % self._own == 10):
            return parameters[j] - self._start[j]
        return parameters[j]

    @cython.cfunc
    def _add_point(
        self, parameters: cython.double[::1], p: cython.Py_ssize_t, derive: cython.bint
    ) -> cython.void:
        """Take away the motion by a round contact, and write its derivatives."""
        rows: cython.double[:, ::1] = self._rows
        left: cython.double[:, ::1] = self._left
        s = exp(parameters[p + 2])
        i1 = 1.0 / s
        i2 = i1 * i1
        a = parameters[p + 3] * i1
        tx = parameters[p + 4]
        ty = parameters[p + 5]
        vx = parameters[p + 6] * i2
        vy = parameters[p + 7] * i2
        for i in range(self.n_pins):
            dx, dy = self._place[i, 0] - parameters[p], self._place[i, 1] - parameters[p + 1]
            r2 = (dx * dx + dy * dy) * i2
            f = 1.0 / (1.0 + 0.5 * r2)
            g = f * f
            across = vx * dx + vy * dy
            push = a + across  # both move along d
            left[i, 0] -= push * g * dx + tx * f
            left[i, 1] -= push * g * dy + ty * f
            if not derive:
                continue
            # Along the distance: f changes by -f^2 d / s^2, f^2 by -2 f^3 d / s^2.
            g3 = 2.0 * g * f
            fx, fy = -g * dx * i2, -g * dy * i2
            gx, gy = -g3 * dx * i2, -g3 * dy * i2
            q, r = 2 * i, 2 * i + 1
            rows[q, p] = -(push * (g + gx * dx) + vx * g * dx + tx * fx)
            rows[q, p + 1] = -(push * gy * dx + vy * g * dx + tx * fy)
            rows[r, p] = -(push * gx * dy + vx * g * dy + ty * fx)
            rows[r, p + 1] = -(push * (g + gy * dy) + vy * g * dy + ty * fy)
            # The derivative by the logarithm of the width: f changes by f^2 r^2 / s^2.
            fs = g * r2
            gs = push * g3 * r2 - (a + 2.0 * across) * g
            rows[q, p + 2], rows[r, p + 2] = gs * dx + tx * fs, gs * dy + ty * fs
            rows[q, p + 3], rows[r, p + 3] = g * dx * i1, g * dy * i1
            rows[q, p + 4], rows[r, p + 4] = f, 0.0
            rows[q, p + 5], rows[r, p + 5] = 0.0, f
            rows[q, p + 6], rows[r, p + 7] = -fx * dx, -fy * dy
            rows[q, p + 7] = rows[r, p + 6] = -fx * dy

    @cython.cfunc
    def _add_line(self, parameters: cython.double[::1], derive: cython.bint) -> cython.void:
        """The same by a line: weighted sums over its nodes."""
        rows: cython.double[:, ::1] = self._rows
        left: cython.double[:, ::1] = self._left
        sums: cython.double[:, ::1] = self._sums
        i1 = exp(-parameters[2])
        i2 = i1 * i1
        a = parameters[3] * i1
        tx = parameters[4]
        ty = parameters[5]
        for i in range(self.n_pins):
            self._sum_nodes(i, parameters, i2, derive)
            f0, kx, ky = sums[i, 0], sums[i, 1], sums[i, 2]
            left[i, 0] -= a * kx + tx * f0
            left[i, 1] -= a * ky + ty * f0
            if not derive:
                continue
            q, r = 2 * i, 2 * i + 1
            # Along d, f changes by -f^2 d / s^2; d by the place, and by z times half of the line.
            rows[q, 0], rows[r, 0] = tx * i2 * kx - a * sums[i, 3], ty * i2 * kx - a * sums[i, 4]
            rows[q, 1], rows[r, 1] = tx * i2 * ky - a * sums[i, 4], ty * i2 * ky - a * sums[i, 5]
            fs = sums[i, 11]
            rows[q, 2], rows[r, 2] = a * (sums[i, 12] - kx) + tx * fs, a * (sums[i, 13] - ky) + ty * fs
            rows[q, 3], rows[r, 3] = kx * i1, ky * i1
            rows[q, 4], rows[r, 4] = f0, 0.0
            rows[q, 5], rows[r, 5] = 0.0, f0
            kx, ky = i2 * sums[i, 6], i2 * sums[i, 7]
            rows[q, 6], rows[r, 6] = tx * kx - a * sums[i, 8], ty * kx - a * sums[i, 9]
            rows[q, 7], rows[r, 7] = tx * ky - a * sums[i, 9], ty * ky - a * sums[i, 10]

    @cython.cfunc
    def _add_core(
        self, parameters: cython.double[::1], p: cython.Py_ssize_t, derive: cython.bint
    ) -> cython.void:
        """Take away the motion by a contact's core; its derivatives begin those of the contact."""
        rows: cython.double[:, ::1] = self._rows
        left: cython.double[:, ::1] = self._left
        core: cython.double[6] = [0.0] * 6
        for i in range(self.n_pins):
            x, y = self._place[i, 0] - parameters[p], self._place[i, 1] - parameters[p + 1]
            self._find_core(parameters, p, x, y, core)
            cx = parameters[p + 8] + parameters[p + 11] * x
            cy = parameters[p + 9] + parameters[p + 11] * y
            left[i, 0] -= cx * core[0]
            left[i, 1] -= cy * core[0]
            if not derive:
                continue
            q, r = 2 * i, 2 * i + 1
            own = parameters[p + 11] * core[0]
            rows[q, p], rows[q, p + 1] = -cx * core[1] - own, -cx * core[2]
            rows[r, p], rows[r, p + 1] = -cy * core[1], -cy * core[2] - own
            for j in range(2, 6):
                rows[q, p + j] = rows[r, p + j] = 0.0
            rows[q, p + 6], rows[q, p + 7] = cx * core[3], cx * core[4]
            rows[r, p + 6], rows[r, p + 7] = cy * core[3], cy * core[4]
            rows[q, p + 8], rows[q, p + 9] = core[0], 0.0
            rows[r, p + 8], rows[r, p + 9] = 0.0, core[0]
            rows[q, p + 10], rows[r, p + 10] = cx * core[5], cy * core[5]
            rows[q, p + 11], rows[r, p + 11] = core[0] * x, core[0] * y

    @cython.cfunc
    def _add_bulge(
        self, parameters: cython.double[::1], p: cython.Py_ssize_t, derive: cython.bint
    ) -> cython.void:
        """Take away the motion of dots round a point, or a line; its derivatives are added to the core's."""
        rows: cython.double[:, ::1] = self._rows
        left: cython.double[:, ::1] = self._left
        z: cython.double = 0.0
        weight: cython.double = 1.0
        i1 = exp(-parameters[p + 2])
        i2 = i1 * i1
        a = parameters[p + 3] * i1
        tx, ty = parameters[p + 4], parameters[p + 5]
        for i in range(self.n_pins):
            q, r = 2 * i, 2 * i + 1
            for k in range(_NODES if self._is_line else 1):
                if self._is_line:
                    z, weight = self._node[k], self._weight[1 if self._evenly else 0, k]
                dx = self._place[i, 0] - parameters[p] - z * parameters[p + 6]
                dy = self._place[i, 1] - parameters[p + 1] - z * parameters[p + 7]
                r2 = (dx * dx + dy * dy) * i2
                f = 1.0 / (1.0 + 0.5 * r2)
                wf = weight * f
                g = f * wf
                left[i, 0] -= a * g * dx + tx * wf
                left[i, 1] -= a * g * dy + ty * wf
                if not derive:
                    continue
                # Along d, f changes by -f^2 d / s^2, and f^2 by -2 f^3 d / s^2.
                g3 = 2.0 * g * f
                x, y = -i2 * (a * g3 * dx + g * tx), -i2 * (a * g3 * dy + g * ty)
                xx, xy, yx, yy = a * g + x * dx, x * dy, y * dx, a * g + y * dy
                rows[q, p] -= xx
                rows[q, p + 1] -= xy
                rows[r, p] -= yx
                rows[r, p + 1] -= yy
                rows[q, p + 6] -= z * xx
                rows[q, p + 7] -= z * xy
                rows[r, p + 6] -= z * yx
                rows[r, p + 7] -= z * yy
                push = a * (g3 * r2 - g)
                rows[q, p + 2] += push * dx + tx * g * r2
                rows[r, p + 2] += push * dy + ty * g * r2
                rows[q, p + 3] += g * dx * i1
                rows[r, p + 3] += g * dy * i1
                rows[q, p + 4] += wf
                rows[r, p + 5] += wf

    @cython.cfunc
    @cython.exceptval(check=False)
    def _find_core(
        self,
        parameters: cython.double[::1],
        p: cython.Py_ssize_t,
        x: cython.double,
        y: cython.double,
        out: cython.p_double,
    ) -> cython.void:
        """The core at a distance from the middle of a point, or of a line, along which it is even; 1 in the
        middle. Written are it, and its derivatives: along x and y; by half of the line, x and y; by log b.
        """
        b = exp(parameters[p + 10])
        half = hypot(parameters[p + 6], parameters[p + 7]) / b
        u, v = x / b, y / b
        if not self._is_line or half < _POINT:
            out[0] = exp(-0.5 * (u * u + v * v))
            out[1], out[2] = -out[0] * u / b, -out[0] * v / b
            out[3] = out[4] = 0.0
            out[5] = out[0] * (u * u + v * v)
            return
        nx, ny = parameters[p + 6] / (half * b), parameters[p + 7] / (half * b)
        along, across = nx * u + ny * v, nx * v - ny * u
        whole = erf(half * _ROOT_HALF)
        beside = exp(-0.5 * across * across) / whole
        core = 0.5 * beside * (erf((along + half) * _ROOT_HALF) - erf((along - half) * _ROOT_HALF))
        left, right = exp(-0.5 * (along + half) ** 2), exp(-0.5 * (along - half) ** 2)
        by_along = beside * (left - right) * _NORMAL
        by_half = beside * (left + right) * _NORMAL - core * 2.0 * _NORMAL * exp(-0.5 * half * half) / whole
        by_turn = across * (by_along + along * core) / half
        out[0] = core
        out[1] = (nx * by_along + ny * across * core) / b
        out[2] = (ny * by_along - nx * across * core) / b
        out[3] = (nx * by_half - ny * by_turn) / b
        out[4] = (ny * by_half + nx * by_turn) / b
        out[5] = -(along * by_along - across * across * core + half * by_half)

    @cython.cfunc
    @cython.exceptval(check=False)
    def _sum_nodes(
        self, i: cython.Py_ssize_t, parameters: cython.double[::1], i2: cython.double, derive: cython.bint
    ) -> cython.void:
        """Weighted sums of pin i over the line's nodes, with d from the node and f = 1 / (1 + d^2 i2 / 2):

        0 f; 1, 2 k = f^2 d; 3-5 how k changes with d: xx, xy, yy; 6-10 k and these, times the node;
        11 f^2 d^2 i2; 12, 13 2 f^3 d^2 i2 d. Without derivatives only the first three.
        """
        s: cython.double[14] = [0.0] * 14
        x = self._place[i, 0] - parameters[0]
        y = self._place[i, 1] - parameters[1]
        for k in range(_NODES):
            z = self._node[k]
            dx, dy = x - z * parameters[6], y - z * parameters[7]
            r2 = (dx * dx + dy * dy) * i2
            f = 1.0 / (1.0 + 0.5 * r2)
            wf = f * self._weight[1 if self._evenly else 0, k]
            g = f * wf
            gx, gy = g * dx, g * dy
            s[0] += wf
            s[1] += gx
            s[2] += gy
            if not derive:
                continue
            g3 = 2.0 * i2 * f
            gxx, gxy, gyy = g - g3 * gx * dx, -g3 * gx * dy, g - g3 * gy * dy
            s[3] += gxx
            s[4] += gxy
            s[5] += gyy
            s[6] += z * gx
            s[7] += z * gy
            s[8] += z * gxx
            s[9] += z * gxy
            s[10] += z * gyy
            turn = 2.0 * f * r2
            s[11] += g * r2
            s[12] += turn * gx
            s[13] += turn * gy
        for k in range(14):
            self._sums[i, k] = s[k]

    @cython.cfunc
    def _find_step(self, damping: cython.double) -> cython.bint:
        """`_next`, by one damped step (Cholesky), and `_promise`; False: it is not positive definite."""
        size = self._own * self._m + _COMMON
        d: cython.double[:, ::1] = self._damped
        step: cython.double[::1] = self._step
        total: cython.double
        promise: cython.double = 0.0
        self._promise = _NO_LIMIT
        for i in range(size):
            for j in range(i + 1):
                total = self._normal[i, j]
                if i == j:
                    total += damping * total + 1e-12
                for k in range(j):
                    total -= d[i, k] * d[j, k]
                if i == j:
                    if not total > 0.0:
                        return False
                    d[i, i] = sqrt(total)
                else:
                    d[i, j] = total / d[j, j]
            total = self._normal[size, i]
            for k in range(i):
                total -= d[i, k] * step[k]
            step[i] = total / d[i, i]
            promise += step[i] * step[i]
        self._promise = promise
        for i in range(size - 1, -1, -1):
            total = step[i]
            for k in range(i + 1, size):
                total -= d[k, i] * step[k]
            step[i] = total / d[i, i]
            self._next[i] = self._now[i] + step[i]
        for i in range(self._m):
            self._confine(self._own * i)
        return True

    @cython.cfunc
    def _confine(self, p: cython.Py_ssize_t) -> cython.void:
        """A contact stays near where it was looked for, of a width that pins can show."""
        dx = self._next[p] - self._start[p]
        dy = self._next[p + 1] - self._start[p + 1]
        far = hypot(dx, dy)
        if far > self._reach:
            self._next[p] = self._start[p] + dx * self._reach / far
            self._next[p + 1] = self._start[p + 1] + dy * self._reach / far
        most = log(self._radius)
        self._next[p + 2] = min(max(self._next[p + 2], -most), most)
        if self._own == _OWN_OF_DOT:
            self._next[p + 10] = min(max(self._next[p + 10], -most), most)
        if self._is_line:
            far = hypot(self._next[p + 6], self._next[p + 7])
            if far > self._radius:
                self._next[p + 6] *= self._radius / far
                self._next[p + 7] *= self._radius / far

    @cython.cfunc
    def _write(self) -> cython.void:
        for i in range(self._m):
            self.place[i, 0] = self._now[self._own * i] * self._pitch_px
            self.place[i, 1] = self._now[self._own * i + 1] * self._pitch_px
            self.width[i] = exp(self._now[self._own * i + 2])
            self.height[i] = self._now[self._own * i + 3] * self.width[i]
            for j in range(2):
                self.shear[i, j] = self._now[self._own * i + 4 + j]
                self.dipole[i, j] = self._now[self._own * i + 6 + j]
            if self._own == _OWN_OF_DOT:
                self.core[i] = exp(self._now[self._own * i + 10])
        for i in range(self._m):
            self.total[i] = 0.0
            for j in range(self._m):
                dx = self._now[self._own * i] - self._now[self._own * j]
                dy = self._now[self._own * i + 1] - self._now[self._own * j + 1]
                s = self.width[j]
                self.total[i] += self.height[j] / (1.0 + 0.5 * (dx * dx + dy * dy) / (s * s))
