"""`python -m tests.bench dynamics`: what the values do in time, of the simulated tip of `example:sim`.

A ball presses the tip from one frame to the next, is held, comes half of the way back and is let go. Skin
that creeps is a standard linear solid: while it is held its motion grows towards a tenth more, and then it
returns as slowly. For an hour of the untouched tip nothing is rendered: its pins are at rest, with the noise
that they have in images. The same readings are smoothed as `--smooth` does it.
"""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import click
import numpy as np

from calib.sim import Appearance, Camera, Simulator, Tool, ToolPose, deform
from calib.sim.render import Renderer
from edge import Fingertip, Result
from edge.calibration.smoothing import Smoother
from edge.frame import Pipeline
from edge.types import Array, Feature
from tests.bench.output import show, write_json, writes_results
from tests.support.layouts import tracks_of

RATE_HZ = 60.0
REST_N, HELD_N = 8, 240  # frames
PRESS = ToolPose(Tool("sphere", radius_mm=4.0), depth_mm=2.0)
BACK = replace(PRESS, depth_mm=1.0)
MOVE_N = 60  # frames of an even motion between the two
DEPTH = "displacement_mm"
VALUES = {"mm": DEPTH, "N": "force_n", "mm of shear": "shear_x_mm", "deg of torsion": "torsion_deg"}
SMOOTH_MS = (50, 100, 200)
FELT, CLOSE_MM = 0.95, 0.002  # share of the frames of the smallest press, and how well its depth is known
WITHIN = 0.05  # of a step
HOUR_S, PERIOD_S = 3600, 10  # of creep, and between its images
CREEP_REL, CREEP_S = 0.1, 600.0
PROBABLE = 0.5  # of slip


class Bench:
    """The tip, and what is read of it."""

    def __init__(self) -> None:
        self.simulator = Simulator(Camera(), seed=3, rate_hz=RATE_HZ)
        self.finger = Fingertip([self.simulator.frame().image for _ in range(REST_N)], "example:sim")

    def read(self, poses: Iterable[ToolPose | None]) -> list[Result]:
        """The next frames under these tools."""
        frames = [self.simulator.frame((pose,) if pose else ()) for pose in poses]
        return [self.finger.read(frame.image, frame.capture_ns / 1e9) for frame in frames]

    def steps(self) -> dict[str, float]:
        """Noise of a held press; frames after the first one of a step until it is read; the same smoothed."""
        pressed, back = self.read([PRESS] * HELD_N), self.read([BACK] * HELD_N)
        depths = np.linspace(BACK.depth_mm, PRESS.depth_mm, MOVE_N)
        moved = self.read(replace(PRESS, depth_mm=float(depth)) for depth in depths)
        released = self.read([None] * HELD_N)
        whole = float(np.median(values_of(pressed, DEPTH)))
        left = float(np.median(values_of(back, DEPTH)))
        found = {
            f"noise while held, {unit}": float(np.std(values_of(pressed[HELD_N // 2 :], name)))
            for unit, name in VALUES.items()
        }
        found["pressed: frames until it is felt"] = int(np.argmax([is_felt(one) for one in pressed]))
        found["let go: frames until it is not felt"] = int(np.argmin([is_felt(one) for one in released]))
        for name, results, before, after in (
            ("pressed", pressed, 0.0, whole), ("back", back, whole, left), ("let go", released, left, 0.0),
        ):  # fmt: skip
            found |= step_of(name, values_of(results, DEPTH), before, after)
        for smooth_ms in SMOOTH_MS:
            held, goes_back, moves = smoothed((pressed, back, moved), smooth_ms * 1e-3)
            how = f"smooth {smooth_ms} ms"
            noise = np.std(held[HELD_N // 2 :]) / found["noise while held, mm"]
            found[f"{how}: noise while held, of that without"] = float(noise)
            found |= step_of(f"{how}: back", goes_back, whole, left)
            behind = (values_of(moved, DEPTH) - moves)[MOVE_N // 2 :].mean()
            found[f"{how}: frames behind an even motion"] = float(behind / (whole - left) * (MOVE_N - 1))
        return found

    def smallest_mm(self) -> float:
        """The depth from which on nearly all frames read a touch, by bisection."""
        low, high = 0.0, PRESS.depth_mm
        while high - low > CLOSE_MM:
            middle = 0.5 * (low + high)
            felt = np.mean([is_felt(one) for one in self.read([replace(PRESS, depth_mm=middle)] * HELD_N)])
            low, high = (low, middle) if felt >= FELT else (middle, high)
        return high

    def hour(self) -> dict[str, float]:
        """What begins in an hour without a touch."""
        seen = np.array([result.tracks.xy_img for result in self.read([None] * HELD_N)])
        place, noise_px = seen.mean(axis=0), seen.std(axis=0)
        pipeline = Pipeline(self.finger.rest, demand=frozenset({Feature.DISPLACEMENT, Feature.SLIP}))
        rng = np.random.default_rng(4)
        before, begun, slips = False, 0, 0
        for _ in range(round(HOUR_S * RATE_HZ)):
            features = pipeline.features(tracks_of(place + rng.normal(0.0, noise_px)))
            begun += features.in_contact and not before
            before = features.in_contact
            slips += (features.slip_probability or 0.0) > PROBABLE
        return {"touches in an hour without any": begun, "frames with slip in it": slips}

    def creep(self) -> dict[str, float]:
        """What is read while the tip is held for an hour, and how long a touch is read after it."""
        tip, renderer = self.simulator.camera.tip, Renderer(self.simulator.camera, Appearance())
        pressed, rng = deform(tip, (PRESS,)), np.random.default_rng(5)
        times = np.arange(0, 2 * HOUR_S, PERIOD_S)
        held = times < HOUR_S
        crept = CREEP_REL * (1.0 - np.exp(-times / CREEP_S))
        left = crept[held][-1] * np.exp(-(times - HOUR_S) / CREEP_S)
        results = []
        for at_s, share in zip(times, np.where(held, 1.0 + crept, left), strict=True):
            tips = tip.tips_mm + share * (pressed.tips_mm - tip.tips_mm)
            image, _ = renderer.image(replace(pressed, tips_mm=tips), rng)
            results.append(self.finger.read(image, HOUR_S + float(at_s)))
        values, felt = values_of(results, DEPTH), np.array([is_felt(result) for result in results])
        slips = [(one.features.slip_probability or 0.0) > PROBABLE for one in results if one.features]
        return {
            "an hour held, creep of a tenth: read more, mm": float(values[held][-1] - values[0]),
            "images with slip in it": sum(slips),
            "let go after it: s until untouched": float(PERIOD_S * felt[~held].sum()),
        }


def is_felt(result: Result) -> bool:
    """Whether it is a touch."""
    return result.features is not None and result.features.in_contact


def values_of(results: list[Result], name: str) -> Array:
    """One value of each frame."""
    return np.array([result.reading.values.get(name, np.nan) for result in results])


def step_of(name: str, values: Array, before: float, after: float) -> dict[str, float]:
    """How a step is followed: by frames after its first one."""
    near = np.abs(values - after) < WITHIN * abs(after - before)
    beyond = float(np.max((values - after) * np.sign(after - before)) / abs(after - before))
    missed = np.flatnonzero(~near)
    return {
        f"{name}: frames until within {WITHIN:.0%} for good": int(missed[-1] + 1) if len(missed) else 0,
        f"{name}: largest overshoot, of the step": max(0.0, beyond),
    }


def smoothed(parts: tuple[list[Result], ...], step_s: float) -> list[Array]:
    """The depths of these frames, one part after the other, smoothed."""
    smoother, found = Smoother(step_s), []
    for part in parts:
        copies = [replace(one, reading=replace(one.reading, values=dict(one.reading.values))) for one in part]
        for copy in copies:
            smoother.update(copy)
        found.append(values_of(copies, DEPTH))
    return found


@click.command("dynamics")
@writes_results
def command(out: Path) -> None:
    """Noise, smallest press, steps, false touches, creep, and what smoothing makes of them."""
    bench = Bench()
    found = bench.steps()
    found[f"smallest press that {FELT:.0%} of the frames read, mm"] = bench.smallest_mm()
    found |= bench.hour() | bench.creep()
    show([{"of the simulated tip": name, "": round(value, 4)} for name, value in found.items()])
    write_json(out / "dynamics.json", {name: round(value, 6) for name, value in found.items()})
