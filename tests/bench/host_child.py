"""What `tests.bench.host` counts: `python -m tests.bench.host_child N`, samples received and four values read."""

import gc
import sys
from random import Random

from hostlink.decoder import CanDecoder, Sample
from hostlink.wire import State, pack_state
from tests.bench.marks import Marks
from tests.support.states import random_state

WARM = 1000


def control(decoder: CanDecoder, frames: list[tuple[bytearray, float]]) -> None:
    """A control loop that reads a few values; data come as python-can gives them."""
    for data, arrival_s in frames:
        for event in decoder.receive(0x181, data, arrival_s):
            if isinstance(event, Sample):
                state: State = event.state
                _ = state.status, state.displacement_mm, state.shear_x_mm, state.shear_y_mm


def main(n: int) -> None:
    rng, decoder = Random(1), CanDecoder()
    frames = [
        (bytearray(pack_state(random_state(rng, k), k)), 100.0 + k * 0.004167 + rng.uniform(0, 3e-4))
        for k in range(WARM + n)
    ]
    control(decoder, frames[:WARM])
    gc.disable()
    marks = Marks()
    with marks:
        control(decoder, frames[WARM:])


if __name__ == "__main__":
    main(int(sys.argv[1]))
