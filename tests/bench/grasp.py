"""`python -m tests.bench grasp`: two simulated fingers, an object with mass, and a gripper, end to end.

    poses -> two `edge run` (render, track, send) -> samples on one bus -> the controller -> motor -> poses

The controller is the example's, `docs/examples/gentle_grip.py` and `hostlink/c/examples/gentle_grip.c`. It is
compared with one that closes until the normal force is what the heaviest object needs. Each object is
gripped, lifted, held and shaken.

Rules
- Time is the machine's own: a step of the world is the time that the last one took, so that a slow machine
  makes a slow controller, as it would on a robot.
- The object sticks while friction carries its load (the skin shears by what that takes, in the curves of
  `calib.sim.deform`); else it slides under the rest of the load, until friction has stopped it.
"""

import ctypes
import json
import math
import runpy
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import click
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import hostlink
from calib.rig.simulated import load_simulation
from calib.sim import ToolPose, deform
from hostlink import Sample, State, Status
from hostlink.wire.state import pack_state
from tests.bench.output import ROOT, show, write_json, writes_results

MASSES_G = (50, 100, 200, 350, 500)
FRICTIONS = (0.7, 1.0)
SPEED_MM_S, DEPTH_MAX_MM = 2.0, 4.0  # of the gripper; what the tip is calibrated for
GRAVITY, SHAKE_M_S2, SHAKE_HZ = 9.81, 3.0, 2.0
LIFT_S, HOLD_S, SHAKE_S = 1.5, 1.0, 1.5
SILENCE_S = 0.5  # without a sample; the pose is then shown again
PATIENCE_S = 30.0  # for a finger that starts, or a gripper that closes
DROPPED_MM, SLIPPED_MM = 5.0, 0.5
FINGERS = (1, 2)
STYLES = {"gentle": "-", "gentle, in C": "--", "fixed force": ":"}
#: The tip of `example:press`, with the friction of the skin on the object.
SIMULATION = """
[tip]
n_pins = 127
kind = "hex"
pin_radius_mm = 0.8
friction = {friction}
[camera]
size_px = [160, 160]
[look]
vignetting = 0.0
read_noise = 0.2
shot_noise = 0.0
"""
Trace = list[tuple[float, float, float]]
Controller = Callable[[dict[int, State]], tuple[float, bool]]  # speed of closing, mm/s; whether it holds


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
class World:
    """The object between the fingers."""

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
        return self.mass_kg * GRAVITY / len(FINGERS) / self.skin.friction


class Fingers:
    """Two running programs, what they are pressed by, and their newest samples."""

    def __init__(self, simulation: Path, group: str) -> None:
        self._stack = ExitStack()
        self._poses = self._stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        self._ports = _free_ports(len(FINGERS))
        for node, port in zip(FINGERS, self._ports, strict=True):
            sink = f"udp:{group}?ttl=0&node={node}"
            source = f"sim-remote:{port}?simulation={simulation}"
            options = ["--calibration", "example:press", "--sink", sink]
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
    with subprocess.Popen([sys.executable, *arguments], cwd=ROOT, stdout=subprocess.DEVNULL) as program:
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


def gentle() -> Controller:
    """The example's controller, a copy for each finger; the gripper closes if one of them wants to."""
    example = runpy.run_path(str(ROOT / "docs" / "examples" / "gentle_grip.py"))
    grips = {node: example["Grip"]() for node in FINGERS}

    def control(states: dict[int, State]) -> tuple[float, bool]:
        speeds = [
            grips[node].speed_mm_s(
                math.nan if s.status & Status.SATURATED else s.displacement_mm, s.friction, s.slip_margin
            )
            for node, s in states.items()
        ]
        return max(speeds), all(grip.held for grip in grips.values())

    return control


def gentle_in_c(library: ctypes.CDLL) -> Controller:
    """The same in C, from the frames as they were sent."""
    grips = {node: ctypes.create_string_buffer(1) for node in FINGERS}  # all zeros: a grip_t at the start

    def control(states: dict[int, State]) -> tuple[float, bool]:
        speeds = [library.grip_speed_mm_s(grips[node], pack_state(s, 0)) for node, s in states.items()]
        return max(speeds), all(grip[0] != b"\0" for grip in grips.values())

    return control


def compiled(folder: Path) -> ctypes.CDLL:
    """The C example as a library."""
    sources = [str(ROOT / "hostlink" / "c" / name) for name in ("examples/gentle_grip.c", "vt_fd.c")]
    library = folder / "gentle_grip.so"
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", *sources, "-lm", "-o", str(library)], check=True)
    loaded = ctypes.CDLL(str(library))
    loaded.grip_speed_mm_s.restype = ctypes.c_float
    return loaded


def fixed(force_n: float) -> Controller:
    """Closes until the force is reached, and stays."""
    reached = False

    def control(states: dict[int, State]) -> tuple[float, bool]:
        nonlocal reached
        reached = reached or min(s.force_n for s in states.values()) >= force_n
        return (0.0 if reached else SPEED_MM_S), reached

    return control


def controllers(library: ctypes.CDLL, heaviest_n: float) -> dict[str, Controller]:
    """New ones, by the names of STYLES."""
    return {"gentle": gentle(), "gentle, in C": gentle_in_c(library), "fixed force": fixed(heaviest_n)}


def load_m_s2(since_s: float) -> float:
    """What the object weighs on the fingers, by the time since they hold it: lifted, held, shaken."""
    lifted = min(1.0, since_s / LIFT_S)
    shaken_s = since_s - LIFT_S - HOLD_S
    return GRAVITY * lifted + (SHAKE_M_S2 * math.sin(math.tau * SHAKE_HZ * shaken_s) if shaken_s > 0 else 0.0)


def grasp(fingers: Fingers, world: World, controller: Controller) -> Trace:
    """By step: s since the fingers hold it, normal force of a finger, N, and how far it has slid, mm."""
    while fingers_touch(fingers):
        pass
    trace: Trace = []
    last_s = begun_s = time.monotonic()
    held_s: float | None = None
    closing = 0.0
    while held_s is None or last_s - held_s < LIFT_S + HOLD_S + SHAKE_S:
        now_s = time.monotonic()
        load = 0.0 if held_s is None else load_m_s2(now_s - held_s)
        world.step(now_s - last_s, closing, load)
        last_s = now_s
        states = fingers.feel(ToolPose(depth_mm=world.depth_mm, shear_y_mm=world.shear_mm))
        closing, holds = controller(states)
        if held_s is None and now_s - begun_s > PATIENCE_S:
            raise TimeoutError("the gripper never closed")
        held_s = now_s if held_s is None and holds else held_s
        if held_s is not None:
            trace.append((now_s - held_s, world.skin.normal_n(world.depth_mm), world.slid_mm))
        if world.slid_mm > DROPPED_MM:
            break
    return trace


def fingers_touch(fingers: Fingers) -> bool:
    """Whether a finger still feels the object of before, after it was opened."""
    return any(s.status & Status.TOUCHED for s in fingers.feel(ToolPose()).values())


def row_of(mass_g: int, name: str, world: World, trace: Trace) -> dict[str, object]:
    forces = [force for _, force, _ in trace]
    return {
        "controller": name,
        "friction": world.skin.friction,
        "mass, g": mass_g,
        "slid, mm": world.slid_mm,
        "held": world.slid_mm <= SLIPPED_MM,
        "force, N": float(np.mean(forces)),
        "of what is needed": float(np.mean(forces)) / world.needed_n,
    }


def draw(traces: dict[tuple[str, float, int], Trace], path: Path) -> None:
    """Normal force over time, a panel for each friction, a line for each object and controller."""
    figure, axes = plt.subplots(1, len(FRICTIONS), figsize=(10, 4), sharey=True, layout="constrained")
    for axis, friction in zip(axes, FRICTIONS, strict=True):
        for (name, of, mass_g), trace in traces.items():
            if of == friction:
                time_s, force_n, _ = np.transpose(trace)
                colour = f"C{MASSES_G.index(mass_g)}"
                axis.plot(time_s, force_n, STYLES[name], color=colour, label=f"{name}, {mass_g} g")
        for at in (LIFT_S, LIFT_S + HOLD_S):
            axis.axvline(at, color="0.85", zorder=0)
        axis.set(title=f"friction {friction:g}: lifted, held, shaken", xlabel="s since the fingers hold")
    axes[0].set_ylabel("normal force of a finger, N")
    axes[-1].legend(fontsize=7, ncols=2)
    figure.savefig(path, dpi=110)
    plt.close(figure)


@click.command()
@click.option("--group", default="239.0.0.17", show_default=True, help="Multicast group that is the bus.")
@writes_results
def command(out: Path, group: str) -> None:
    """Objects gripped, lifted, held and shaken by two simulated fingers and the example's controller."""
    rows: list[dict[str, object]] = []
    traces = {}
    with tempfile.TemporaryDirectory() as folder:
        library = compiled(Path(folder))
        for friction in FRICTIONS:
            simulation = Path(folder) / f"tip_{friction:g}.toml"
            simulation.write_text(SIMULATION.format(friction=friction))
            skin = Skin(simulation)
            heaviest = World(skin, max(MASSES_G) / 1e3).needed_n * (1 + SHAKE_M_S2 / GRAVITY)
            with ExitStack() as stack:
                fingers = Fingers(simulation, group)
                stack.callback(fingers.close)
                fingers.wait_until_ready()
                for mass_g in MASSES_G:
                    for name, controller in controllers(library, heaviest).items():
                        world = World(skin, mass_g / 1e3)
                        traces[name, friction, mass_g] = trace = grasp(fingers, world, controller)
                        rows.append(row_of(mass_g, name, world, trace))
    show(rows, "Objects gripped by two simulated fingers")
    summary = {
        name: {
            "held": sum(bool(row["held"]) for row in rows if row["controller"] == name),
            "of": len(MASSES_G) * len(FRICTIONS),
            "force, of what is needed": float(
                np.median([row["of what is needed"] for row in rows if row["controller"] == name])
            ),
        }
        for name in STYLES
    }
    for name, found in summary.items():
        force = found["force, of what is needed"]
        click.echo(
            f"{name}: {found['held']} of {found['of']} held, {force:.2f} times the force needed (median)"
        )
    draw(traces, out / "grasp.png")
    write_json(out / "grasp.json", {"summary": summary, "rows": rows})
