"""Gentle grip: close until the skin is pressed in by 0.8 mm, then further only as the slip margin asks.

python docs/examples/gentle_grip.py              a simulated finger, whose object is pulled away
python docs/examples/gentle_grip.py can:can0     a finger on any link: let `move` drive your gripper
"""

import math
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import hostlink
from calib.sim import Appearance, Camera, Simulator, Tip, ToolPose
from edge import Fingertip

DEPTH_MM, SPEED_MM_S, MARGIN = 0.8, 2.0, 0.2
FRICTION = 0.6  # taken for granted; what the object has is not known before it was dragged


class Grip:
    held = False

    def speed_mm_s(self, depth_mm: float, friction: float, margin: float) -> float:
        if not self.held:  # NaN, a value that is not valid, compares as false: then it waits
            self.held = depth_mm >= DEPTH_MM
            return SPEED_MM_S if depth_mm < DEPTH_MM else 0.0
        load = friction * (1.0 - margin)  # along the surface, over the normal force
        return SPEED_MM_S if load > (1.0 - MARGIN) * max(friction, FRICTION) else 0.0


def simulated() -> Iterator[tuple[float, float]]:
    camera = Camera(tip=Tip(127, "hex", pin_radius_mm=0.8), size_px=(160, 160))
    finger = Simulator(camera, Appearance(vignetting=0, read_noise=0.2, shot_noise=0), rate_hz=25.0)
    tip = Fingertip([finger.frame().image for _ in range(8)], "example:press")
    grip, closed_mm, pulled_mm = Grip(), -0.5, 0.0
    while pulled_mm < 1.3:
        frame = finger.frame((ToolPose(depth_mm=closed_mm, shear_x_mm=pulled_mm),) if closed_mm > 0 else ())
        read = tip.read(frame.image, frame.capture_ns / 1e9).reading
        at_most_mm = read.values["displacement_mm"] + 2.0 * read.sigmas["displacement_mm"]
        of_load = (read.values.get(name, math.nan) for name in ("friction", "slip_margin"))
        closed_mm += grip.speed_mm_s(at_most_mm, *of_load) / finger.rate_hz
        pulled_mm += 0.02 if grip.held else 0.0
        yield closed_mm, max((frame.truth or {})["slip"], default=0.0)


def on_link(address: str, move: Callable[[float], object] = print) -> None:
    grip = Grip()
    with hostlink.connect(address) as hand, ExitStack() as at_the_end:
        at_the_end.callback(move, 0.0)
        for sample in hand.samples(timeout_s=0.05):  # silence ends it
            s, stop = sample.state, sample.state.status & (hostlink.NO_CONTROL | hostlink.Status.OVERLOAD)
            at_most_mm = s.displacement_mm + 2.0 * s.displacement_sigma_mm  # Of an unknown touch it is large.
            move(0.0 if stop else grip.speed_mm_s(at_most_mm, s.friction, s.slip_margin))


if __name__ == "__main__":
    if sys.argv[1:]:
        on_link(sys.argv[1])
    for closed, slides in simulated():
        print(f"closed {closed:5.2f} mm   {slides:4.0%} of the contact slides")
