"""`python -m tests.bench grasp`: two simulated fingers, an object with mass, and a gripper, end to end.

The controller is the example's, `docs/examples/gentle_grip.py` and `hostlink/c/examples/gentle_grip.c`. It is
compared with one that closes until the normal force is what the heaviest object needs. Each object is
gripped, lifted, held and shaken.
"""

import ctypes
import math
import runpy
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import click
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from calib.sim import ToolPose
from calib.simulated_hand import FINGERS, GRAVITY_M_S2, GraspedObject, SimulatedHand, Skin
from hostlink import State, Status
from hostlink.wire.state import pack_state
from tests.bench.output import ROOT, show, write_json, writes_results
from tests.support.c_programs import C, compiled

MASSES_G = (50, 100, 200, 350, 500)
FRICTIONS = (0.7, 1.0)
SPEED_MM_S = 2.0  # of the gripper
GROUP = "239.0.0.17"  # multicast: the bus
SHAKE_M_S2, SHAKE_HZ = 3.0, 2.0
LIFT_S, HOLD_S, SHAKE_S = 1.5, 1.0, 1.5
PATIENCE_S = 30.0  # for a gripper that closes
DROPPED_MM, SLIPPED_MM = 5.0, 0.5
STYLES = {"gentle": "-", "gentle, in C": "--", "fixed force": ":"}
#: The tip of `example:press`, with the friction of the skin on the object.
SIMULATION = """
tip = {{n_pins = 127, kind = "hex", pin_radius_mm = 0.8, friction = {friction}}}
camera = {{size_px = [160, 160]}}
look = {{vignetting = 0.0, read_noise = 0.2, shot_noise = 0.0}}
"""
Trace = list[tuple[float, float, float]]
Controller = Callable[[dict[int, State]], tuple[float, bool]]  # speed of closing, mm/s; whether it holds


def gentle() -> Controller:
    """The example's controller, a copy for each finger; the gripper closes if one of them wants to."""
    example = runpy.run_path(str(ROOT / "docs" / "examples" / "gentle_grip.py"))
    grips = {node: example["Grip"]() for node in FINGERS}

    def control(states: dict[int, State]) -> tuple[float, bool]:
        at_most_mm = {node: s.displacement_mm + 2.0 * s.displacement_sigma_mm for node, s in states.items()}
        speeds = [grips[n].speed_mm_s(at_most_mm[n], s.friction, s.slip_margin) for n, s in states.items()]
        return max(speeds), all(grip.held for grip in grips.values())

    return control


def gentle_in_c(library: ctypes.CDLL) -> Controller:
    """The same in C, from the frames as they were sent."""
    grips = {node: ctypes.create_string_buffer(1) for node in FINGERS}  # all zeros: a grip_t at the start

    def control(states: dict[int, State]) -> tuple[float, bool]:
        speeds = [library.grip_speed_mm_s(grips[node], pack_state(s, 0)) for node, s in states.items()]
        return max(speeds), all(grip[0] != b"\0" for grip in grips.values())

    return control


def library_in(folder: Path) -> ctypes.CDLL:
    """The C example as a library."""
    sources = [C / "examples" / "gentle_grip.c", C / "vt_fd.c"]
    loaded = ctypes.CDLL(str(compiled(folder / "gentle_grip.so", sources, "-shared", "-fPIC")))
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
    return GRAVITY_M_S2 * lifted + (
        SHAKE_M_S2 * math.sin(math.tau * SHAKE_HZ * shaken_s) if shaken_s > 0 else 0.0
    )


def grasp(fingers: SimulatedHand, world: GraspedObject, controller: Controller) -> Trace:
    """By step: s since the fingers hold it, normal force of a finger, N, and how far it has slid, mm."""
    while any(s.status & Status.TOUCHED for s in fingers.feel(ToolPose()).values()):
        pass  # opened, it still feels the object of before
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


def row_of(mass_g: int, name: str, world: GraspedObject, trace: Trace) -> dict[str, object]:
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
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside right upper", fontsize=7)
    figure.savefig(path, dpi=110)
    plt.close(figure)


@click.command()
@writes_results
def command(out: Path) -> None:
    """Objects gripped, lifted, held and shaken by two simulated fingers and the example's controller."""
    rows: list[dict[str, object]] = []
    traces = {}
    with tempfile.TemporaryDirectory() as folder:
        library = library_in(Path(folder))
        for friction in FRICTIONS:
            simulation = Path(folder) / f"tip_{friction:g}.toml"
            simulation.write_text(SIMULATION.format(friction=friction))
            skin = Skin(simulation)
            heaviest = GraspedObject(skin, max(MASSES_G) / 1e3).needed_n * (1 + SHAKE_M_S2 / GRAVITY_M_S2)
            with ExitStack() as stack:
                fingers = SimulatedHand(simulation, "example:press", GROUP)
                stack.callback(fingers.close)
                fingers.wait_until_ready()
                for mass_g in MASSES_G:
                    for name, controller in controllers(library, heaviest).items():
                        world = GraspedObject(skin, mass_g / 1e3)
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
