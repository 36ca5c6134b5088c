"""What `tests.bench.instructions` counts: `python -m tests.bench.instructions_child KIND FRAMES WARM N`.

KIND is `pipeline` (all but the picture of the surface), `grasp` (displacement and shear only) or `reference`.
FRAMES is an .npz of images, the first of the untouched tip, and `contact`, the index where the contact
begins. WARM frames of it are processed first, then N that count, up and down.
"""

from __future__ import annotations

import gc
import sys

import numpy as np

from edge.types import Feature, Frame
from tests.bench.frames import REST_FRAMES, back_and_forth, calibration_of
from tests.bench.instructions import Counter
from tests.bench.reference import Reference
from tests.bench.speed import started


def main(kind: str, path: str, warm: int, n: int) -> None:
    with np.load(path) as recording:
        images, first = recording["images"], int(recording["contact"])
    frames = [
        Frame(sequence=k, capture_ns=k * 4_166_667, image=image, bits=8) for k, image in enumerate(images)
    ]
    contact = back_and_forth(frames[first:], warm + n)
    rest, up = frames[:REST_FRAMES], frames[REST_FRAMES:first]
    grasp = frozenset({Feature.DISPLACEMENT, Feature.SHEAR})
    demand = grasp if kind == "grasp" else frozenset(Feature) - {Feature.SURFACE}
    pipeline = started([*rest, *up], calibration_of(frames), demand)
    gc.disable()
    counter = Counter()
    if kind == "reference":
        reference = Reference(frames[0].image, pipeline.rest.pattern.pin_radius_px)
        for frame in [*up, *contact[:warm]]:
            reference.step(frame.image)
        with counter:
            for frame in contact[warm:]:
                reference.step(frame.image)
        return
    for frame in contact[:warm]:
        pipeline.process(frame)
    with counter:
        for frame in contact[warm:]:
            assert not pipeline.process(frame).searched, "tracking is to be measured"


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))
