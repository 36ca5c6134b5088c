"""`python -m tests.bench forces`: forces of known weights, read by our fit and by scikit-learn's.

A published FingerVision dome under weights, straight and on wedges. Each load, or pose, is read by models of
the others, of the same pin tracks. Repeats share how the tip was set down, so scikit-learn's models are
fitted to all frames, and to the mean of each pose. What lies beyond the others is left out: the edge sends no
more than was calibrated.
"""

from collections.abc import Callable
from pathlib import Path

import click
import numpy as np

from calib.dataset import Dataset, open_dataset
from calib.evaluate import predict
from calib.extract import DEMAND, Extract, executor
from calib.fit import Prefer, Search, fit
from calib.ridge import pose_numbers
from calib.targets import Targets
from edge.frame import Pipeline
from edge.sources.files import read_image
from edge.types import Array, Frame, Index, Mask
from hostlink.extras import require
from tests.bench.output import markdown, writes_results
from tests.bench.recordings import real_option

FORCES = ("force_x_n", "force_y_n", "force_n")
COLUMNS = ("x N", "y N", "z N", "x %", "y %", "z %", "% within sigma")
COMPONENTS = 10  # principal ones of the motion, for the Gaussian process
Reader = Callable[[Index, Index], tuple[Array, Array]]


def motions(data: Dataset, targets: Targets) -> Array:
    """(frames, 2 pins) px; 0: the pin is lost."""
    pipeline = Pipeline(data.rest, demand=DEMAND)
    rows = []
    for path in targets.frames:
        pipeline.forget()
        tracks = pipeline.process(Frame(read_image(path), 0, 0), even_untrusted=True).tracks
        rows.append((tracks.xy_img - data.rest.xy_img).ravel())
    return np.nan_to_num(np.array(rows))


def ours(data: Dataset, targets: Targets, seen: Extract, prefer: Prefer) -> Reader:
    """Values and sigmas (frames, 3) of the second rows, by our fit to the first."""

    def read(train: Index, test: Index) -> tuple[Array, Array]:
        part = targets.rows(train), seen.rows(train)
        calibration, _ = fit(data.rest, *part, mm_per_px=None, search=Search(prefer))
        tables = predict(calibration, seen.rows(test))
        both = [np.column_stack([table[name] for name in FORCES]) for table in tables]
        return both[0], both[1]

    return read


def theirs(name: str, motion: Array, truth: Array, pose: Index, *, means: bool) -> Reader:
    """The same by scikit-learn."""
    from sklearn.decomposition import PCA
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
    from sklearn.linear_model import RidgeCV

    def read(train: Index, test: Index) -> tuple[Array, Array]:
        rows = [train[pose[train] == k] for k in np.unique(pose[train])] if means else train[:, None]
        x, y = (np.array([table[one].mean(axis=0) for one in rows]) for table in (motion, truth))
        if name == "ridge":
            values = RidgeCV(np.logspace(-3, 4, 15)).fit(x, y).predict(motion[test])
            return values, np.full_like(values, np.nan)
        components = PCA(COMPONENTS).fit(x)
        x, asked = components.transform(x), components.transform(motion[test])
        kernel = ConstantKernel() * RBF(3.0) + WhiteKernel(0.1)
        fitted = [GaussianProcessRegressor(kernel, normalize_y=True).fit(x / x.std(), one) for one in y.T]
        both = np.array([one.predict(asked / x.std(), return_std=True) for one in fitted]).transpose(1, 2, 0)
        return both[0], both[1]

    return read


def judged(name: str, read: Reader, truth: Array, in_contact: Mask, group: Index) -> dict[str, object]:
    """Errors on each load or pose within the range of the others, read by models of these."""
    values, sigmas = np.full((2, *truth.shape), np.nan)
    for k in np.unique(group):
        others = truth[in_contact & (group != k)]
        inside = np.all((others.min(axis=0) <= truth) & (truth <= others.max(axis=0)), axis=1)
        test = np.flatnonzero(in_contact & inside & (group == k)).astype(np.int32)
        if len(test):
            values[test], sigmas[test] = read(np.flatnonzero(group != k).astype(np.int32), test)
    error, sigma = (table[np.isfinite(values[:, 0])] for table in (np.abs(values - truth), sigmas))
    shares = np.where(np.isfinite(sigma), 100.0 * (error <= sigma), np.nan)  # a ridge has no sigma
    figures = *error.mean(axis=0), *shares.mean(axis=0), shares.mean()
    return {"": name, "frames": len(error), **dict(zip(COLUMNS, map(float, figures), strict=True))}


@click.command()
@real_option
@writes_results
def command(folder: Path, out: Path) -> None:
    """Forces of weights on a published dome, against scikit-learn, leave one load out."""
    require("sklearn", "dev")
    where = folder / "fingervision_dome"
    data = open_dataset([where / "targets.csv"], where / "frames", None)
    with executor() as pool:
        seen = data.extract(pool)
    targets, motion = data.targets, motions(data, data.targets)
    truth = np.column_stack([targets.values[name] for name in FORCES])
    load, pose = pose_numbers(truth.round(1)), pose_numbers(truth)  # nearly the same mass is one load
    readers = {f"calib fit --prefer {prefer}": ours(data, targets, seen, prefer) for prefer in Prefer}
    for name in ("ridge", "Gaussian process"):
        readers[f"{name} of frames"] = theirs(name, motion, truth, pose, means=False)
        readers[f"{name} of the means of poses"] = theirs(name, motion, truth, pose, means=True)
    text = (
        "# Forces of weights on a published FingerVision dome\n\n`python -m tests.bench forces`: mean "
        "absolute errors, and the shares of errors within one sigma."
    )
    for others, group in (("loads", load), ("poses", pose)):
        rows = [judged(name, read, truth, seen.in_contact, group) for name, read in readers.items()]
        text += f"\n\nBy models of other {others}:\n\n{markdown(rows)}"
    click.echo(text)
    (out / "forces.md").write_text(f"{text}\n", encoding="utf-8")
