"""Measured against simulated slip: a tool is pressed on the simulated tip and dragged until it slides.

Truth is the simulator's friction: the share of the contact's area that slides under the drag, and how far the
tool has moved over the skin there. Three kinds of frames are distinguished: the contact sticks; it creeps,
that is, slides in part, from its rim inwards; it glides as a whole. `python -m tests.bench slip` has random
drags, and the time before a contact glides.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from calib.rig.simulated import Simulation
from calib.sim import Tool, ToolPose
from calib.simulated_calibration import TARE_FRAMES, mm_per_px
from edge.frame import Pipeline
from edge.pins import take_rest
from edge.types import Array, Feature, Mask

DOWN_N, STILL_N, DRAG_N = 6, 6, 60
DEPTH_MM, WAY_MM = 2.0, 3.0
#: Below the first share of its area that slides a contact sticks; above the second it glides as a whole.
STICKS, GLIDES = 0.25, 0.95
PROBABLE = 0.5


@dataclass(frozen=True, slots=True)
class Drag:
    """One tool, how rough it is, and where it is dragged to."""

    tool: Tool
    friction: float
    angle_deg: float


#: Rough, usual and smooth; what is dragged by 3 mm in a second.
DRAGS = (
    Drag(Tool("flat"), 2.0, 20.0),
    Drag(Tool("flat"), 1.0, 65.0),
    Drag(Tool("flat"), 0.35, 110.0),
    Drag(Tool("sphere", radius_mm=6.0), 2.0, 200.0),
    Drag(Tool("sphere", radius_mm=6.0), 1.0, 245.0),
    Drag(Tool("sphere", radius_mm=6.0), 0.35, 290.0),
)


@dataclass(frozen=True, slots=True)
class Slipped:
    """The frames of one drag.

    share        (n,) true share of the contact's area that slides
    true_mm_s    (n,) mean speed of the tool over the skin, over the contact's area
    read_mm_s    (n,) measured by the edge
    probability  (n,) measured by the edge
    """

    share: Array
    true_mm_s: Array
    read_mm_s: Array
    probability: Array


def poses(drag: Drag) -> Iterator[ToolPose]:
    """Down, still, then along a line at an even speed."""
    a = np.deg2rad(drag.angle_deg)
    for k in range(1, DOWN_N + 1):
        yield ToolPose(drag.tool, depth_mm=DEPTH_MM * k / DOWN_N)
    for _ in range(STILL_N):
        yield ToolPose(drag.tool, depth_mm=DEPTH_MM)
    for k in range(1, DRAG_N + 1):
        way = WAY_MM * k / DRAG_N
        yield ToolPose(
            drag.tool, depth_mm=DEPTH_MM, shear_x_mm=float(way * np.cos(a)), shear_y_mm=float(way * np.sin(a))
        )


def drag(simulation: Simulation, one: Drag) -> Slipped:
    """Play one drag through the whole chain."""
    simulation = replace(simulation, tip=replace(simulation.tip, friction=one.friction))
    simulator = simulation.simulator()
    scale = mm_per_px(simulator) * simulation.rate_hz
    rest = take_rest([simulator.frame().image for _ in range(TARE_FRAMES)])
    pipeline = Pipeline(rest, demand=frozenset({Feature.SLIP}))
    rows, before = [], np.zeros(2)
    for k, contact in enumerate(poses(one)):
        frame = simulator.frame((contact,))
        assert frame.truth is not None
        features = pipeline.process(frame).features
        slid = np.array(frame.truth["slid_mm"][0])
        ran, before = float(np.hypot(*(slid - before))), slid
        if features is None or features.slip_px is None or k < DOWN_N:
            continue
        rows.append(
            (
                frame.truth["slip"][0],
                ran * simulation.rate_hz,
                features.slip_px * scale,
                features.slip_probability,
            )
        )
    return Slipped(*np.array(rows, dtype=np.float64).T)


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of one or several drags. NaN if there was no such frame.

    false_percent   of the frames that stick: slip called probable
    detected_percent    of the frames that creep
    glide_percent   of the frames that glide
    detected_from       share of the contact that slid when slip was first detected
    true_mm_s, read_mm_s  mean speeds over the frames that creep and were detected
    """

    false_percent: float
    detected_percent: float
    glide_percent: float
    detected_from: float
    true_mm_s: float
    read_mm_s: float


def outcome(seen: Slipped) -> Outcome:
    """Result of one drag."""
    detected = seen.probability > PROBABLE
    creeps = (seen.share >= STICKS) & (seen.share <= GLIDES)
    both = detected & creeps
    return Outcome(
        100.0 * _mean(detected[seen.share < STICKS]),
        100.0 * _mean(detected[creeps]),
        100.0 * _mean(detected[seen.share > GLIDES]),
        float(seen.share[detected][0]) if detected.any() else math.nan,
        _mean(seen.true_mm_s[both]),
        _mean(seen.read_mm_s[both]),
    )


def _mean(values: Array | Mask) -> float:
    return float(values.mean()) if len(values) else math.nan
