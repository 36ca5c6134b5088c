"""A simulated hand: two fingers that run as programs, and an object between them, to try controllers on.

    poses -> two `edge run` (render, track, send) -> samples on one bus -> a controller -> how far it closes

Rules
- The object sticks while friction carries its load (the skin shears by what that takes, in the curves of
  `calib.sim.deform`); else it slides under the rest of the load, until friction has stopped it.
- Time is the machine's own: a step of the world is the time that the last one took, so that a slow machine
  makes a slow controller, as it would on a robot.
"""

import json
import math
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import hostlink
from calib.rig.simulated import load_simulation
from calib.sim import ToolPose, deform
from hostlink import Sample, State

GRAVITY_M_S2 = 9.81
DEPTH_MAX_MM = 4.0  # what the tip is calibrated for
SILENCE_S = 0.5  # without a sample; the pose is then shown again
PATIENCE_S = 30.0  # for a finger that starts
FINGERS = (1, 2)


class Skin:
    """Forces of the tip on a flat surface: the normal one over depth, the other one over depth and shear."""

    def __init__(self, simulation: Path) -> None:
        tip = load_simulation(simulation).tip
        self.depths, self.shears = np.linspace(0.0, DEPTH_MAX_MM, 17), np.linspace(0.0, 3.5, 15)
        self.normal, self.drag = np.zeros(len(self.depths)), np.zeros((len(self.depths), len(self.shears)))
        for i, depth in enumerate(self.depths[1:], 1):
            for j, shear in enumerate(self.shears):
                found = deform(tip, (ToolPose(depth_mm=depth, shear_y_mm=shear),))
                self.normal[i], self.drag[i, j] = found.forces_n.sum(), np.hypot(*found.drags_n.sum(axis=0))
        self.friction = tip.friction

    def normal_n(self, depth_mm: float) -> float:
        return float(np.interp(depth_mm, self.depths, self.normal))

    def shear_mm(self, depth_mm: float, drag_n: float) -> float:
        """The shear at which the skin holds against a drag that friction carries."""
        drag = [np.interp(depth_mm, self.depths, column) for column in self.drag.T]
        return float(np.interp(drag_n, np.maximum.accumulate(drag), self.shears))


@dataclass
class GraspedObject:
    """An object between the fingers, and how it is held."""

    skin: Skin
    mass_kg: float
    depth_mm: float = -0.5
    shear_mm: float = 0.0
    speed_m_s: float = 0.0  # of the object as it slides down
    slid_mm: float = 0.0

    def step(self, dt_s: float, closing_mm_s: float, load_m_s2: float) -> None:
        """load_m_s2  what the object weighs and accelerates by, as far as nothing else carries it."""
        self.depth_mm = min(self.depth_mm + closing_mm_s * dt_s, DEPTH_MAX_MM)
        load_n = self.mass_kg * load_m_s2
        carried_n = len(FINGERS) * self.skin.friction * self.skin.normal_n(self.depth_mm)
        if self.speed_m_s > 0.0 or abs(load_n) > carried_n:
            self.speed_m_s = max(0.0, self.speed_m_s + (load_n - carried_n) / self.mass_kg * dt_s)
            self.slid_mm += 1e3 * self.speed_m_s * dt_s
        drag_n = min(abs(load_n), carried_n) / len(FINGERS)
        self.shear_mm = math.copysign(self.skin.shear_mm(self.depth_mm, drag_n), load_n)

    @property
    def needed_n(self) -> float:
        """Normal force of a finger that just holds the object at rest."""
        return self.mass_kg * GRAVITY_M_S2 / len(FINGERS) / self.skin.friction


class SimulatedHand:
    """Two `edge run` on one bus, what presses them, and what they say.

    simulation  file of their tip, as of a simulated rig
    calibration of that tip
    group       multicast address that is the bus
    """

    def __init__(self, simulation: Path, calibration: str, group: str) -> None:
        self._stack = ExitStack()
        self._poses = self._stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        self._ports = _free_ports(len(FINGERS))
        for node, port in zip(FINGERS, self._ports, strict=True):
            sink = f"udp:{group}?ttl=0&node={node}"
            source = f"sim-remote:{port}?simulation={simulation}"
            options = ["--calibration", calibration, "--sink", sink]
            self._stack.enter_context(_running(["-m", "edge", "run", "--source", source, *options]))
        self._hand = self._stack.enter_context(hostlink.connect(f"udp:{group}?ttl=0"))
        self._samples = self._hand.samples(SILENCE_S)

    def feel(self, pose: ToolPose) -> dict[int, State]:
        """Press all fingers so; what each of them then says. A pose that one has missed is shown again."""
        found: dict[int, State] = {}
        since_s = self._press(pose)
        while len(found) < len(FINGERS):
            sample = self._sample()
            if sample is None:
                self._press(pose)
            elif sample.host_time_s >= since_s - sample.host_error_s and sample.state.pins_tracked > 0:
                found[sample.finger] = sample.state
        return found

    def wait_until_ready(self) -> None:
        """Until all have a rest frame. Raises TimeoutError."""
        ready: set[int] = set()
        end_s = time.monotonic() + PATIENCE_S
        while len(ready) < len(FINGERS):
            if time.monotonic() > end_s:
                raise TimeoutError(f"of the fingers {FINGERS} {sorted(ready) or 'none'} have a rest frame")
            self._press(ToolPose())
            sample = self._sample()
            if sample is not None and sample.state.displacement_mm == 0.0:
                ready.add(sample.finger)

    def _press(self, pose: ToolPose) -> float:
        """Show all fingers a pose; returns when."""
        fields = {"depth_mm": pose.depth_mm, "shear_x_mm": pose.shear_x_mm, "shear_y_mm": pose.shear_y_mm}
        message = json.dumps([fields] if pose.depth_mm > 0 else []).encode()
        now_s = time.monotonic()
        for port in self._ports:
            self._poses.sendto(message, ("127.0.0.1", port))
        return now_s

    def _sample(self) -> Sample | None:
        """The next sample of a finger; None: none comes."""
        try:
            return next(self._samples)
        except hostlink.LinkTimeout:
            self._samples = self._hand.samples(SILENCE_S)
            return None

    def close(self) -> None:
        self._stack.close()


@contextmanager
def _running(arguments: list[str]) -> Iterator[None]:
    with subprocess.Popen([sys.executable, *arguments], stdout=subprocess.DEVNULL) as program:
        try:
            yield
        finally:
            program.terminate()


def _free_ports(n: int) -> list[int]:
    with ExitStack() as stack:
        found = [stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) for _ in range(n)]
        for one in found:
            one.bind(("127.0.0.1", 0))
        return [one.getsockname()[1] for one in found]
