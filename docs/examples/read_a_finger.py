"""Read a finger on a bus, and print what it feels.

    python docs/examples/read_a_finger.py [ADDRESS]

ADDRESS is can:can0, serial:/dev/ttyACM0, udp:239.0.0.1, ... Without a finger, let this run beside it:

    python -m edge replay example:press --sink "udp:239.0.0.1?ttl=0" --loop
"""

import sys

import hostlink


def main(address: str) -> None:
    with hostlink.connect(address) as hand:
        for sample in hand.samples(timeout_s=5.0):
            state = sample.state
            # NaN: not valid in this sample. A status bit says why: camera, pins, calibration, ...
            print(
                f"finger {sample.finger}: depth {state.displacement_mm:.2f} mm, force {state.force_n:.2f} N, "
                f"shear {state.shear_x_mm:.2f}, {state.shear_y_mm:.2f} mm, margin {state.slip_margin:.2f}"
            )


if __name__ == "__main__":
    try:
        main((sys.argv[1:] or ["udp:239.0.0.1"])[0])
    except hostlink.LinkError as error:
        raise SystemExit(f"{error}") from None
