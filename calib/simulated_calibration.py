"""A calibration of a simulated tip: random poses on the simulator, the same fit as for a real one."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from calib.extract import DEMAND, gather, measure
from calib.fit import Choice, fit
from calib.sim import Simulator
from calib.sim.mechanics import Tool, ToolPose
from calib.targets import Targets
from edge.calibration import Calibration
from edge.frame import Pipeline
from edge.pins import take_rest

TARE_FRAMES = 8


@dataclass(frozen=True, slots=True)
class Range:
    """How far random poses go: depth and shear in mm, tilt and twist in deg, place in mm off the axis."""

    depth_mm: tuple[float, float] = (0.3, 4.0)
    shear_mm: float = 1.5
    tilt_deg: float = 8.0
    twist_deg: float = 5.0
    place_mm: float = 7.0


WHOLE = Range()


def random_contact(tool: Tool, reach: Range, rng: np.random.Generator) -> ToolPose:
    """A pose, uniform over the range. A flat tool has a tilt instead of a place."""
    depth = float(rng.uniform(*reach.depth_mm))
    # Skin that is hardly touched slips when it is sheared; real protocols avoid that.
    shear = (
        reach.shear_mm * min(1.0, depth / 2.0) * np.sqrt(rng.uniform()) * np.exp(2j * np.pi * rng.uniform())
    )
    place = reach.place_mm * np.sqrt(rng.uniform()) * np.exp(2j * np.pi * rng.uniform())
    tilt = rng.uniform(-reach.tilt_deg, reach.tilt_deg, 2)
    pose = ToolPose(
        tool,
        depth_mm=depth,
        shear_x_mm=float(shear.real),
        shear_y_mm=float(shear.imag),
        twist_deg=float(rng.uniform(-reach.twist_deg, reach.twist_deg)),
    )
    if tool.kind == "flat":
        return replace(pose, tilt_x_deg=float(tilt[0]), tilt_y_deg=float(tilt[1]))
    return replace(pose, x_mm=float(place.real), y_mm=float(place.imag))


def calibrate_simulated(
    simulator: Simulator,
    tool: Tool,
    *,
    n_frames: int = 150,
    seed: int = 0,
    reach: Range = WHOLE,
    serial: str = "simulated",
    on_done: Callable[[int], None] = lambda n: None,
) -> tuple[Calibration, list[Choice]]:
    """Press the simulated tip at random poses and fit a calibration to what its camera sees."""
    rng = np.random.default_rng(seed)
    rest = take_rest([simulator.frame().image for _ in range(TARE_FRAMES)])
    pipeline = Pipeline(rest, demand=DEMAND)
    poses, rows, truths = [], [], []
    for _ in range(n_frames):
        pose = random_contact(tool, reach, rng)
        frame = simulator.frame((pose,))
        assert frame.truth is not None
        rows.append(measure(pipeline, frame.image))
        poses.append(pose)
        truths.append(frame.truth)
        on_done(1)
    values = {
        "displacement_mm": np.array([p.depth_mm for p in poses]),
        "force_n": np.array([sum(t["forces_n"]) for t in truths]),
        "contact_area_mm2": np.array([sum(t["areas_mm2"]) for t in truths]),
        "shear_x_mm": np.array([p.shear_x_mm for p in poses]),
        "shear_y_mm": np.array([p.shear_y_mm for p in poses]),
        "force_x_n": np.array([sum(d[0] for d in t["drags_n"]) for t in truths]),
        "force_y_n": np.array([sum(d[1] for d in t["drags_n"]) for t in truths]),
        "torque_z_nmm": np.array([sum(t["torques_nmm"]) for t in truths]),
        "torsion_deg": np.array([p.twist_deg for p in poses]),
        "contact_x_mm": np.array([t["places_mm"][0][0] for t in truths]),
        "contact_y_mm": np.array([t["places_mm"][0][1] for t in truths]),
        "contact_depth_mm": np.array([p.depth_mm for p in poses]),
    }
    if tool.kind == "flat":
        values["tilt_x_deg"] = np.array([p.tilt_x_deg for p in poses])
        values["tilt_y_deg"] = np.array([p.tilt_y_deg for p in poses])
    frames = tuple(Path(f"pose-{i}") for i in range(n_frames))
    targets = Targets(f"simulated {tool.kind}, seed {seed}", frames, values, "")
    return fit(rest, targets, gather(rows), serial=serial, mm_per_px=mm_per_px(simulator))


def mm_per_px(simulator: Simulator) -> float:
    """Scale at the top of the tip, between the pins' caps."""
    top = simulator.camera.tip.dome_radius_mm - simulator.camera.tip.pin_length_mm
    a, b = simulator.camera.project(np.array([[-0.5, 0.0, top], [0.5, 0.0, top]]))
    return 1.0 / float(np.hypot(*(b - a)))
