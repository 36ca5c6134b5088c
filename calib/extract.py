"""What the edge sees in many frames, each for itself: the inputs that calibration models are made of.

The frames are spread over processes, or over a Dask cluster; a frame's result depends on nothing but the
frame and the rest image, so it is the same to the last bit wherever it was computed.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from calib.errors import TableError
from edge.calibration import FRAME_INPUTS, frame_inputs
from edge.errors import EdgeError
from edge.pipeline import Pipeline
from edge.sources import read_image
from edge.types import Array, Complex, Feature, Frame, Mask, Rest

__all__ = ["Extract", "executor", "extract"]

#: What models are made of; contacts and slip are not, and cost time.
DEMAND = frozenset({Feature.DISPLACEMENT, Feature.SHEAR, Feature.TILT, Feature.TORSION})
CHUNK = 8  # frames a task: a process is set up in 30 ms, a frame takes 10 to 20


@dataclass(frozen=True, slots=True)
class Extract:
    """One row a frame.

    inputs      (n, k) complex128, `edge.calibration.FRAME_INPUTS`; NaN where nothing could be computed
    confidence  (n,) how sure the pins' identities are
    seen_n      (n,) pins found
    sure        (n,) whether the edge would have sent values
    time_us     (n,) from image to inputs; the only column that differs from run to run
    """

    inputs: Complex
    confidence: Array
    seen_n: Array
    sure: Mask
    time_us: Array


def _one(pipeline: Pipeline, path: Path) -> tuple[Complex, float, int, bool, float]:
    try:
        image = read_image(path)
    except ValueError as error:
        raise TableError(f"{path}: not an image ({error})") from None
    pipeline.forget()
    began = time.perf_counter()
    try:
        result = pipeline.process(Frame(image, 0, 0), even_unsure=True)
    except EdgeError:
        result = None
    us = (time.perf_counter() - began) * 1e6
    if result is None or result.features is None:
        nothing = np.full(len(FRAME_INPUTS), np.nan, dtype=np.complex128)
        return nothing, 0.0, 0 if result is None else result.tracks.n_seen, False, us
    tracks = result.tracks
    inputs = frame_inputs(result.features, pipeline.rest.pattern.tip_radius_px)
    return inputs, tracks.confidence, tracks.n_seen, tracks.confidence >= tracks.LOW_CONFIDENCE, us


def _chunk(rest: Rest, paths: Sequence[Path]) -> list[tuple[Complex, float, int, bool, float]]:
    cv2.setNumThreads(1)  # one thread a process: the processes are the parallelism
    pipeline = Pipeline(rest, demand=DEMAND)
    return [_one(pipeline, path) for path in paths]


def extract(
    rest: Rest, paths: Sequence[Path], pool: Executor, on_done: Callable[[int], None] = lambda n: None
) -> Extract:
    """Run the edge over still frames, each as a jump from rest.

    pool     any executor; `executor` makes one
    on_done  called with the number of frames done since the last call
    Raises   TableError: a file is not an image
    """
    futures: dict[Future[Any], int] = {}
    for start in range(0, len(paths), CHUNK):
        futures[pool.submit(_chunk, rest, tuple(paths[start : start + CHUNK]))] = start
    rows: list[Any] = [None] * len(paths)
    try:
        for future in as_completed(futures):
            done = future.result()
            rows[futures[future] : futures[future] + len(done)] = done
            on_done(len(done))
    except BaseException:
        for future in futures:
            future.cancel()
        raise
    inputs, confidence, seen_n, sure, time_us = zip(*rows, strict=True)
    return Extract(
        np.array(inputs), np.array(confidence), np.array(seen_n), np.array(sure), np.array(time_us)
    )


@contextmanager
def executor(dask: str | None = None, workers: int | None = None) -> Iterator[Executor]:
    """Where the work runs: all cores of this machine, or a Dask cluster.

    dask     address of a scheduler, e.g. tcp://10.0.0.5:8786
    workers  processes on this machine; None: one a core
    Raises   TableError: no cluster answers, or the extra is missing
    """
    if dask is None:
        count = workers or len(os.sched_getaffinity(0))
        # Not by fork: threads of libraries that this process loaded would be left behind locked.
        with ProcessPoolExecutor(count, mp_context=get_context("forkserver")) as pool:
            yield pool
        return
    try:
        from distributed import Client
    except ImportError as error:
        raise TableError(f"--dask {dask}: {error}; install voronoi-touch[cluster]") from None
    try:
        client = Client(dask, timeout="10s", set_as_default=False)
    except (OSError, ValueError) as error:
        raise TableError(f"--dask {dask}: no scheduler answers there ({error})") from None
    with client:
        yield client.get_executor()
