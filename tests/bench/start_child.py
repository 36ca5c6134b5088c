"""What `tests.bench.step --start` counts: `python -m tests.bench.start_child FRAMES CALIBRATION [MAPS]`.

FRAMES and CALIBRATION as of `tests.bench.step_child`, MAPS as of `Marks`. All is counted from the first
import to the frame with the first values. The tables of contacts and lost pins are made beside later frames.
"""

import os
import sys

from tests.bench.marks import Marks


def main(path: str, calibration: str, maps: str = "") -> None:
    marks = Marks(maps)
    with marks:
        import numpy as np

        import edge.cli.run  # noqa: F401  (what a finger loads)
        from edge.config import FeaturesTable
        from tests.bench import step_child

    with np.load(path) as stored:
        images, first = stored["images"], int(stored["first"])
    with marks:
        source = step_child.Source((images.shape[2], images.shape[1]))
        loop, _bus = step_child.opened(source, calibration, frozenset(FeaturesTable().demand))
        for frame in step_child.frames(images, first):
            source.taken()
            loop.step(frame)
            if loop.measurement.last is not None:
                break
    os._exit(0)  # the sink's threads wait


if __name__ == "__main__":
    main(*sys.argv[1:])
