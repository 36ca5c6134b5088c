"""What `tests.bench.host` counts: `python -m tests.bench.host_child N`, samples received and values read."""

import gc
import sys
from dataclasses import replace
from random import Random

from hostlink.decoder import CanDecoder, Sample
from hostlink.wire import State, Status, pack_state
from tests.bench.marks import Marks
from tests.support.states import random_state

WARM = 1000
PERIOD_S = 0.004167  # of `random_state`


def frames_of(n: int) -> list[bytes]:
    """State frames of a finger in contact, with other values in each."""
    rng = Random(1)
    states = [replace(random_state(rng, k), status=Status.TOUCHED, latency_us=2000) for k in range(n)]
    return [pack_state(state, k) for k, state in enumerate(states)]


def control(decoder: CanDecoder, frames: list[tuple[bytearray, float]]) -> None:
    """A control loop that reads a few values; data come as python-can gives them."""
    for data, arrival_s in frames:
        for event in decoder.receive(0x181, data, arrival_s):
            if isinstance(event, Sample):
                state: State = event.state
                _ = state.status, state.displacement_mm, state.shear_x_mm, state.shear_y_mm


def main(n: int) -> None:
    rng, decoder = Random(2), CanDecoder()
    frames = [
        (bytearray(data), 100.0 + PERIOD_S * k + rng.uniform(0, 3e-4))
        for k, data in enumerate(frames_of(WARM + n))
    ]
    control(decoder, frames[:WARM])
    gc.disable()
    marks = Marks()
    with marks:
        control(decoder, frames[WARM:])


if __name__ == "__main__":
    main(int(sys.argv[1]))
