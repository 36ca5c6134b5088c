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
from edge.calibration import CONTACT_INPUTS, FRAME_INPUTS, contact_inputs, frame_inputs
from edge.errors import EdgeError
from edge.pipeline import Pipeline
from edge.sources import read_image
from edge.types import Array, Complex, Feature, Frame, Image, Mask, Rest

__all__ = ["DEMAND", "Extract", "executor", "extract", "gather", "measure"]

#: What models are made of; slip is not, and needs a sequence.
DEMAND = frozenset({Feature.DISPLACEMENT, Feature.SHEAR, Feature.TILT, Feature.TORSION, Feature.CONTACTS})
CHUNK = 8  # frames a task: a process is set up in 30 ms, a frame takes 10 to 20


@dataclass(frozen=True, slots=True)
class Extract:
    """One row a frame.

    inputs      (n, k) complex128, `edge.calibration.FRAME_INPUTS`; NaN where nothing could be computed
    contact     (n, k) complex128, `edge.calibration.CONTACT_INPUTS` of the strongest contact; NaN: none
    confidence  (n,) how sure the pins' identities are
    seen_n      (n,) pins found
    sure        (n,) whether the edge would have sent values
    time_us     (n,) from image to inputs; the only column that differs from run to run
    """

    inputs: Complex
    contact: Complex
    confidence: Array
    seen_n: Array
    sure: Mask
    time_us: Array


_NOTHING = np.full(len(FRAME_INPUTS), np.nan, dtype=np.complex128)
_NO_CONTACT = np.full(len(CONTACT_INPUTS), np.nan, dtype=np.complex128)
_Row = tuple[Complex, Complex, float, int, bool, float]


def measure(pipeline: Pipeline, image: Image) -> _Row:
    """One row of an `Extract`: an image taken for itself, as a jump from rest."""
    pipeline.forget()
    began = time.perf_counter()
    try:
        result = pipeline.process(Frame(image, 0, 0), even_unsure=True)
    except EdgeError:
        result = None
    us = (time.perf_counter() - began) * 1e6
    if result is None or result.features is None:
        return _NOTHING, _NO_CONTACT, 0.0, 0 if result is None else result.tracks.n_seen, False, us
    tracks, features, pattern = result.tracks, result.features, pipeline.rest.pattern
    contact = _NO_CONTACT
    if features.contacts:
        contact = contact_inputs(features.contacts[0], features, pattern)
    inputs = frame_inputs(features, pattern.tip_radius_px)
    sure = tracks.confidence >= tracks.LOW_CONFIDENCE
    return inputs, contact, tracks.confidence, tracks.n_seen, sure, us


def gather(rows: Sequence[_Row]) -> Extract:
    """Rows as columns."""
    inputs, contact, confidence, seen_n, sure, time_us = zip(*rows, strict=True)
    return Extract(
        np.array(inputs),
        np.array(contact),
        np.array(confidence),
        np.array(seen_n),
        np.array(sure),
        np.array(time_us),
    )


def _chunk(rest: Rest, paths: Sequence[Path]) -> list[_Row]:
    cv2.setNumThreads(1)  # one thread a process: the processes are the parallelism
    pipeline = Pipeline(rest, demand=DEMAND)
    rows = []
    for path in paths:
        rows.append(measure(pipeline, read_image(path)))
    return rows


def extract(
    rest: Rest, paths: Sequence[Path], pool: Executor, on_done: Callable[[int], None] = lambda n: None
) -> Extract:
    """Run the edge over still frames, each as a jump from rest.

    pool     any executor; `executor` makes one
    on_done  called with the number of frames done since the last call
    Raises   SourceError: a file is not an image
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
    return gather(rows)


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
