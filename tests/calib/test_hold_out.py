"""Held-out frames: drawn by pose, the same for a seed, and not used by the fit that they evaluate."""

import numpy as np
import pytest

from calib.errors import FitError
from calib.evaluate import evaluate
from calib.fit import fit
from calib.hold_out import evaluate_held_out, held_out_rows
from calib.ridge import folds_of
from tests.support.synthetic import REST, make, targets


def test_frames_of_one_pose_stay_together() -> None:
    poses = np.repeat(np.arange(50.0), 4)
    table = targets({"displacement_mm": poses})
    held = held_out_rows(table, 0.2, seed=0)
    assert held.sum() == 40
    assert all(len(set(held[poses == pose].tolist())) == 1 for pose in range(50))
    assert (held_out_rows(table, 0.2, seed=0) == held).all()
    assert (held_out_rows(table, 0.2, seed=1) != held).any()


def test_the_same_poses_are_held_out_in_other_axes() -> None:
    values = np.random.default_rng(0).normal(size=(2, 30)).repeat(2, axis=1)
    straight = targets({"shear_x_mm": values[0], "shear_y_mm": values[1]})
    turned = targets({"shear_x_mm": -values[1], "shear_y_mm": values[0]})
    assert (held_out_rows(straight, 0.3, seed=1) == held_out_rows(turned, 0.3, seed=1)).all()
    np.testing.assert_array_equal(folds_of(straight.poses), folds_of(turned.poses))
    assert len(set(folds_of(straight.poses))) == 30  # each of few poses that repeat is held out by itself


@pytest.mark.usefixtures("quick_fits")
def test_the_errors_are_those_of_frames_that_were_not_fitted() -> None:
    extract, values = make(120, noise=0.01)
    table = targets(values)
    held = held_out_rows(table, 0.2, seed=3)
    report = evaluate_held_out(REST, table, extract, 0.2, seed=3)
    kept, held_out = np.flatnonzero(~held), np.flatnonzero(held)
    calibration, _ = fit(REST, table.rows(kept), extract.rows(kept), mm_per_px=None)
    assert calibration.content.data.n_frames == 96
    assert report == evaluate(calibration, table.rows(held_out), extract.rows(held_out))
    assert report["displacement_mae_mm"] < 0.1


def test_too_few_poses_to_hold_out_are_refused() -> None:
    extract, _ = make(20)
    table = targets({"displacement_mm": np.repeat([1.0, 2.0], 10)})
    with pytest.raises(FitError, match=r"table\.csv: 2 different poses; 0\.2 of them cannot be held out"):
        evaluate_held_out(REST, table, extract, 0.2, seed=0)
