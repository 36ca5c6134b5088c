"""Pins that the border of the view cuts: the frame of the lens, the housing's rim, the image's own border.

Idea
- Only a sliver of such a pin is visible. Its inner edge is still the pin's own, an arc of known radius; its
  outer edge is the border's. One circle of that radius fits the inner arc, and its middle is the pin's,
  for any shape of the border and any hidden part.

Rules
- Looked for outside of the pins that were found whole, next to them, and only where pins are missing.
- The housing may show arcs of its own: those seen at rest, when no pin is cut, are not pins.
- An arc that no circle of the pins' radius fits to within the blur of its edge is glare. So is one much
  dimmer than the pins next to it.
- Sigma follows from the arc's scatter about the circle, and is at least a quarter of a pixel: the border
  distorts the arc's ends.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from edge.geometry.lattice import N_RING
from edge.geometry.neighbours import nearest_of
from edge.pins.params import PARAMS
from edge.pins.templates import PHASES
from edge.types import Array, Image, PinPattern, Pins

#: The arc is read on an image this many times finer.
FINER = PHASES


def find_cut(grey: Image, pins: Pins, pattern: PinPattern, most: int) -> Pins:
    """Pins of which an arc is visible, outside the hull of those found.

    grey  (h, w) uint8 or uint16
    pins  those found whole
    most  how many may be missing: those with the smallest sigma are returned
    """
    rows: list[tuple[float, float, float, float, float]] = []
    own_px = PARAMS.own_pitches * pattern.pitch_px
    if len(pins) > N_RING:
        xy, pitch = pins.xy_img, pattern.pitch_px
        hull = cv2.convexHull(xy.astype(np.float32))[:, 0].astype(np.float32)
        slivers = _slivers(grey, pins, hull, pattern.pin_radius_px)
        distance, near = nearest_of(xy, slivers, N_RING)
        for at, gap, beside in zip(slivers, distance[:, 0], near, strict=True):
            if gap > PARAMS.link_pitches_outside * pitch:
                continue
            outwards = at - xy[beside].mean(0)
            outwards /= max(float(np.hypot(*outwards)), 1e-9)
            brightness = float(np.median(pins.brightness[beside]))
            radius = float(np.median(pins.radius_px[beside]))
            fit = _fit_arc(grey, at, outwards, radius, brightness, pattern.edge_px)
            if fit is None:
                continue
            (x, y), sigma = fit
            outside = cv2.pointPolygonTest(hull, (x, y), False) < 0
            known = any(np.hypot(x - gx, y - gy) < own_px for gx, gy in pattern.glints_img)
            to_pin = nearest_of(xy, np.array([[x, y]]))[0][0, 0]
            if outside and not known and own_px < to_pin < PARAMS.link_pitches_outside * pitch:
                rows.append((x, y, sigma, radius, brightness))
    found = np.array(rows).reshape(-1, 5)
    # A glint may split a sliver in two: the half with the smaller sigma is kept.
    kept: list[int] = []
    for i in np.argsort(found[:, 2], kind="stable"):
        if all(np.hypot(*(found[i, :2] - found[k, :2])) > own_px for k in kept):
            kept.append(int(i))
    kept = kept[:most]
    return Pins(found[kept, :2], found[kept, 2], found[kept, 3], found[kept, 4])


def _slivers(grey: Image, pins: Pins, hull: NDArray[np.float32], radius_px: float) -> Array:
    """(k, 2) px, middles of bright patches smaller than a pin, on or outside the pins' hull."""
    inner = hull - hull.mean(0)
    inner *= 1 - 2 * radius_px / max(float(np.ptp(hull, axis=0).max()) / 2, 4 * radius_px)
    inner += hull.mean(0)
    field = np.zeros(grey.shape, np.uint8)
    cv2.fillConvexPoly(field, np.rint(inner).astype(np.int32), 1)
    at = np.clip(np.rint(pins.xy_img).astype(np.intp), 0, np.array(grey.shape[::-1]) - 1)
    rim = field[at[:, 1], at[:, 0]] == 0
    middle = float(np.median(grey[at[rim, 1], at[rim, 0]]))
    bright = (grey > middle - 0.5 * float(np.median(pins.brightness[rim]))).view(np.uint8)
    bright[field > 0] = 0
    for (x, y), r in zip(pins.xy_img[rim], pins.radius_px[rim], strict=True):
        cv2.circle(bright, (round(float(x)), round(float(y))), int(np.ceil(r + 1)), 0, -1)
    count, _, stats, middles = cv2.connectedComponentsWithStats(bright, connectivity=8)
    share = stats[1:count, cv2.CC_STAT_AREA] / (np.pi * radius_px**2)
    return np.asarray(
        middles[1:count][(share > PARAMS.cut_area_range[0]) & (share < PARAMS.cut_area_range[1])], np.float64
    )


def _fit_arc(
    grey: Image, at: Array, outwards: Array, radius_px: float, brightness: float, edge_px: float
) -> tuple[tuple[float, float], float] | None:
    """Middle of the disc whose inner edge, blurred by `edge_px`, runs by `at`; sigma of a coordinate, px."""
    half = int(np.ceil(1.5 * radius_px))
    corner = np.rint(at).astype(np.intp) - half
    size = 2 * half + 1
    columns = np.clip(np.arange(corner[0], corner[0] + size), 0, grey.shape[1] - 1)
    rows = np.clip(np.arange(corner[1], corner[1] + size), 0, grey.shape[0] - 1)
    crop = grey[rows[:, None], columns].astype(np.float32)
    level = np.sort(crop, axis=None)
    dark, top = float(level[len(level) // 5]), float(level[-len(level) // 20])
    if top - dark < PARAMS.pin_share_min * brightness:
        return None
    fine = cv2.resize(crop, None, fx=FINER, fy=FINER, interpolation=cv2.INTER_LINEAR)
    smooth_px = 0.5
    fine = cv2.GaussianBlur(fine, (0, 0), smooth_px * FINER)
    bright = (fine > 0.5 * (top + dark)).view(np.uint8)
    outlines, _ = cv2.findContours(bright, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    middle = (at - corner + 0.5) * FINER - 0.5
    depth = [cv2.pointPolygonTest(o, (float(middle[0]), float(middle[1])), True) for o in outlines]
    if not depth or max(depth) < -FINER:
        return None
    point = outlines[int(np.argmax(depth))][:, 0]
    x, y = np.clip(point, 1, len(fine) - 2).T
    slope = np.stack([fine[y, x + 1] - fine[y, x - 1], fine[y + 1, x] - fine[y - 1, x]], axis=1)
    arc = point[slope @ outwards > PARAMS.cut_facing_min * np.hypot(*slope.T)]
    if len(arc) < 2 * FINER:
        return None
    arc = (arc + 0.5) / FINER - 0.5 + corner
    reach = radius_px - 0.5 / FINER  # the outline is the last bright sample, half a sample inside the edge
    x, y = arc.T
    cx, cy = (float(v) for v in arc.mean(0) + 0.8 * reach * outwards)
    for _ in range(PARAMS.steps_max):  # Gauss-Newton: the circle of this radius nearest to the arc
        dx, dy = x - cx, y - cy
        far = np.sqrt(dx * dx + dy * dy)
        ux, uy, off = dx / far, dy / far, far - reach
        xx, xy, yy = float(ux @ ux), float(ux @ uy), float(uy @ uy)
        det = xx * yy - xy * xy
        if not det > 0.0:  # a straight arc fixes one coordinate alone
            return None
        gx, gy = float(ux @ off), float(uy @ off)
        mx, my = (yy * gx - xy * gy) / det, (xx * gy - xy * gx) / det
        cx, cy = cx + mx, cy + my
        if mx * mx + my * my < 1e-4:
            break
    scatter = float(np.sqrt(np.mean(off * off)))
    if scatter > np.hypot(edge_px, smooth_px):
        return None
    # FINER samples of the outline count as one pixel of evidence; sigma is that of the worse coordinate.
    least = (xx + yy - np.hypot(xx - yy, 2 * xy)) / 2
    sigma = scatter * float(np.sqrt(FINER / least))
    return (cx, cy), max(sigma, 1.0 / FINER)
