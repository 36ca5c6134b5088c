"""What `tests.bench.accuracy` counts: `python -m tests.bench.accuracy_child STILLS CALIBRATION DEMAND N`.

STILLS is an .npz: `rest`, and `images`. CALIBRATION is a file, or `paper` for the reference. DEMAND names
features, with commas. Each image is found as a jump, processed once more, and then N times, which count.
"""

import gc
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from edge.calibration import Calibration
from edge.frame import Pipeline
from edge.pins import take_rest
from edge.types import Feature, Frame
from tests.bench.marks import Marks
from tests.bench.reference import Reference


def main(stills: str, calibration: str, demand: str, n: int) -> None:
    with np.load(stills) as stored:
        rest_image, images = stored["rest"], stored["images"]
    rest = take_rest([rest_image])
    paper = calibration == "paper"
    features = frozenset(Feature(name) for name in demand.split(","))
    pipeline = Pipeline(rest, None if paper else Calibration.load(Path(calibration)), features)
    reference = Reference(rest_image, rest.pattern.pin_radius_px, rest_img=rest.xy_img) if paper else None
    gc.disable()
    marks = Marks()
    for image in images:
        pipeline.forget()
        tracks = pipeline.process(Frame(image, 0, 0)).tracks
        step: Callable[[], object] = partial(pipeline.process, Frame(image, 0, 0))
        if reference is not None:
            reference.place(tracks.xy_img)
            step = partial(reference.step, image)
        step()
        with marks:
            for _ in range(n):
                step()


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4]))
