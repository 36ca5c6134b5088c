r"""An elastic half-space under balls and bars: displacement of its surface, from the textbook.

             tool            z out of the gel; the surface is z = 0, w its indentation
    ___       ___  ___ u     u along the surface
       \_____/    w          every load is a sum of flat round punches (radius s, approach d):

    normal      w = d inside, d 2/pi asin(s/r) outside
    tangential  u = d inside; outside d 2/pi (asin(s/r) + k s/r sqrt(1 - s^2/r^2) cos 2t) along the load and
                the same k with sin 2t across it; k = nu / (2 - nu), t the angle from the load

- Ball: d = 2 s ds / R over 0 < s < a gives Hertz's pressure.
- Sheared ball: kappa times the same over c < s < a gives Cattaneo's and Mindlin's partial slip,
  kappa = friction (2 - nu) / (2 (1 - nu)); c = 0 where all of the contact slides.
- Twisted ball: a punch of radius s that turns by b turns the surface by b inside, and outside by
  b 2/pi (asin(s/r) - s/r sqrt(1 - s^2/r^2)). Lubkin's partial slip is the sum of those over c < s < a, each
  turned by -db(s), with b(s) = friction 2 a / (pi R (1 - nu)) (K(k) - E(k)) and k^2 = 1 - s^2/a^2.
- Bar: discs of uniform pressure along a line add up to Hertz's pressure of a cylinder. It is crowned: the
  discs are smaller towards its ends, so that the contact is an ellipse and no edge digs in.
- Balls push each other's surface down: each one's own approach is its depth less what the others give
  there. The slope of that is neglected, and so is what friction adds to the indentation (none at nu = 1/2).

Independent of `calib.sim`, which computes a dome with a skin by numbers.

Source  Johnson, Contact Mechanics, chapters 3 (uniform pressure, punch under a tangential load), 4 (Hertz),
        7 (partial slip, torsion); sums of punches: Jaeger, Arch. Appl. Mech. 65, 1995
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

from edge.types import Array

POISSON = 0.48  # of soft silicone
FRICTION = 1.0  # Coulomb's, skin on tool
ROUNDS = 100  # of the balls' depths that depend on each other; ten are usual
CLOSE_MM = 1e-9
PUNCHES = 60  # whose sum is a twisted ball: its torque is right to 2 %
DISCS_PER_RADIUS = 8.0  # of a bar: over a pin's base its slope is then even to some percent
DISCS_MAX = 1600


@dataclass(frozen=True, slots=True)
class Ball:
    """A ball that is pressed in and then moved sideways.

    x_mm, y_mm   where it touched
    depth_mm     below the untouched surface
    shear_mm     x, y, of the tool after the press
    friction     Coulomb's, skin on tool
    sticks       radius within which a twisted contact sticks, as a share of its own; 1: it is not twisted
    """

    x_mm: float
    y_mm: float
    depth_mm: float
    shear_mm: tuple[float, float] = (0.0, 0.0)
    radius_mm: float = 2.0
    friction: float = FRICTION
    sticks: float = 1.0


@dataclass(frozen=True, slots=True)
class Bar:
    """A lying, crowned cylinder.

    x_mm, y_mm   its middle
    angle_rad    from x towards y
    depth_mm     of the surface under its middle
    length_mm    of the contact
    """

    x_mm: float
    y_mm: float
    angle_rad: float
    depth_mm: float
    length_mm: float = 12.0
    radius_mm: float = 2.0


@dataclass(frozen=True, slots=True)
class Surface:
    """Displacement of points of the surface.

    along_mm   (n, 2), in the surface
    w_mm       (n,), inwards
    slope      (n, 2), gradient of w_mm
    """

    along_mm: Array
    w_mm: Array
    slope: Array

    def __add__(self, other: "Surface") -> "Surface":
        return Surface(self.along_mm + other.along_mm, self.w_mm + other.w_mm, self.slope + other.slope)


def displace(xy_mm: Array, tools: Sequence[Ball | Bar]) -> Surface:
    """Displacement of the surface at (n, 2) mm under all tools at once."""
    total = Surface(np.zeros((len(xy_mm), 2)), np.zeros(len(xy_mm)), np.zeros((len(xy_mm), 2)))
    balls = [tool for tool in tools if isinstance(tool, Ball)]
    for ball, own_mm in zip(balls, own_depths_mm(balls), strict=True):
        if own_mm > 0.0:
            total += _under_ball(xy_mm, ball, own_mm)
    for tool in tools:
        if isinstance(tool, Bar):
            total += _under_bar(xy_mm, tool)
    return total


def own_depths_mm(balls: Sequence[Ball]) -> Array:
    """(k,) approach of each ball to the surface that the others have pushed down; 0: it does not touch."""
    depth = np.array([ball.depth_mm for ball in balls])
    place = np.array([(ball.x_mm, ball.y_mm) for ball in balls]).reshape(-1, 2)
    own = depth
    for _ in range(ROUNDS):
        before, others = own, np.zeros(len(balls))
        for j, ball in enumerate(balls):
            given = _ball_profile(np.hypot(*(place - place[j]).T), before[j], ball.radius_mm)[0]
            given[j] = 0.0
            others += given
        own = np.maximum(depth - others, 0.0)
        if np.allclose(own, before, rtol=0.0, atol=CLOSE_MM):
            break
    return np.asarray(own, np.float64)


def _ball_profile(r: Array, depth_mm: float, radius_mm: float) -> tuple[Array, Array]:
    """Indentation (n,) and its slope outwards (n,) at distances r from a ball's middle."""
    a = np.sqrt(radius_mm * depth_mm)
    m = np.minimum(a, r)
    angle, root = _arcsine(m, r), np.sqrt(r * r - m * m)
    inside = (a * a - m * m) / 2.0
    w = 2.0 / radius_mm * (2.0 / np.pi * ((m * m / 2.0 - r * r / 4.0) * angle + m / 4.0 * root) + inside)
    slope = -2.0 / (np.pi * radius_mm) * (r * angle - _over(m * root, r))
    return w, slope


def _under_ball(xy_mm: Array, ball: Ball, own_mm: float) -> Surface:
    d = xy_mm - (ball.x_mm, ball.y_mm)
    r = np.hypot(d[:, 0], d[:, 1])
    outwards = _over(d, r[:, None])
    w, slope = _ball_profile(r, own_mm, ball.radius_mm)
    # Along the surface the pressure moves it inwards by what presses within r.
    a = np.sqrt(ball.radius_mm * own_mm)
    within = 1.0 - (1.0 - np.minimum(r / a, 1.0) ** 2) ** 1.5
    inwards = (1.0 - 2.0 * POISSON) / (1.0 - POISSON) * _over(2.0 * a**3 * within, 3.0 * np.pi * r)
    along = -outwards * (inwards / ball.radius_mm)[:, None]
    shear_mm = float(np.hypot(*ball.shear_mm))
    if shear_mm > 0.0:
        along += _dragged(d, r, ball, own_mm, shear_mm)
    if ball.sticks < 1.0:
        along += _twisted(d, r, ball, own_mm)
    return Surface(along, w, outwards * slope[:, None])


def drag_rel(friction: float) -> float:
    """How far a ball is dragged until all of its contact slides, as a share of its depth."""
    return friction * (2.0 - POISSON) / (2.0 * (1.0 - POISSON))


def twist_rad(ball: Ball, own_mm: float, sticks: Array) -> Array:
    """By how much a ball is twisted when it sticks within these shares of the contact's radius."""
    m = 1.0 - sticks * sticks
    a = np.sqrt(ball.radius_mm * own_mm)
    scale = ball.friction * 2.0 * a / (np.pi * ball.radius_mm * (1.0 - POISSON))
    return np.asarray(scale * (ellipk(m) - ellipe(m)), np.float64)


def _twisted(d: Array, r: Array, ball: Ball, own_mm: float) -> Array:
    """(n, 2) displacement along the surface by the friction of a ball that turns from x towards y."""
    edges = np.linspace(ball.sticks, 1.0, PUNCHES + 1)
    turns = -np.diff(twist_rad(ball, own_mm, edges))
    radii = np.sqrt(ball.radius_mm * own_mm) * 0.5 * (edges[:-1] + edges[1:])
    share = radii / np.maximum(r[:, None], radii)
    turned = 2.0 / np.pi * (np.arcsin(share) - share * np.sqrt(1.0 - share * share)) @ turns
    return np.asarray(turned[:, None] * np.column_stack([-d[:, 1], d[:, 0]]), np.float64)


def _dragged(d: Array, r: Array, ball: Ball, own_mm: float, shear_mm: float) -> Array:
    """(n, 2) displacement along the surface by a ball's friction."""
    kappa = drag_rel(ball.friction)
    outer = np.sqrt(ball.radius_mm * own_mm)
    inner = outer * np.sqrt(max(0.0, 1.0 - shear_mm / (kappa * own_mm)))
    way = np.array(ball.shear_mm) / shear_mm
    cos, sin = _over(d @ way, r), _over(d @ (-way[1], way[0]), r)
    even, odd = (big - small for big, small in zip(_drag_sums(r, outer), _drag_sums(r, inner), strict=True))
    scale = 2.0 * kappa / ball.radius_mm
    forwards = scale * (even + odd * (cos * cos - sin * sin))
    across = scale * odd * 2.0 * sin * cos
    return np.asarray(forwards[:, None] * way + across[:, None] * (-way[1], way[0]), np.float64)


def _drag_sums(r: Array, a: float) -> tuple[Array, Array]:
    """Integrals of s ds over punches up to a: of the part that is even all round, and of that of 2 t."""
    m = np.minimum(a, r)
    angle, root = _arcsine(m, r), np.sqrt(r * r - m * m)
    even = 2.0 / np.pi * ((m * m / 2.0 - r * r / 4.0) * angle + m / 4.0 * root) + (a * a - m * m) / 2.0
    odd = _over(m * (2.0 * m * m - r * r) * root, 8.0 * r * r) + r * r / 8.0 * angle
    return even, 2.0 / np.pi * POISSON / (2.0 - POISSON) * odd


def _under_bar(xy_mm: Array, bar: Bar) -> Surface:
    """Indentation alone: the pressure moves the surface sideways by a hundredth of it."""

    def at_middle(a: float) -> float:
        return float(_bar_profile(np.zeros((1, 2)), a, bar)[0][0]) - bar.depth_mm

    half_width = float(brentq(at_middle, 1e-6, 10.0 * bar.radius_mm))
    cos, sin = np.cos(bar.angle_rad), np.sin(bar.angle_rad)
    turn = np.array([[cos, sin], [-sin, cos]])
    w, slope = _bar_profile((xy_mm - (bar.x_mm, bar.y_mm)) @ turn.T, half_width, bar)
    return Surface(np.zeros((len(xy_mm), 2)), w, slope @ turn)


def _bar_profile(d: Array, half_width: float, bar: Bar) -> tuple[Array, Array]:
    """Indentation (n,) and its gradient (n, 2) at (n, 2) along and across a bar."""
    n = min(int(np.ceil(DISCS_PER_RADIUS * bar.length_mm / half_width)), DISCS_MAX)
    step = bar.length_mm / n
    middles = (np.arange(n) + 0.5) * step - bar.length_mm / 2.0
    a = half_width * np.sqrt(1.0 - (2.0 * middles / bar.length_mm) ** 2)
    x = d[:, :1] - middles
    r = np.maximum(np.hypot(x, d[:, 1:]), CLOSE_MM)
    m = np.minimum(np.minimum(r / a, a / r) ** 2, 1.0 - 1e-9)  # the modulus squared, as SciPy has it
    e, k = ellipe(m), ellipk(m)
    inside = r < a
    scale = a * step / (np.pi * bar.radius_mm)
    w = scale * np.where(inside, e, r / a * (e - (1.0 - m) * k))
    slope = scale * np.where(inside, a / r, 1.0) * (e - k) / a / r
    return w.sum(axis=1), np.column_stack([(slope * x).sum(axis=1), (slope * d[:, 1:]).sum(axis=1)])


def _over(top: Array, bottom: Array) -> Array:
    """top / bottom, 0 where the bottom is: all that is divided by a distance here vanishes with it."""
    shape = np.broadcast_shapes(top.shape, bottom.shape)
    return np.divide(top, bottom, out=np.zeros(shape), where=np.broadcast_to(bottom > 0.0, shape))


def _arcsine(m: Array, r: Array) -> Array:
    return np.arcsin(np.clip(_over(m, r), 0.0, 1.0))
