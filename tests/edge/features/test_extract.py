"""The extractor: contact detector, demand, lost pins, and the whole of it against the paper's method."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from edge.cells import Tessellator
from edge.features import FeatureExtractor, FeaturePlan
from edge.pins import detect, take_rest
from edge.sources.files import read_image
from edge.tracking import Tracker
from edge.types import Array, Cells, Feature, Features, Rest, Tracks
from tests.bench.recordings import poses_of_stills
from tests.bench.reference import Reference
from tests.support.fields import CENTRE, areas, clamp, frame, push, tip
from tests.support.layouts import tracks_of

pytestmark = [pytest.mark.kernels, pytest.mark.compiled]

ALL = FeaturePlan(frozenset(Feature))
OPTIONAL = (
    "shear_px", "modes_px", "volume_px2", "surface", "contacts", "torsion_rad", "slip_px", "vibration_px",
)  # fmt: skip


def extractor(rest: Rest) -> Any:  # a test knows which features are there
    return FeatureExtractor(rest, areas(rest.xy_img, rest))


def noisy(rest: Rest, motion: Array, rng: np.random.Generator, lost: Any = None) -> tuple[Tracks, Cells]:
    return frame(rest, rest.xy_img + motion + rng.normal(0.0, 0.05, rest.xy_img.shape), lost)


def given_fields(features: Features) -> set[str]:
    return {name for name in OPTIONAL if getattr(features, name) is not None}


@pytest.mark.parametrize(
    ("demand", "fields"),
    [
        ("", ""), ("shear", "shear_px modes_px"), ("contacts", "contacts"), ("surface", "surface"),
        ("displacement", "modes_px volume_px2"), ("torsion", "torsion_rad modes_px"), ("slip", "slip_px"),
        ("vibration", "vibration_px"), (" ".join(Feature), " ".join(OPTIONAL)),
    ],
)  # fmt: skip
def test_only_the_demand_is_computed(demand: str, fields: str) -> None:
    rest = tip(127)
    shown, plan = rest.xy_img + push(rest, (0.0, 0.0), 60.0, 0.1), frozenset(map(Feature, demand.split()))
    got = extractor(rest).extract(*frame(rest, shown), FeaturePlan(plan))
    assert got.in_contact
    assert given_fields(got) == set(fields.split())


def test_without_cells_motion_alone_is_given() -> None:
    rest = tip(127)
    tracks, _ = frame(rest, rest.xy_img + push(rest, (0.0, 0.0), 60.0, 0.1))
    got = extractor(rest).extract(tracks, None, ALL)
    assert got.in_contact
    assert np.isnan(got.area_change).all()
    assert given_fields(got) == {"shear_px", "modes_px", "torsion_rad", "slip_px", "vibration_px"}
    shaken = Tracks.of(rest.xy_img + np.array([3.0, -2.0]), tracks.sigma_px, tracks.seen)
    assert not extractor(rest).extract(shaken, None, ALL).in_contact


@pytest.mark.parametrize("pins", [127, 331])
@pytest.mark.parametrize("with_cells", [True, False])
def test_a_reflection_that_shifts_pins_is_no_contact(pins: int, with_cells: bool) -> None:
    """One pin, or two neighbours towards the light between them; a touch beside it is still detected."""
    rest, rng = tip(pins), np.random.default_rng(6)
    made, light = extractor(rest), extractor(rest)
    inner = np.flatnonzero(np.hypot(*(rest.xy_img - CENTRE).T) < 0.7 * rest.pattern.tip_radius_px)
    for k, pin in enumerate(rng.choice(inner, 12, replace=False)):
        other = int(np.argsort(np.hypot(*(rest.xy_img - rest.xy_img[pin]).T))[1])
        towards = (rest.xy_img[other] - rest.xy_img[pin]) / rest.pattern.pitch_px
        motion = np.zeros_like(rest.xy_img)
        motion[pin] = 2.0 * towards
        if k % 2:
            motion[other] = -2.0 * towards
        tracks, cells = noisy(rest, motion, rng)
        assert not made.extract(tracks, cells if with_cells else None, ALL).in_contact
        at = CENTRE + rng.uniform(-20.0, 20.0, 2)
        tracks, cells = noisy(rest, motion + push(rest, tuple(at - CENTRE), 40.0, 0.05), rng)
        assert light.extract(tracks, cells if with_cells else None, ALL).in_contact


def test_a_third_of_the_pins_lost_changes_little() -> None:
    rest = tip(331)
    made, rng = extractor(rest), np.random.default_rng(4)
    # The skin is held at the rim, as the boundary of these cells is.
    motion = (push(rest, (24.0, -17.0), 45.0, 0.15) + np.array([1.5, -0.5])) * clamp(rest)[:, None]
    full = made.extract(*noisy(rest, motion, rng), ALL)
    half = made.extract(*noisy(rest, motion, rng, rng.choice(331, 110, replace=False)), ALL)
    assert len(full.contacts) == len(half.contacts) == 1
    assert np.hypot(*(full.contacts[0].xy_img - half.contacts[0].xy_img)) < 4.0
    assert half.volume_px2 == pytest.approx(full.volume_px2, rel=0.1)
    np.testing.assert_allclose(half.shear_px, full.shear_px, atol=0.25)


def test_a_probe_under_lost_pins_is_detected() -> None:
    """Only the cells of lost pins are larger; the seen ones round them have only moved."""
    rest = tip(127)
    xy = rest.xy_img + push(rest, (0.0, 0.0), 0.7 * rest.pattern.pitch_px, 0.2)
    xy[np.argsort(np.hypot(*(rest.xy_img - CENTRE).T))[:4]] = np.nan
    tracks = tracks_of(xy)
    tessellator = Tessellator(rest)
    made: Any = FeatureExtractor(rest, tessellator.rest_area_px2)
    got = made.extract(tracks, tessellator.cells(tracks), ALL)
    assert got.in_contact
    assert len(got.contacts) == 1
    assert np.hypot(*(got.contacts[0].xy_img - CENTRE)) < 0.25 * rest.pattern.pitch_px


def test_without_seen_pins_there_is_no_second_contact() -> None:
    rest = tip(331)
    pitch = rest.pattern.pitch_px
    places = ((-4.0 * pitch, 0.0), (4.0 * pitch, 0.0))
    xy = rest.xy_img + push(rest, places[0], 1.5 * pitch, 0.2) + push(rest, places[1], 1.5 * pitch, 0.15)
    from_second = np.hypot(*(rest.xy_img - CENTRE - np.array(places[1])).T)
    for lost, found in ((None, 2), (from_second < 2.6 * pitch, 1), (from_second < 1.1 * pitch, 2)):
        assert len(extractor(rest).extract(*frame(rest, xy, lost), ALL).contacts) == found
    # If it is the only one, it is kept.
    xy = rest.xy_img + push(rest, places[1], 1.5 * pitch, 0.15)
    tracks, cells = frame(rest, xy, from_second < 2.6 * pitch)
    contacts = extractor(rest).extract(tracks, replace(cells, whole_px2=areas(xy, rest)), ALL).contacts
    assert len(contacts) == 1


def test_all_pins_lost_is_survived() -> None:
    rest = tip(127)
    made, gone = extractor(rest), np.full_like(rest.xy_img, np.nan)
    _, cells = frame(rest, rest.xy_img)
    dark = Cells(gone[:, 0].copy(), cells.rest_area_px2, rest.xy_img, cells.triangles, cells.boundary_img)
    for given in (dark, None):
        got = made.extract(tracks_of(gone), given, ALL)
        assert not got.in_contact
        assert np.isnan(got.shear_px).all()


@pytest.mark.parametrize("pins", [127, 331])
def test_agrees_with_the_papers_method(pins: int) -> None:
    """Volume within 5 %, place within a third of a pitch, shear exact: one push, no noise."""
    rest = tip(pins)
    pitch = rest.pattern.pitch_px
    paper = Reference(np.zeros((480, 640), np.uint8), rest.pattern.pin_radius_px, rest_img=rest.xy_img)
    for at in ((0.0, 0.0), (35.0, 20.0), (-20.0, 50.0)):
        xy = rest.xy_img + push(rest, at, 2.5 * pitch, 0.15)
        oracle = paper.features(xy)
        got = extractor(rest).extract(*frame(rest, xy), ALL)
        # The paper integrates over the skin as it is now: larger by the area change itself.
        change = got.area_change
        stretched = float((np.maximum(change, 0.0) * (1.0 + change)).sum() / np.maximum(change, 0.0).sum())
        assert got.volume_px2 * stretched == pytest.approx(oracle.volume_px2, rel=0.06)
        assert len(got.contacts) == 1
        assert np.hypot(*(got.contacts[0].xy_img - oracle.contacts_img[0])) < pitch / 3.0
        assert np.hypot(*(got.contacts[0].xy_img - CENTRE - at)) < 0.1 * pitch
        np.testing.assert_allclose(got.shear_px, oracle.shear_px, atol=1e-9)


def test_nothing_of_one_frame_is_overwritten_by_later_ones() -> None:
    rest, kept = tip(127), list[tuple[np.ndarray, np.ndarray]]()
    made, rng = extractor(rest), np.random.default_rng(6)
    for x in (0.0, 40.0, -40.0, 20.0):
        got = made.extract(*noisy(rest, push(rest, (x, 0.0), 60.0, 0.1), rng), ALL)
        held = (got.area_change, got.displacement_px, got.surface, got.modes_px, got.contacts[0].middle_img)
        kept += [(array, array.copy()) for array in held]
    for array, before in kept:
        np.testing.assert_array_equal(array, before)


@pytest.mark.real
def test_real_flat_contacts_are_one_contact_each(real_dir: Path) -> None:
    """Every 24th of 600 published frames: one flat surface, tilted and sheared, each a jump from rest."""
    folder = real_dir / "tactip331_binary"
    rest = take_rest([read_image(folder / "rest.png")])
    tracker, tessellator = Tracker(rest), Tessellator(rest)
    made: Any = FeatureExtractor(rest, tessellator.rest_area_px2)
    for name in list(poses_of_stills(folder))[::24]:
        image = read_image(folder / "frames" / name)
        tracks = tracker.identify(detect(image, rest.pattern))
        got = made.extract(tracks, tessellator.cells(tracks), ALL)
        assert len(got.contacts) == 1, name
        # It lies where the area change is largest.
        pin = int(np.nanargmax(got.area_change))
        assert np.hypot(*(got.contacts[0].xy_img - tracks.xy_img[pin])) < 5.0 * rest.pattern.pitch_px, name
