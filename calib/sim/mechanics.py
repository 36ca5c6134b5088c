"""Indenters against the dome: which part touches, what moves, where each pin ends up.

`elastic` has the compliance of the skin, u = K f. Here are the contact problems:

    normal      find p >= 0 with  n.K n p = penetration where p > 0   (Signorini's problem, active set)
    tangential  find q with  t.K t q = shear + twist where |q| < mu p (Coulomb, with the bound of p known)
    pins        u at the root, and the skin's new normal there: the pin is a lever along it

Consequences that are not put in explicitly: pins move radially outward from the contact's place wherever that
place is, the flanks bulge, cells widen where the dome is flattened and narrow around it, shear carries
the contact's patch along and slips from its edge inwards.

Rules and limits
- Displacements superpose linearly; geometric nonlinearities (spheres' sag, rotating normals,
  perspective) are kept. Normal and tangential contact are solved one after the other.
- In directions in which a tool is flat, its place of contact follows from its tilt; in directions in which it
  is curved, from its position.
Sources  Johnson, "Contact Mechanics", chapters 5 (normal contact by numbers) and 7 (partial slip);
  Mindlin, J. Appl. Mech. 16, 259 (1949), whose spheres under a tangential force the tests compare with.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from calib.sim.elastic import Pairs, displace, gel_of
from calib.sim.tip import Tip
from edge.types import Array

TOOLS = ("flat", "sphere", "edge", "two")
# Cells across a patch. Against 44, pins of a 640x480 image lie 0.01 px off in the mean, 0.1 px at most.
GRID = 22
ACTIVE_SET_ROUNDS = 40  # a press settles in 3..8


@dataclass(frozen=True, slots=True)
class Tool:
    """A pressing tool.

    kind         "flat", "sphere", "edge" (a straight bar) or "two" (spheres side by side)
    radius_mm    of the sphere(s), or of the bar's rounded edge
    angle_deg    direction of the bar, or from the first sphere to the second; from x towards y
    distance_mm  between the two spheres' centres of contact
    """

    kind: str = "flat"
    radius_mm: float = 3.0
    angle_deg: float = 0.0
    distance_mm: float = 8.0

    def __post_init__(self) -> None:
        if self.kind not in TOOLS:
            raise ValueError(f"tool {self.kind!r} is unknown; one of {', '.join(TOOLS)}")
        if not self.radius_mm > 0:
            raise ValueError(f"tool {self.kind}: radius_mm = {self.radius_mm}; must be > 0")


@dataclass(frozen=True, slots=True)
class ToolPose:
    """One tool at one pose, in the tip's frame.

    x_mm, y_mm          where the tool touches (without meaning in directions in which it is flat)
    depth_mm            how far it is pushed in along its normal, from first touch; <= 0: no contact
    tilt_x/y_deg        rotation of the tool about the tip's x and y axes
    shear_x/y_mm        move of the tool across its normal after the press
    twist_deg           turn of the tool about its normal after the press, from x towards y
    """

    tool: Tool = Tool()
    x_mm: float = 0.0
    y_mm: float = 0.0
    depth_mm: float = 0.0
    tilt_x_deg: float = 0.0
    tilt_y_deg: float = 0.0
    shear_x_mm: float = 0.0
    shear_y_mm: float = 0.0
    twist_deg: float = 0.0


@dataclass(frozen=True, slots=True)
class Deformation:
    """The tip under load.

    tips_mm     (n, 3) where each pin's cap is now
    axes        (n, 3) unit, from the cap towards the pin's root
    places_mm   (k, 2) x, y of each place of contact on the untouched skin
    forces_n    (k,) normal force of each
    drags_n     (k, 2) friction on the skin of each, along the tip's x and y turned to the contact's normal
    torques_nmm (k,) torque of the friction about that normal at the place of contact, from x towards y
    areas_mm2   (k,) area of each
    slip        (k,) share of the contact's area that slides under the shear
    slid_mm     (k, 2) how far the tool has slid over the skin, x, y, mean over the contact's area
    """

    tips_mm: Array
    axes: Array
    places_mm: Array
    forces_n: Array
    drags_n: Array
    torques_nmm: Array
    areas_mm2: Array
    slip: Array
    slid_mm: Array


@dataclass(frozen=True, slots=True)
class _Patch:
    """Cells of one possible contact: points on the dome, frame, penetration, prescribed motion."""

    xyz: Array  # (m, 3)
    frame: Array  # (3, 3) rows: two tangents and the outward normal, at the place of contact
    depth: Array  # (m,) penetration of the undeformed surfaces, mm; negative outside
    motion: Array  # (m, 3) tangential move of the tool there, mm
    cell_mm2: float
    place: Array  # (2,)


def deform(tip: Tip, contacts: tuple[ToolPose, ...]) -> Deformation:
    """Where the pins are when these tools press all at once.

    Raises  ValueError: a tool that touches below the rim, or past the dome
    """
    patches = [p for c in contacts if c.depth_mm > 0 for p in _patches(tip, c)]
    if not patches:
        return _untouched(tip)
    xyz = np.concatenate([p.xyz for p in patches])
    owner = np.repeat(np.arange(len(patches)), [len(p.xyz) for p in patches])
    frames = np.stack([p.frame for p in patches])[owner]
    cell = np.array([p.cell_mm2 for p in patches])[owner]
    # A cell must not be sharper than its grid, or the grid would be visible in the skin.
    smooth = np.maximum(tip.skin_mm, 0.7 * np.sqrt(cell))
    pairs = Pairs.of(tip, xyz, smooth)
    gel = gel_of(tip)
    swell = gel.swell(xyz) / np.sqrt(gel.volume_per_pressure)
    layer = tip.layer_mm / cell

    normal = frames[:, 2]
    stiff = pairs.along(normal, normal)
    push = (swell * normal).sum(axis=1)
    stiff -= push[:, None] * push
    stiff[np.diag_indices_from(stiff)] += layer
    p_n = _press(stiff, np.concatenate([p.depth for p in patches]))
    force = -p_n[:, None] * normal
    live = p_n > 0
    sliding = np.zeros(len(xyz), dtype=bool)
    slipped = np.zeros_like(xyz)
    friction = np.zeros_like(xyz)
    motion = np.concatenate([p.motion for p in patches])[live]
    if motion.any():
        friction[live], sliding[live], slipped[live] = _drag(
            Pairs.of(tip, xyz[live], smooth[live]),
            swell[live],
            layer[live],
            frames[live, :2],
            motion,
            tip.friction * p_n[live],
        )
        force += friction

    tips, axes = _caps(tip, xyz[live], force[live], smooth[live], (swell * force).sum())
    k = len(patches)
    area = _sum_by(owner, np.where(live, cell, 0), k)
    slid = _sum_by(owner, np.where(live & sliding, cell, 0), k)
    unit_n = tip.shear_modulus_kpa * 1e-3
    drags_n, torques_nmm = _wrenches(tip, patches, unit_n * friction)
    return Deformation(
        tips_mm=tips,
        axes=axes,
        places_mm=np.stack([p.place for p in patches]),
        forces_n=_sum_by(owner, p_n, k) * unit_n,
        drags_n=drags_n,
        torques_nmm=torques_nmm,
        areas_mm2=area,
        slip=slid / np.maximum(area, 1e-12),
        slid_mm=np.stack([_sum_by(owner, cell * slipped[:, a], k) for a in (0, 1)], axis=1)
        / np.maximum(area, 1e-12)[:, None],
    )


def _untouched(tip: Tip) -> Deformation:
    none, pairs = np.empty(0), np.empty((0, 2))
    return Deformation(tip.tips_mm, tip.normals, pairs, none, pairs, none, none, none, pairs)


def _wrenches(tip: Tip, patches: list[_Patch], friction_n: Array) -> tuple[Array, Array]:
    """Force (k, 2) and torque (k,) of the friction of each patch, in its tangent plane.

    friction_n  (m, 3) forces on the cells of all patches, one patch after the other
    """
    drags, torques = np.empty((len(patches), 2)), np.empty(len(patches))
    ends = np.cumsum([len(patch.xyz) for patch in patches])
    for i, (patch, force) in enumerate(zip(patches, np.split(friction_n, ends[:-1]), strict=True)):
        normal = patch.frame[2]
        drags[i] = turn_z_to(normal)[:2] @ force.sum(axis=0)
        torques[i] = np.cross(patch.xyz - tip.dome_radius_mm * normal, force).sum(axis=0) @ normal
    return drags, torques


def _caps(tip: Tip, xyz: Array, force: Array, smooth: Array, swelling: float) -> tuple[Array, Array]:
    """Where the pins' caps are, and the axes from there to their roots, under forces on the skin.

    xyz, force, smooth  (m, 3), (m, 3), (m,) of the cells that are pressed
    swelling            work of these forces on the sealed gel's swelling
    """
    # The skin's displacement at the roots, and a little way along two tangents for its new normal.
    gel = gel_of(tip)
    first, second = _tangents(tip)
    step = 1e-3  # mm; the kernel is smooth over skin_mm, so this is a derivative
    probes = np.concatenate([tip.roots_mm, tip.roots_mm + step * first, tip.roots_mm + step * second])
    moved = displace(tip, probes, xyz, force, smooth)
    moved -= gel.swell(probes) * swelling / np.sqrt(gel.volume_per_pressure)
    root, one, two = moved.reshape(3, -1, 3)
    axes = np.cross(first + (one - root) / step, second + (two - root) / step)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return tip.roots_mm + root - tip.pin_length_mm * axes, axes


def _patches(tip: Tip, contact: ToolPose) -> list[_Patch]:
    tool = contact.tool
    if tool.kind != "two":
        return [_patch(tip, contact, np.zeros(2))]
    angle = np.deg2rad(tool.angle_deg)
    half = 0.5 * tool.distance_mm * np.array([np.cos(angle), np.sin(angle)])
    single = replace(tool, kind="sphere")
    return [
        _patch(
            tip,
            replace(contact, tool=single, x_mm=contact.x_mm + way[0], y_mm=contact.y_mm + way[1]),
            way,
        )
        for way in (-half, half)
    ]


def _patch(tip: Tip, contact: ToolPose, from_pivot_mm: Array) -> _Patch:
    """Cells over the ellipse in which the undeformed surfaces intersect, with a margin."""
    r, tool, depth = tip.dome_radius_mm, contact.tool, contact.depth_mm
    tx, ty = np.deg2rad([contact.tilt_x_deg, contact.tilt_y_deg])
    by_tilt = r * np.array([np.sin(ty) * np.cos(tx), -np.sin(tx)])
    by_place = np.array([contact.x_mm, contact.y_mm])
    angle = np.deg2rad(tool.angle_deg)
    along = np.array([np.cos(angle), np.sin(angle)])
    across = np.array([-along[1], along[0]])
    place = {
        "flat": by_tilt,
        "sphere": by_place,
        "edge": along * (by_tilt @ along) + across * (by_place @ across),
    }[tool.kind]
    if np.hypot(*place) > r * np.sin(np.deg2rad(tip.rim_deg)) - 1.0:
        raise ValueError(f"contact at ({place[0]:.1f}, {place[1]:.1f}) mm is at the tip's rim or past it")

    frame = turn_z_to(np.array([*place, np.sqrt(r * r - place @ place)]) / r)
    if tool.kind == "edge":  # first tangent along the bar
        u = frame[:2].T @ along
        frame = np.stack([u, np.cross(frame[2], u), frame[2]])
    # Radii of the ellipse: sag of dome and tool together reach the depth there.
    sag = {"flat": (0.0, 0.0), "sphere": (1.0, 1.0), "edge": (0.0, 1.0)}[tool.kind]
    curvature = np.array([1 / r + s / tool.radius_mm for s in sag])
    reach = np.minimum(1.1 * np.sqrt(2 * depth / curvature), 0.9 * r)
    line = (np.arange(GRID) + 0.5) / GRID * 2 - 1
    uv = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    ab = uv[(uv**2).sum(axis=1) < 1] * reach
    rho2 = (ab**2).sum(axis=1)
    bent = np.minimum((ab**2 * sag).sum(axis=1), tool.radius_mm**2)
    hanging = np.sqrt(r * r - rho2)
    penetration = depth - (r - hanging) - (tool.radius_mm - np.sqrt(tool.radius_mm**2 - bent))
    xyz = np.column_stack([ab, hanging]) @ frame
    # Shear and twist in the tool's plane; axes there are the tip's, turned with the normal.
    upright = turn_z_to(frame[2])
    flat = (xyz - r * frame[2]) @ upright[:2].T + from_pivot_mm
    phi = np.deg2rad(contact.twist_deg)
    turn = np.array([[np.cos(phi) - 1, -np.sin(phi)], [np.sin(phi), np.cos(phi) - 1]])
    motion = (flat @ turn.T + [contact.shear_x_mm, contact.shear_y_mm]) @ upright[:2]
    cell = float(4 * reach[0] * reach[1] / GRID**2)
    keep = xyz[:, 2] > r * np.cos(np.deg2rad(tip.rim_deg))
    return _Patch(xyz[keep], frame, penetration[keep], motion[keep], cell, place)


def _press(stiff: Array, depth: Array) -> Array:
    """Forces p >= 0 with stiff @ p = depth where p > 0 and stiff @ p >= depth elsewhere."""
    p = np.zeros(len(depth))
    live = depth > 0
    for _ in range(ACTIVE_SET_ROUNDS):
        p[:] = 0
        p[live] = cho_solve(cho_factor(stiff[np.ix_(live, live)]), depth[live])
        pulling = p < 0
        pierced = ~live & (stiff @ p < depth - 1e-9)
        if not pulling.any() and not pierced.any():
            break
        live = (live & ~pulling) | pierced
    return np.maximum(p, 0)


def _drag(
    pairs: Pairs, swell: Array, layer: Array, tangents: Array, motion: Array, bound: Array
) -> tuple[Array, NDArray[np.bool_], Array]:
    """Tangential forces (m, 3) that move the skin, at most `bound`; which cells slide; how far."""
    m = len(bound)
    t = [tangents[:, 0], tangents[:, 1]]
    push = np.concatenate([(swell * u).sum(axis=1) for u in t])
    stiff = np.block([[pairs.along(u, v) for v in t] for u in t]) - push[:, None] * push
    stiff[np.diag_indices_from(stiff)] += np.tile(layer, 2)
    want = np.concatenate([(motion * u).sum(axis=1) for u in t])
    q = np.zeros(2 * m)
    slide = np.zeros(m, dtype=bool)
    for _ in range(ACTIVE_SET_ROUNDS):
        stick, slip = np.tile(~slide, 2), np.tile(slide, 2)
        if stick.any():
            rest = want[stick] - stiff[np.ix_(stick, slip)] @ q[slip]
            q[stick] = cho_solve(cho_factor(stiff[np.ix_(stick, stick)]), rest)
        size = np.hypot(q[:m], q[m:])
        over = ~slide & (size > bound * (1 + 1e-9))
        if not over.any():
            break
        q[np.tile(over, 2)] *= np.tile(bound[over] / size[over], 2)
        slide |= over
    left = np.where(np.tile(slide, 2), want - stiff @ q, 0)
    return _along(q, t), slide, _along(left, t)


def _along(values: Array, tangents: list[Array]) -> Array:
    """(m, 3) vectors from their components along two tangents, one after the other."""
    m = len(tangents[0])
    return values[:m, None] * tangents[0] + values[m:, None] * tangents[1]


def _sum_by(owner: NDArray[np.intp], values: Array, k: int) -> Array:
    return np.asarray(np.bincount(owner, weights=values, minlength=k), dtype=np.float64)


def turn_z_to(n: Array) -> Array:
    """(3, 3) rows x', y', z' of the frame turned by the shortest way from z to the unit vector n."""
    x, y, z = n
    c = 1 / (1 + z)
    return np.array([[1 - c * x * x, -c * x * y, -x], [-c * x * y, 1 - c * y * y, -y], [x, y, z]])


@lru_cache(maxsize=8)
def _tangents(tip: Tip) -> tuple[Array, Array]:
    """Two (n, 3) unit tangents of the untouched skin at each pin's root."""
    frames = np.stack([turn_z_to(n) for n in tip.normals])
    return frames[:, 0], frames[:, 1]
