"""The edge's results for many independent frames: the inputs of calibration models.

The frames are spread over processes, or over a Dask cluster; a frame's result depends on nothing but the
frame and the rest image, so it is exactly the same wherever it was computed.
"""

from __future__ import annotations

import itertools
import math
import os
import re
import signal
import threading
import time
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from multiprocessing import active_children, forkserver, get_context, parent_process, resource_tracker
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.errors import TableError
from edge.calibration.evaluation import InputRow
from edge.calibration.inputs import CONTACT_INPUTS, FRAME_INPUTS
from edge.errors import EdgeError
from edge.frame import Pipeline
from edge.geometry.parts import rows_of
from edge.runtime.process import give_back_memory
from edge.sources.files import read_image
from edge.types import (
    Array,
    Complex,
    ContactRegion,
    Feature,
    Features,
    Frame,
    Image,
    Index,
    Mask,
    PinPattern,
    Pins,
    Rest,
    Tracks,
)
from hostlink.interrupt import ENDING

#: Features that models use; not slip, which needs a sequence.
DEMAND = frozenset({Feature.DISPLACEMENT, Feature.SHEAR, Feature.TILT, Feature.TORSION, Feature.CONTACTS})
REPEATS = 4  # of each image: a lost group is recovered from its edge inwards, one ring of pins each time
#: Pins are removed to learn the effect of their loss. A spot lies where the motion is large, because a touch
#: that hides pins hides those.
LOSSES = ("one side", "anywhere", "a spot", "a spot")
LOSS_MIN, LOSS_MAX = 0.03, 0.45  # share of the pins; of a spot's, at least one
CHUNK = 8  # frames a task: a tenth of a second, for a smooth progress bar and short waits
CLUSTER_TIMEOUT_S = 10.0  # for a scheduler to answer
IN_FLIGHT = 32  # tasks: images of 640x480 take 80 MB


@dataclass(frozen=True, slots=True)
class Extract:
    """One row a frame.

    inputs      (n, k) complex128, `edge.calibration.inputs.FRAME_INPUTS`; NaN: not computed
    contact     (n, k) complex128, `edge.calibration.inputs.CONTACT_INPUTS` of the strongest contact, or NaN
    confidence  (n,) certainty of the pins' identities
    seen_n      (n,) pins found
    trusted     (n,) whether the edge would have sent values
    in_contact  (n,) whether it saw a touch; without one it sends zeros instead of a model's value
    counts      (n,) contacts found
    angle_rad   (n,) direction of the strongest contact's long axis; NaN: round, or none
    lossy       (n, LOSSES, k) complex128, the inputs with some of the pins removed; NaN: not possible
    time_us     (n,) from image to inputs; the only column that differs from run to run
    """

    inputs: Complex
    contact: Complex
    confidence: Array
    seen_n: Array
    trusted: Mask
    in_contact: Mask
    counts: Index
    angle_rad: Array
    time_us: Array
    lossy: Complex

    def rows(self, chosen: NDArray[np.integer[Any]] | Sequence[int]) -> Extract:
        """Some of the rows, by index."""
        return rows_of(self, np.asarray(chosen))


_NOTHING = np.full(len(FRAME_INPUTS), np.nan, dtype=np.complex128)
_NO_LOSSES = np.full((len(LOSSES), len(FRAME_INPUTS)), np.nan, dtype=np.complex128)
_NO_CONTACT = np.full(len(CONTACT_INPUTS), np.nan, dtype=np.complex128)
Measured = tuple[Complex, Complex, float, int, bool, bool, int, float, float, Complex]


def measure(pipeline: Pipeline, image: Image, without: Pipeline | None = None) -> Measured:
    """One row of an `Extract`: a single image, as a jump from rest, then repeated.

    without  another pipeline of the same tip, for the frame with pins removed; None: not wanted

    A jump loses pins that moved as no neighbour did: those at the top of a sharp probe. The next frame, which
    shows the same while a rig stands still, finds them in their windows; here the same image is used again.
    """
    pipeline.forget(noise=True)
    began = time.perf_counter()
    try:
        result = pipeline.process(Frame(image, 0, 0), even_untrusted=True)
        for _ in range(REPEATS - 1):
            if result.tracks.confidence < result.tracks.LOW_CONFIDENCE or result.tracks.seen.all():
                break
            again = pipeline.process(Frame(image, 0, 0), even_untrusted=True)
            if again.tracks.n_seen <= result.tracks.n_seen:
                break
            result = again
    except EdgeError:
        result = None
    us = (time.perf_counter() - began) * 1e6
    if result is None or result.features is None:
        seen_n = 0 if result is None else result.tracks.n_seen
        return _NOTHING, _NO_CONTACT, 0.0, seen_n, False, False, 0, math.nan, us, _NO_LOSSES
    tracks, features = result.tracks, result.features
    pattern = (pipeline.rest.since or pipeline.rest).pattern
    contact, angle = _NO_CONTACT, math.nan
    if features.contacts:
        contact = contact_inputs(features.contacts[0], features, pattern)
        angle = features.contacts[0].orientation_rad
    inputs = frame_inputs(features, pattern)
    trusted = tracks.confidence >= tracks.LOW_CONFIDENCE
    count = len(features.contacts or ())
    lossy = _NO_LOSSES
    if without is not None and features.in_contact:
        lossy = np.array([_inputs_of(without, one) for one in _losses(tracks, pipeline.rest)])
    return (
        inputs,
        contact,
        tracks.confidence,
        tracks.n_seen,
        trusted,
        features.in_contact,
        count,
        angle,
        us,
        lossy,
    )


def frame_inputs(features: Features, pattern: PinPattern) -> Complex:
    """The inputs `FRAME_INPUTS` of one frame, as of `InputRow`; a new array."""
    row = InputRow(FRAME_INPUTS)
    row.write_frame(features, pattern)
    values: Complex = row.values
    return values


def contact_inputs(contact: ContactRegion, features: Features, pattern: PinPattern) -> Complex:
    """The inputs `CONTACT_INPUTS` of one contact of a frame, as of `InputRow`; a new array."""
    row = InputRow(CONTACT_INPUTS)
    row.write_contact(contact, features, pattern)
    values: Complex = row.values
    return values


def _losses(tracks: Tracks, rest: Rest) -> Iterator[Tracks]:
    """The frame with pins lost, as `LOSSES` says; the same from run to run."""
    rng = np.random.default_rng(zlib.crc32(np.ascontiguousarray(tracks.xy_img).tobytes()))
    place = rest.xy_img - rest.pattern.centre_img
    motion = np.where(tracks.seen, ((tracks.xy_img - rest.xy_img) ** 2).sum(axis=1), 0.0)
    for kind in LOSSES:
        lost_n = rng.uniform(LOSS_MIN, LOSS_MAX) * len(place)
        if kind == "anywhere":
            order = rng.permutation(len(place))
        elif kind == "one side":
            turn = rng.uniform(0.0, 2.0 * math.pi)
            order = np.argsort(place @ (math.cos(turn), math.sin(turn)))
        else:
            lost_n = (LOSS_MAX * len(place)) ** rng.uniform()
            middle = place[rng.choice(len(place), p=motion / motion.sum())]
            order = np.argsort(np.hypot(*(place - middle).T))
        seen = tracks.seen.copy()
        seen[order[: round(lost_n)]] = False
        xy, sigma = tracks.xy_img.copy(), tracks.sigma_px.copy()
        xy[~seen], sigma[~seen] = np.nan, np.nan
        yield Tracks.of(xy, sigma, seen, tracks.confidence)


def _inputs_of(pipeline: Pipeline, tracks: Tracks) -> Complex:
    pipeline.forget(noise=True)
    try:
        features = pipeline.features(tracks)
    except EdgeError:
        return _NOTHING
    return frame_inputs(features, pipeline.rest.pattern)


def gather(rows: Sequence[Measured]) -> Extract:
    """Rows as columns."""
    return Extract(*(np.array(column) for column in zip(*rows, strict=True)))


_kept: tuple[Rest, Pipeline, Pipeline] | None = None  # of this process: a pipeline takes 30 ms to set up


def _chunk(rest: Rest, frames: Sequence[Path | Image]) -> list[Measured]:
    global _kept
    cv2.setNumThreads(1)  # one thread a process: the processes are the parallelism
    if _kept is None or not _same(_kept[0], rest):
        # Arrays received over a network are views of the message: a copy is aligned and writable.
        rest = replace(_copied(rest), since=_copied(rest.since) if rest.since else None)
        _kept = rest, Pipeline(rest, demand=DEMAND), Pipeline(rest, demand=DEMAND)
    _, pipeline, without = _kept
    return [measure(pipeline, read_like(f, rest) if isinstance(f, Path) else f, without) for f in frames]


def _copied(rest: Rest) -> Rest:
    pins = Pins(*(np.array(getattr(rest.pins, f.name), order="C") for f in fields(Pins)))
    return replace(
        rest, pins=pins, pattern=replace(rest.pattern, centre_img=np.array(rest.pattern.centre_img))
    )


def read_like(path: Path, rest: Rest) -> Image:
    """An image of the rest frame's camera. Raises TableError: it has another size; SourceError."""
    image = read_image(path)
    width, height = rest.pattern.size_px
    if image.shape != (height, width):
        raise TableError(
            f"{path}: {image.shape[1]}x{image.shape[0]} px, but the rest image is {width}x{height}; "
            "both must come from the same camera"
        )
    return image


def _same(a: Rest, b: Rest) -> bool:
    if a.pattern.on_surface != b.pattern.on_surface:
        return False
    counted = np.array_equal((a.since or a).xy_img, (b.since or b).xy_img)
    return counted and np.array_equal(a.xy_img, b.xy_img) and np.array_equal(a.pins.sigma_px, b.pins.sigma_px)


def extract(
    rest: Rest,
    frames: Iterable[Path | Image],
    pool: Executor,
    on_done: Callable[[int], None] = lambda n: None,
) -> Extract:
    """Run the edge over still frames, each as a jump from rest.

    frames   files, or images; read only as fast as the work is done
    pool     any executor; `executor` makes one
    on_done  called with the number of frames done since the last call
    Raises   SourceError: a file is not an image
    """
    running: dict[Future[list[Measured]], int] = {}
    rows: dict[int, list[Measured]] = {}

    def collect(at_most: int) -> None:
        while len(running) > at_most:
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                done = future.result()
                rows[running.pop(future)] = done
                on_done(len(done))

    for number, chunk in enumerate(_chunks(frames)):
        collect(IN_FLIGHT - 1)
        running[pool.submit(_chunk, rest, chunk)] = number
    collect(0)
    found = gather([row for number in sorted(rows) for row in rows[number]])
    rows.clear()
    give_back_memory()  # small pieces, of which no large array can be made
    return found


def _chunks(frames: Iterable[Path | Image]) -> Iterator[tuple[Path | Image, ...]]:
    left = iter(frames)
    while chunk := tuple(itertools.islice(left, CHUNK)):
        yield chunk


@contextmanager
def executor(dask: str | None = None, workers: int | None = None) -> Iterator[Executor]:
    """Where the work runs: all cores of this machine, or a Dask cluster.

    dask     address of a scheduler, e.g. tcp://10.0.0.5:8786
    workers  processes on this machine; None: one a core
    Raises   TableError: no cluster answers, or the extra is missing
    """
    if dask is None:
        with _processes(workers or len(os.sched_getaffinity(0))) as pool:
            yield pool
        return
    try:
        from distributed import Client
    except ImportError as error:
        raise TableError(f"--dask {dask}: {error}; install voronoi-touch[cluster] or -e .[cluster]") from None
    if not re.fullmatch(r"((tcp|tls|ws|wss)://)?[^/:\s]+:[0-9]{1,5}", dask):
        raise TableError(f"--dask {dask}: not an address; give one such as tcp://host:8786")
    try:
        client = Client(dask, timeout=CLUSTER_TIMEOUT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise TableError(f"--dask {dask}: no scheduler answers there ({error})") from None
    with client:
        yield client.get_executor()


@contextmanager
def _processes(count: int) -> Iterator[Executor]:
    """Processes of this machine, one thread each: two threads took five times as long on two busy cores."""
    before = os.environ.get("OMP_NUM_THREADS")
    os.environ["OMP_NUM_THREADS"] = "1"
    others = set(active_children())
    try:
        # Not by fork: locks held by this process's library threads would stay locked in the child.
        context = get_context("forkserver")
        with ProcessPoolExecutor(count, mp_context=context, initializer=_end_with_parent) as pool:
            try:
                _start_without_interrupts(pool, count)
                yield pool
            except KeyboardInterrupt:  # their results are no longer wanted
                for process in set(active_children()) - others:
                    process.terminate()
                raise
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise
    finally:
        os.environ.pop("OMP_NUM_THREADS")
        if before is not None:
            os.environ["OMP_NUM_THREADS"] = before


def _end_with_parent() -> None:
    """End this worker with the program that started it, also where that was killed.

    It waits for work at a pipe of which it holds the other end too, so that alone would never tell it.
    """
    parent = parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _start_without_interrupts(pool: Executor, count: int) -> None:
    """Start the processes with the terminal's signals blocked, which they inherit.

    Ctrl-C and a lost terminal reach all processes of it. This one ends the others; otherwise each of them
    would print a traceback, also one that is just starting.
    """
    resource_tracker.ensure_running()  # started later, it would unblock the signal
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, set(ENDING) - {signal.SIGTERM})
    try:
        forkserver.ensure_running()
        for _ in range(count):  # a process is started for a task if none is idle
            pool.submit(int)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
