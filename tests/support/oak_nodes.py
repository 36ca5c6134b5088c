"""Host nodes of depthai's own in place of a module's cameras.

As a program, `python -m tests.support.oak_nodes hand CONFIG...`: `edge hand` on such nodes. All play one
recording, with one number and one time for each exposure.
"""

import threading
import time
from collections.abc import Callable, Iterable
from datetime import timedelta
from itertools import count
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np

from edge.cli import hand, program
from edge.sources import oak, open_source
from edge.types import Image

SIZE = (64, 48)
STEP = timedelta(milliseconds=20)


def noise(n: int) -> Image:
    return np.random.default_rng(n).integers(0, 256, (SIZE[1], SIZE[0]), dtype=np.uint8)


def frames_output(
    dai: Any,
    steps: Iterable[int],
    gate: Callable[[int], object] = lambda n: None,
    picture: Callable[[int], Image] = noise,
    begin: timedelta = timedelta(seconds=1),
) -> Any:
    """A host node that emits frames with these sequence numbers, each after its gate."""

    class Node(dai.node.ThreadedHostNode):  # type: ignore[misc]  # its stubs do not know the class
        def __init__(self) -> None:
            super().__init__()
            self.out = self.createOutput("out")

        def run(self) -> None:
            for n in steps:
                gate(n)
                if not self.isRunning():
                    return
                image = picture(n)
                message = dai.ImgFrame()
                message.setType(dai.ImgFrame.Type.GRAY8)
                message.setWidth(image.shape[1])
                message.setHeight(image.shape[0])
                message.setData(image.ravel())
                message.setSequenceNum(n)
                message.setTimestamp(begin + n * STEP)
                message.setTimestampDevice(timedelta(microseconds=77) + n * STEP)
                self.out.send(message)

    def make(pipeline: Any) -> Any:
        return pipeline.create(Node).out

    return make


def paced(begin: timedelta) -> Callable[[int], object]:
    """A gate that opens when the exposure is over."""
    return lambda n: threading.Event().wait((begin + n * STEP).total_seconds() - time.monotonic())


def main() -> None:
    images = [frame.image for frame in open_source("example:press")]
    begin = timedelta(seconds=time.monotonic())

    def played(camera: oak.OakCamera) -> Any:
        output = frames_output(
            oak.load_depthai(), count(), paced(begin), lambda n: images[n % len(images)], begin
        )
        return SimpleNamespace(**camera._asdict(), output=output)

    with patch.object(hand, "OakModule", lambda cameras, find: oak.OakModule([*map(played, cameras)])):
        program.main()


if __name__ == "__main__":
    main()
