"""Another tip's calibration as a prior: a dozen frames are enough, sigma is honest, the file stands alone."""

from dataclasses import replace
from functools import cache, partial
from itertools import pairwise
from pathlib import Path

import msgspec
import numpy as np
import pytest

from calib.carry_over import known_models
from calib.evaluate import predict
from calib.extract import Extract
from calib.fit import ModelKind, Search, fit
from calib.sim import Camera, Simulator
from edge.calibration import Calibration
from edge.calibration.file import Curve, Lost, Process
from edge.calibration.inputs import FRAME_INPUTS
from edge.types import Array
from tests.support.captures import write_table
from tests.support.commands import run_calib
from tests.support.synthetic import REST, make, targets

pytestmark = pytest.mark.usefixtures("quick_fits")
PROCESS = frozenset({ModelKind.PROCESS})
CARRIED = frozenset({ModelKind.CARRIED})
LENS = {"c00": 1.15, "c10": 0.9, "c01": 1.1}  # how the second tip sees modes


@cache
def _first(*, mirrored: bool = False) -> Calibration:
    extract, values = make(120, noise=0.02)
    if mirrored:
        values["shear_y_mm"], values["torsion_deg"] = -values["shear_y_mm"], -values["torsion_deg"]
    return fit(REST, targets(values), extract, mm_per_px=None, search=Search(kinds=PROCESS))[0]


def _second(
    n: int, seed: int, turn_deg: float = 0.0, *, mirrored: bool = False
) -> tuple[Extract, dict[str, Array]]:
    """Frames of another tip: its lens scales modes, its values have other gains, its rig has other axes."""
    extract, values = make(n, seed, noise=0.02)
    inputs = extract.inputs.copy()
    for name, factor in LENS.items():
        inputs[:, FRAME_INPUTS.index(name)] /= factor
    shear = 1.2 * (values["shear_x_mm"] + 1j * values["shear_y_mm"]) * np.exp(1j * np.radians(turn_deg))
    values["shear_x_mm"], values["shear_y_mm"] = shear.real, -shear.imag if mirrored else shear.imag
    values["displacement_mm"] = values["displacement_mm"] + 0.4
    if mirrored:
        values["torsion_deg"] = -values["torsion_deg"]
    return replace(extract, inputs=inputs), values


def _carried(prior: Calibration, extract: Extract, values: dict[str, Array]) -> Calibration:
    search = Search(kinds=CARRIED, known=known_models(prior.content))
    return fit(REST, targets(values), extract, mm_per_px=None, search=search)[0]


def _model_of_depth(calibration: Calibration) -> Process:
    models = [m for m in calibration.content.models if isinstance(m, Process)]
    return next(m for m in models if m.outputs == ["displacement_mm"])


@pytest.mark.parametrize(
    ("turn_deg", "mirrored", "first"), [(0.0, False, False), (90.0, True, False), (-70.0, False, True)]
)
def test_12_frames_of_another_tip_are_enough(turn_deg: float, mirrored: bool, first: bool) -> None:
    prior = _first(mirrored=first)
    calibration = _carried(prior, *_second(12, 1, turn_deg, mirrored=mirrored))
    fresh, true = _second(300, 2, turn_deg, mirrored=mirrored)
    read, sigmas = predict(calibration, fresh)
    unchanged, _ = predict(prior, fresh)
    for name, most in (("displacement_mm", 0.15), ("shear_x_mm", 0.15), ("shear_y_mm", 0.15)):
        error = np.abs(read[name] - true[name])
        assert error.mean() < most
        assert error.mean() < 0.5 * np.abs(unchanged[name] - true[name]).mean()
        assert 0.5 < np.mean(error < sigmas[name]) < 0.95


def test_more_frames_leave_less_of_the_other_tip() -> None:
    fresh, true = _second(300, 2)
    errors = []
    for n in (8, 24, 72):
        read, _ = predict(_carried(_first(), *_second(n, 1)), fresh)
        errors.append(np.mean([np.abs(read[k] - true[k]).mean() / true[k].std() for k in true]))
    assert all(later < sooner for sooner, later in pairwise(errors))


def test_a_prior_that_tells_nothing_is_not_chosen() -> None:
    """Another law altogether: the frames' own model is better on held-out frames."""
    extract, values = _second(60, 1)
    wrong = extract.inputs[:, FRAME_INPUTS.index("c20")] * 60.0
    values["shear_x_mm"], values["shear_y_mm"] = wrong.real, wrong.imag
    search = Search(known=known_models(_first().content))
    _, choices = fit(REST, targets(values), extract, mm_per_px=None, search=search)
    shear = next(choice for choice in choices if choice.outputs[0] == "shear_x_mm")
    assert ModelKind.CARRIED in {candidate.name for candidate in shear.tried}
    assert shear.chosen.name != ModelKind.CARRIED


def test_the_file_is_one_like_any_other() -> None:
    calibration = _carried(_first(), *_second(12, 1))
    again = Calibration.parse(calibration.encoded, "again")
    assert again.content == calibration.content
    assert all(isinstance(model, Process) for model in again.content.models)


def test_a_touch_lighter_than_any_of_few_frames_is_less_certain_by_how_much_lighter_it_is() -> None:
    """As far as the other tip's frames reached: nothing shows how the tips differ there."""
    extract, values = _second(80, 1)
    depth = values["displacement_mm"]
    pressed = np.flatnonzero(depth > np.median(depth))[:12]
    part = {name: column[pressed] for name, column in values.items()}
    calibration = _carried(_first(), extract.rows(pressed), part)
    (known_low, _), (low, _) = (_model_of_depth(one).valid[0] for one in (_first(), calibration))
    own_low, own_high = _model_of_depth(calibration).own[0]
    assert low == known_low < own_low == pytest.approx(depth[pressed].min(), abs=0.001)
    assert own_high == pytest.approx(depth[pressed].max(), abs=0.001)
    place = calibration.frame_models.names.index("displacement_mm")
    for one, true in zip(extract.inputs, depth, strict=True):
        value, sigma, flagged = calibration.frame_models.of_inputs(one)[place]
        assert sigma >= max(own_low - value, value - own_high)
        assert flagged or abs(value - true) < 5.0 * sigma


def test_noise_and_effect_of_lost_pins_are_carried_over_to_few_frames() -> None:
    """Noise only as far as the other tip's frames reached, beyond which its polynomial may be anything."""
    content = _first().content
    lost = Lost(scale=1.0, gap_power=2.0, volume_power=-1.0, gap_max=3.0)
    terms, to = [[], ["c00", "c00*"]], [0.0, 5e4]
    noise = partial(msgspec.structs.replace, noise_terms=terms, noise_weights=to, noise_range=(0.0, 1.0))
    models = [noise(m, lost=lost, across_weights=[]) for m in content.models if isinstance(m, Process)]
    prior = Calibration.of(msgspec.structs.replace(content, models=models), "prior")
    calibration = _carried(prior, *_second(12, 1))
    for before, after in zip(models, calibration.content.models, strict=True):
        assert isinstance(after, Process)
        assert after.lost is not None
        assert after.lost.gap_max == lost.gap_max
        assert max(after.sigma) < 1.0
        ratio = np.mean(np.square(before.sigma)) / np.mean(np.square(after.sigma))
        assert after.lost.scale == pytest.approx(lost.scale + np.log(ratio), abs=0.01)


def test_a_prior_that_cannot_help_is_refused_in_one_line(tmp_path: Path) -> None:
    curve = Curve("displacement_mm", "volume", [(0.0, 0.0), (0.1, 3.0)], 0.1)
    content = msgspec.structs.replace(_first().content, models=[curve])
    Calibration.of(content, "curve").save(tmp_path / "curve.json")
    _first().save(tmp_path / "poses.json")
    table = write_table(tmp_path, [Simulator(Camera()).frame().image], {"force_z": np.ones(1)})
    given = ("--frames", tmp_path, "--rest", tmp_path / "0.png", "-o", tmp_path / "new.json", "--prior")
    for prior, why in (("curve.json", "no process and no polynomial"), ("poses.json", "no model of force_n")):
        assert why in run_calib("fit", table, *given, tmp_path / prior).refusal
    assert not (tmp_path / "new.json").exists()
