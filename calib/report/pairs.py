"""Resolution of two probes: the share found as one, two, more, over their distance."""

import math

import numpy as np

from calib.protocols import Plan, Step
from calib.rig.base import CLEAR, Pose
from calib.sim import Tool
from edge.types import Array, Index

DISTANCES_MM = (2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0, 8.0)
PER_DISTANCE = 24
DEPTH_MM, RADIUS_MM, PLACE_MM = 2.0, 1.0, 5.0
RESOLVED = 99.0  # % found as two, from which on a distance counts as resolved


def pairs() -> Plan:
    """Two probes of 1 mm radius, 2 mm deep, anywhere within 5 mm of the axis, any way round; seeded."""
    rng = np.random.default_rng(24)
    steps = [Step(CLEAR, Tool("two", RADIUS_MM), 10, "rest")]
    for distance in DISTANCES_MM:
        for _ in range(PER_DISTANCE):
            angle, way, far = rng.uniform(0.0, 180.0), rng.uniform(0.0, 2.0 * math.pi), rng.uniform()
            tool = Tool("two", RADIUS_MM, round(angle, 2), distance)
            r = PLACE_MM * math.sqrt(far)
            at = Pose(x_mm=round(r * math.cos(way), 3), y_mm=round(r * math.sin(way), 3), depth_mm=DEPTH_MM)
            steps += [Step(CLEAR, tool, 0), Step(at, tool, 1)]
    return Plan("pairs", tuple(steps))


def shares(gap_mm: Array, counts: Index) -> list[tuple[float, float, float, float]]:
    """Distance in mm, and % found as one, as two, as more; nearest first. Frames without any are in none."""
    rows = []
    for distance in np.unique(gap_mm):
        found = counts[gap_mm == distance]
        one, two, more = (100.0 * float(np.mean(kind)) for kind in (found == 1, found == 2, found > 2))
        rows.append((float(distance), one, two, more))
    return rows


def resolvable_mm(rows: list[tuple[float, float, float, float]]) -> float:
    """The smallest distance from which on pairs are found as two; infinite: even the widest are not."""
    least = math.inf
    for distance, _, two, _ in reversed(rows):
        if two < RESOLVED:
            break
        least = distance
    return least
