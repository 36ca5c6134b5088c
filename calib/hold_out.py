"""Evaluation of a fit on held-out frames.

Some of the poses are held out, by a seeded draw; frames of one pose stay together. The rest is fitted like
the whole would be, and its errors on the held-out frames are reported. The file is then fitted to all
frames: its errors are about those reported, or a little smaller.
"""

from concurrent.futures import Executor
from typing import Any

import numpy as np

from calib.errors import FitError
from calib.evaluate import evaluate
from calib.extract import Extract
from calib.fit import EVERYTHING, Search, fit
from calib.ridge import pose_numbers
from calib.targets import Targets
from edge.types import Mask, Rest


def held_out_rows(targets: Targets, share: float, seed: int) -> Mask:
    """(n,) bool: which frames are held out; equal poses all or none, the same for the same seed.

    Raises  FitError: too few poses to set some held
    """
    pose = pose_numbers(targets.poses)
    n = int(pose.max()) + 1
    held_n = round(share * n)
    if not 0 < held_n < n:
        raise FitError(f"{targets.where}: {n} different poses; {share:g} of them cannot be held out")
    held = np.random.default_rng(seed).permutation(n)[:held_n]
    return np.asarray(np.isin(pose, held))


def evaluate_held_out(
    rest: Rest,
    targets: Targets,
    extract: Extract,
    share: float,
    seed: int,
    search: Search = EVERYTHING,
    pool: Executor | None = None,
) -> dict[str, Any]:
    """Errors of a fit to the other frames on the frames held out, as given by `calib.evaluate.evaluate`.

    Raises  FitError: too few poses, or nothing could be fitted to the others
    """
    held = held_out_rows(targets, share, seed)
    kept, held_out = np.flatnonzero(~held), np.flatnonzero(held)
    calibration, _ = fit(
        rest,
        targets.rows(kept),
        extract.rows(kept),
        mm_per_px=None,
        search=search,
        pool=pool,
    )
    return evaluate(calibration, targets.rows(held_out), extract.rows(held_out))
