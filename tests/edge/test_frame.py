"""The stages together: what is computed, what is refused, how a rest frame is taken."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np
import pytest

from calib.sim import Camera, Simulator, Tip, ToolPose
from edge.calibration import Calibration
from edge.calibration.checks import outputs_of
from edge.calibration.file import Polynomial
from edge.drift import Drift, DriftParams
from edge.frame import Pipeline
from edge.pins import take_rest
from edge.rest.tip_match import match_tip
from edge.sources import open_source
from edge.types import Array, Feature, Frame, Image, Rest
from tests.bench.hazards import measure

TARE = 8


@pytest.fixture(scope="module")
def frames(data_dir: Path) -> list[Frame]:
    """A press and shear on 127 pins."""
    return list(open_source(str(data_dir / "press_shear.mcap")))


@pytest.fixture(scope="module")
def rest(frames: list[Frame]) -> Rest:
    return take_rest([frame.image for frame in frames[:TARE]])


@pytest.fixture
def calibration(data_dir: Path) -> Calibration:
    return Calibration.load(data_dir / "hex127_flat.json")


def test_values_follow_the_truth_and_no_slip_outlasts_a_gap(
    frames: list[Frame], rest: Rest, calibration: Calibration
) -> None:
    pipeline = Pipeline(match_tip(calibration, rest)[0], calibration)
    last: Any = [pipeline.process(frame) for frame in frames][-1]
    values, truth = last.reading.values, last.frame.truth
    assert values["displacement_mm"] == pytest.approx(truth["depth_mm"], abs=0.15)
    assert [values["shear_x_mm"], values["shear_y_mm"]] == pytest.approx(truth["shear_mm"], abs=0.1)
    pipeline.forget()
    after_gap: Any = pipeline.process(frames[-1])
    assert (last.searched, after_gap.searched) == (False, True)
    assert np.isnan([one.features.slip_probability for one in (after_gap, last)]).tolist() == [True, False]


def test_no_pin_is_lost_in_the_first_image_of_a_fast_touch() -> None:
    tip = Simulator(Camera(tip=Tip(127, "hex", pin_radius_mm=0.8), size_px=(240, 240)))
    pipeline = Pipeline(take_rest([tip.frame(()).image]))
    for poses in ((), (ToolPose(depth_mm=2.39, shear_x_mm=-0.13, shear_y_mm=-0.58),)):
        tracks = pipeline.process(tip.frame(poses)).tracks
        assert (tracks.n_seen, tracks.confidence >= 0.99) == (127, True)


def test_moments_of_contacts_are_computed_for_models_that_depend_on_them(
    frames: list[Frame], rest: Rest, calibration: Calibration
) -> None:
    place = Polynomial(
        outputs=["contact_x_mm", "contact_y_mm"], terms=[["p"], ["curl_moment*", "curl_moment", "p"]],
        weights=[(19.0, 0.0), (1.0, 0.0)], valid=[(-20.0, 20.0), (-20.0, 20.0)], sigma=[0.1, 0.1],
    )  # fmt: skip
    others = [model for model in calibration.content.models if "contact_x_mm" not in outputs_of(model)]
    of_moments = Calibration(msgspec.structs.replace(calibration.content, models=[*others, place]))
    for given, wanted in ((None, True), (calibration, False), (of_moments, True)):
        pipeline = Pipeline(rest if given is None else match_tip(given, rest)[0], given)
        last: Any = [pipeline.process(frame) for frame in frames][-1]
        assert [np.isfinite(c.curl_moment_px).all() for c in last.features.contacts] == [wanted]
    assert np.isfinite(last.reading.contacts[0, :2]).all()


@pytest.mark.parametrize("dark", [0, 3])
def test_motion_alone_gives_the_same_values_without_cells(
    frames: list[Frame], rest: Rest, calibration: Calibration, dark: int
) -> None:
    few, tip = frozenset({Feature.DISPLACEMENT, Feature.SHEAR}), match_tip(calibration, rest)[0]
    every, alone = Pipeline(tip, calibration), Pipeline(tip, calibration, few)
    unwatched = Pipeline(tip, calibration)
    unwatched.watch(False)
    n_cells = n_untouched = 0
    for frame in [*frames[:TARE] * 12, *frames]:
        image = frame.image.copy()
        for x, y in np.rint(tip.xy_img[:dark]).astype(int):
            image[y - 12 : y + 13, x - 12 : x + 13] = 0
        results: Any = [one.process(replace(frame, image=image)) for one in (every, alone, unwatched)]
        expected, result, other = results
        np.testing.assert_equal(other.reading.values, expected.reading.values)
        assert other.features.volume_px2 == expected.features.volume_px2
        n_untouched += other.cells is None
        assert other.cells is None or other.cells.triangles is None
        assert result.features.in_contact == expected.features.in_contact
        for name in ("displacement_mm", "shear_x_mm", "shear_y_mm"):
            assert result.reading.values[name] == expected.reading.values[name]
        n_cells += result.features.in_contact and result.cells is not None
    # The cells of its neighbours predict that of a lost pin.
    assert (n_cells < 0.2 * len(frames)) == (n_untouched > 2 * TARE) == (dark == 0)


def test_friction_and_slip_margin_come_with_the_forces(
    frames: list[Frame], rest: Rest, calibration: Calibration
) -> None:
    """A shear at constant depth: what is held grows."""
    gripping = _with_friction(calibration)
    pipeline = Pipeline(match_tip(gripping, rest)[0], gripping, frozenset({Feature.FORCE}))
    assert "slip_margin" not in pipeline.process(frames[0]).reading.values
    last = [pipeline.process(frame).reading.values for frame in frames[1:]][-1]
    load = np.hypot(last["force_x_n"], last["force_y_n"]) / last["force_n"]
    assert last["friction"] == pytest.approx(load, rel=0.3)
    assert last["slip_margin"] == pytest.approx(max(0.0, 1 - load / last["friction"]), abs=0.1)
    pipeline.forget()  # as after a gap, when another thing may be held
    assert pipeline.process(frames[-12]).reading.values["friction"] < 0.9 * last["friction"]
    without = Pipeline(match_tip(gripping, rest)[0], gripping, frozenset({Feature.SHEAR}))
    assert not [v for v in map(without.process, frames) if "slip_margin" in v.reading.values]


def _with_friction(calibration: Calibration) -> Calibration:
    """With forces along the surface of 0.2 N a mm of shear."""
    models = calibration.content.models
    shear = next(model for model in models if outputs_of(model)[0] == "shear_x_mm")
    assert isinstance(shear, Polynomial)
    along = msgspec.structs.replace(
        shear, outputs=["force_x_n", "force_y_n"], weights=[(0.2 * re, 0.2 * im) for re, im in shear.weights],
        sigma=[0.2 * sigma for sigma in shear.sigma],
    )  # fmt: skip
    return Calibration.of(msgspec.structs.replace(calibration.content, models=[*models, along]), "friction")


def test_learnt_drift_is_subtracted_from_the_values(frames: list[Frame], rest: Rest) -> None:
    """A tip that has settled reads as one that has not; its tracks stay where they are seen."""
    still, touched = (replace(frame, image=_moved(frame.image)) for frame in (frames[TARE - 1], frames[-1]))
    drift = Drift(rest, DriftParams(time_s=1.0))
    settled = Pipeline(rest).process(still).tracks
    for k in range(300):
        drift.learn(settled, k * 100_000_000, True)
    assert 0.1 < drift.offset_px < 0.25
    true_px = _displaced_px(Pipeline(rest).process(frames[-1], even_untrusted=True))
    raw = Pipeline(rest).process(touched, even_untrusted=True)
    result: Any = Pipeline(rest, drift=drift).process(touched, even_untrusted=True)
    assert np.abs(_displaced_px(raw) - true_px).min() > 0.08
    np.testing.assert_allclose(_displaced_px(result), true_px, atol=0.03)
    np.testing.assert_array_equal(result.tracks.xy_img, raw.tracks.xy_img)
    np.testing.assert_allclose(result.cells.xy_img, raw.tracks.xy_img - drift.offset_of())


def _displaced_px(result: Any) -> Array:
    """Mean motion of the pins since rest, x and y."""
    return np.asarray(np.nanmean(result.features.displacement_px, axis=0))


def _moved(image: Image) -> Image:
    """The image, moved by an eighth of a pixel to the right and up."""
    height, width = image.shape
    by = np.array([[1.0, 0.0, 0.125], [0.0, 1.0, -0.125]])
    return np.asarray(cv2.warpAffine(image, by, (width, height), flags=cv2.INTER_CUBIC), np.uint8)


@pytest.mark.parametrize("several", [True, False])
def test_fits_of_several_contacts_can_be_left_out(data_dir: Path, several: bool) -> None:
    seen = list(open_source(str(data_dir / "two_contacts.mcap")))
    pipeline = Pipeline(take_rest([frame.image for frame in seen[:8]]), several=several)
    found = [result.features.contacts for frame in seen if (result := pipeline.process(frame)).features]
    pairs = [contacts for contacts in found if contacts is not None and len(contacts) == 2]
    assert pairs
    assert any(contact.fitted is not None for contacts in pairs for contact in contacts) is several


@pytest.mark.real
def test_dark_dots_are_held_through_a_press_and_contact_shows_it(real_dir: Path) -> None:
    images = [frame.image for frame in open_source(str(real_dir / "gelsight_mini" / "press.avi"))]
    rest = take_rest(images[:TARE])
    assert rest.pattern.dark
    assert 70 <= len(rest) <= 74
    pipeline = Pipeline(rest)
    results = [pipeline.process(Frame(image, 40_000_000 * k, k)) for k, image in enumerate(images)]
    assert all(result.features is not None and result.tracks.n_seen >= 66 for result in results)
    touched = np.array([result.features is not None and result.features.in_contact for result in results])
    assert not touched[:50].any()
    assert touched[65:].all()


#: Rendered, short.
HOLDS = (
    "30 % blinking", "50 false blobs", "30 % dark, 50 false blobs", "a reflection runs across",
    "dark for a while", "a hand over the lens",
)  # fmt: skip


@pytest.mark.parametrize("hazard", HOLDS)
def test_no_pin_is_swapped_and_no_false_touch(hazard: str) -> None:
    outcome = measure(Camera(tip=Tip(n_pins=127), size_px=(320, 240)), None, hazard, seed=3)
    assert outcome.swapped == 0
    assert outcome.touches == 0
    assert outcome.unsure <= 14  # the dark frames, and the search after them
