"""The tip's compliance: displacements of the skin by forces on it.

The gel is incompressible and clear, the skin a thin cover. For an incompressible half-space the surface
displacement by a surface force (Boussinesq, Cerruti at Poisson's ratio 1/2) is exactly twice Stokes'
kernel, so that kernel, taken between points of the dome and smoothed over the skin's thickness as
Cortez' regularised Stokeslet, is the compliance: u = K f, symmetric and positive. Clamping the rim
multiplies rows and columns by `Tip.mobility`, the finite gel fades it over `Tip.reach_mm`; both keep it so.

The closed tip keeps its volume: a uniform pressure b of the gel pushes back, K - (K b)(K b)' / (b'K b),
which is K under the constraint that the pressed-in volume comes out elsewhere (`Tip.closed` of it).

Units: shear modulus 1, so forces are in units of modulus x mm2.
Sources  Johnson, "Contact Mechanics", chapter 3; Cortez, Fauci, Medovikov, Phys. Fluids 17, 031504 (2005).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from calib.sim.tip import Tip
from edge.types import Array


@dataclass(frozen=True, slots=True)
class Pairs:
    """The kernel between all pairs of cells: K_ij = (near_ij I + w_ij gap gap') for unit modulus."""

    xyz: Array  # (m, 3)
    w: Array  # (m, m)
    near: Array  # (m, m)

    @staticmethod
    def of(tip: Tip, xyz: Array, smooth: Array) -> Pairs:
        square = (xyz**2).sum(axis=1)
        r2 = np.maximum(square[:, None] + square - 2 * xyz @ xyz.T, 0)
        e2 = (smooth[:, None] ** 2 + smooth**2) / 2
        free = tip.mobility(xyz)
        both = r2 + e2
        w = free[:, None] * free * np.exp(np.sqrt(r2) / -tip.reach_mm) / (4 * np.pi * both * np.sqrt(both))
        return Pairs(xyz, w, w * (both + e2))

    def along(self, a: Array, b: Array) -> Array:
        """(m, m) displacement of cell i along a_i by unit force on cell j along b_j; a, b are (m, 3)."""
        gap_a = (self.xyz * a).sum(axis=1)[:, None] - a @ self.xyz.T
        gap_b = self.xyz @ b.T - (self.xyz * b).sum(axis=1)
        gap_a *= gap_b
        gap_a *= self.w
        gap_a += self.near * (a @ b.T)
        return np.asarray(gap_a)


def displace(tip: Tip, at: Array, source: Array, force: Array, smooth: Array) -> Array:
    """(i, 3) displacement by all forces; the same kernel between two sets of points.

    Expanded so that everything of size i x j but r2 itself is a matrix product.
    """
    r2 = ((at**2).sum(axis=1)[:, None] + (source**2).sum(axis=1)) - 2 * at @ source.T
    np.maximum(r2, 0, out=r2)
    e2 = smooth**2
    dot = at @ force.T - (source * force).sum(axis=1)  # gap . force
    fade = np.exp(np.sqrt(r2) / -tip.reach_mm)
    r2 += e2
    w = fade * tip.mobility(source) / (4 * np.pi * r2 * np.sqrt(r2))
    direct = (w * r2) @ force + w @ (force * e2[:, None])  # (r2 + 2 e2) f, where r2 holds r2 + e2
    w *= dot
    out = direct + at * w.sum(axis=1)[:, None] - w @ source
    return np.asarray(out * tip.mobility(at)[:, None])


@dataclass(frozen=True)
class Gel:
    """Response of the closed tip to a uniform pressure of the gel, tabulated over the polar angle."""

    polar: Array  # rad, increasing
    outward: Array  # displacement away from the axis, per unit pressure
    upward: Array  # and along z
    volume_per_pressure: float

    def swell(self, xyz: Array) -> Array:
        """(n, 3) displacement by unit pressure."""
        rho = np.maximum(np.hypot(xyz[:, 0], xyz[:, 1]), 1e-9)
        polar = np.arctan2(rho, xyz[:, 2])
        out = np.interp(polar, self.polar, self.outward) / rho
        return np.column_stack([xyz[:, :2] * out[:, None], np.interp(polar, self.polar, self.upward)])


@lru_cache(maxsize=8)
def gel_of(tip: Tip) -> Gel:
    """The response of this tip's gel to pressure, integrated over the dome."""
    r, lowest = tip.dome_radius_mm, np.cos(np.deg2rad(tip.rim_deg))
    # Equal-area points on the dome (Fibonacci's spiral).
    m = 1500
    z = 1 - (1 - lowest) * (np.arange(m) + 0.5) / m
    a = np.pi * (3 - 5**0.5) * np.arange(m)
    normal = np.column_stack([np.sqrt(1 - z * z) * np.cos(a), np.sqrt(1 - z * z) * np.sin(a), z])
    area = 2 * np.pi * r * r * (1 - lowest) / m
    smooth = np.full(m, max(tip.skin_mm, 0.7 * area**0.5))
    push = displace(tip, r * normal, r * normal, area * normal, smooth)
    polar = np.linspace(0, np.deg2rad(tip.rim_deg), 240)
    line = r * np.column_stack([np.sin(polar), 0 * polar, np.cos(polar)])
    table = displace(tip, line, r * normal, area * normal, smooth)
    return Gel(polar, table[:, 0], table[:, 2], float((push * normal).sum() * area) / tip.closed)
