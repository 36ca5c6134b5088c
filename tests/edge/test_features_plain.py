"""The features against the same method in plain NumPy, on every bundled recording and the real videos."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from calib.sim import Camera, Contact, Tip, Tool, deform
from edge.features import FeatureExtractor
from edge.pipeline import ALL, Pipeline, tare
from edge.sources import open_source
from edge.tessellate import Tessellator
from edge.types import Features, Frame, Tracks
from tests.bench.plain import FeatureExtractor as PlainExtractor
from tests.edge.fields import CENTRE, make_rest

DATA = Path(__file__).parents[1] / "data"
FULL_SCALE = 1e-3  # share of the largest value in the recording by which a feature may differ


def both(frames: Iterator[Frame], rest_n: int) -> Iterator[tuple[Features, Features]]:
    """Features of each frame whose identities are held: ours, and the plain ones."""
    pipeline = Pipeline(tare([frame.image for frame in islice(frames, rest_n)], np.inf))
    rest_area_px2 = pipeline._extractor._rest_area_px2
    plain = PlainExtractor(pipeline.rest, rest_area_px2)
    ours = FeatureExtractor(pipeline.rest, rest_area_px2)
    for frame in frames:
        result = pipeline.process(frame)
        if result.cells is not None:
            yield (
                ours.extract(result.tracks, result.cells, ALL),
                plain.extract(result.tracks, result.cells, ALL),
            )


def numbers(features: Features) -> dict[str, np.ndarray]:
    """Every number of a frame, by name; contacts strongest first."""
    assert features.modes_px is not None
    table = {
        "area_change": features.area_change,
        "displacement_px": features.displacement_px,
        "shear_px": features.shear_px,
        "modes_px": features.modes_px.view(np.float64),
        "volume_px2": features.volume_px2,
        "torsion_rad": features.torsion_rad,
        "slip_px": features.slip_px,
        "slip_probability": features.slip_probability,
    }
    if features.surface is not None:
        table["surface"] = features.surface[np.isfinite(features.surface)]
    return {name: np.atleast_1d(np.asarray(value, dtype=np.float64)) for name, value in table.items()}


def step_px2(features: Features) -> float:
    """What a grid point stands for."""
    assert features.grid_img is not None
    x, y = features.grid_img
    return float((x[1] - x[0]) * (y[1] - y[0]))


def same_contacts(ours: Features, plain: Features, peak: float, place_px: float) -> bool:
    """Whether number, heights, places, areas and axes agree."""
    mine, theirs = ours.contacts or (), plain.contacts or ()
    if len(mine) != len(theirs):
        return False
    for a, b in zip(mine, theirs, strict=True):
        # The area counts grid points: one or two more or less at the edge is what rounding can do.
        near = abs(a.peak - b.peak) <= peak and abs(a.area_px2 - b.area_px2) <= 2.01 * step_px2(plain)
        turned = np.angle(np.exp(2j * (a.orientation_rad - b.orientation_rad))) / 2
        straight = min(a.elongation, b.elongation) < 2.0 or abs(turned) <= FULL_SCALE * 2 * np.pi
        if not (near and straight and np.abs(a.xy_img - b.xy_img).max() <= place_px):
            return False
    return True


def compare(pairs: list[tuple[Features, Features]]) -> None:
    """Raises AssertionError: a feature is off by more than its share of full scale."""
    scale: dict[str, float] = {}
    for _, plain in pairs:
        for name, value in numbers(plain).items():
            if np.isfinite(value).any():
                scale[name] = max(scale.get(name, 0.0), float(np.nanmax(np.abs(value))))
    peak = max((c.peak for _, plain in pairs for c in plain.contacts or ()), default=0.0)
    wide_px = float(np.nanmax([np.ptp(p.grid_img[0]) for _, p in pairs if p.grid_img is not None] or [1.0]))
    other_number = 0
    for ours, plain in pairs:
        assert ours.touched == plain.touched
        mine, theirs = numbers(ours), numbers(plain)
        assert mine.keys() == theirs.keys()
        for name, value in theirs.items():
            np.testing.assert_allclose(
                mine[name], value, rtol=0.0, atol=FULL_SCALE * scale.get(name, 0.0) + 1e-12, err_msg=name
            )
        # A valley, a maximum or a pin within rounding of its border decides one way or the other.
        other_number += not same_contacts(ours, plain, FULL_SCALE * peak, FULL_SCALE * wide_px)
    assert other_number <= len(pairs) // 50, f"{other_number} of {len(pairs)}"


@pytest.mark.parametrize("name", ["nothing", "press", "press_shear", "two_contacts"])
def test_bundled_recordings(name: str) -> None:
    pairs = list(both(iter(open_source(str(DATA / f"{name}.mcap"))), 8))
    assert len(pairs) > 5
    assert any(ours.touched for ours, _ in pairs) == (name != "nothing")
    compare(pairs)


def test_close_pairs_are_parted_alike() -> None:
    """The second look, which none of the recordings needs."""
    camera = Camera(tip=Tip())
    rest_xy = camera.project(camera.tip.tips_mm)
    rest = make_rest(rest_xy + (CENTRE - camera.centre_img), 18.9)
    tessellator = Tessellator(rest)
    ours = FeatureExtractor(rest, tessellator.rest_area_px2)
    plain = PlainExtractor(rest, tessellator.rest_area_px2)
    rng, pairs = np.random.default_rng(3), []
    for distance in (3.0, 3.5, 4.0, 4.5):
        for angle in (0.0, 40.0, 100.0):
            tool = Tool("two", 1.0, angle, distance)
            moved = camera.project(deform(camera.tip, (Contact(tool, x_mm=1.0, depth_mm=2.0),)).tips_mm)
            xy = rest.xy_img + moved - rest_xy + rng.normal(0.0, 0.05, rest_xy.shape)
            tracks = Tracks(xy, np.full(331, 0.05), np.ones(331, dtype=np.bool_), 1.0)
            cells = tessellator.cells(tracks)
            pairs.append((ours.extract(tracks, cells, ALL), plain.extract(tracks, cells, ALL)))
    assert {len(mine.contacts or ()) for mine, _ in pairs} == {1, 2}
    assert all(same_contacts(mine, theirs, 1e-2, 1.0) for mine, theirs in pairs)


@pytest.mark.real
@pytest.mark.parametrize("name", ["north", "west", "Movement4"])
def test_real_videos(real_dir: Path, name: str) -> None:
    (video,) = (real_dir / "video").glob(f"{name}.*")
    pairs = list(both(islice(iter(open_source(str(video))), 300), 4))
    assert len(pairs) > 30
    assert any(ours.touched for ours, _ in pairs)
    compare(pairs)
