"""Speed against error, one design choice at a time: the same frames, every alternative.

Rules
- The truth is the simulator's, or the published poses; the error is the one that the choice can spoil.
- Time is the median of a few runs on one thread, of the step alone; on a busy machine read the ratios.
- The choice in use is marked, with the reason: not always the most exact, never a slower one that
  gains nothing.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import cv2
import numpy as np
from scipy.interpolate import griddata
from scipy.spatial import ConvexHull, Voronoi, cKDTree

from calib.curve import paper_curve
from calib.designs import letters, terms_of_spin
from calib.extract import Extract
from calib.ridge import cross_validated_terms
from calib.targets import Targets
from calib.terms import evaluate_terms, term_columns
from edge.calibration.inputs import FRAME_INPUTS
from edge.cells import Tessellator
from edge.features.pin_motion import AreaChange
from edge.features.surface import Surface
from edge.pins import CentroidRefiner, detect
from edge.types import Array, Cells, Frame, Rest, Result

RUNS = 5
CT_GRID = 64
HALVES_PX = (5, 7, 9, 12)
DEGREES = (1, 2, 3, 4, 5)


@dataclass(frozen=True, slots=True)
class Row:
    """One alternative. `why` only for the choice in use."""

    stage: str
    choice: str
    time_us: float
    error: float
    unit: str
    why: str = ""

    @property
    def chosen(self) -> bool:
        return bool(self.why)


def timed(work: Callable[[], Any], runs: int = RUNS) -> tuple[Any, float]:
    """Result, and median time in us."""
    work()
    times = []
    for _ in range(runs):
        began = time.perf_counter()
        result = work()
        times.append((time.perf_counter() - began) * 1e6)
    return result, float(np.median(times))


def detectors(rest: Rest, frames: Sequence[Frame]) -> list[Row]:
    """Where the pins are: whole image against windows, and how wide a window; rms error in px."""
    refiner, blob = CentroidRefiner(rest), _blob_detector(rest.pattern.pin_radius_px)
    rng = np.random.default_rng(0)
    found: dict[str, list[tuple[float, Array]]] = {}
    for frame in frames:
        assert frame.truth is not None
        true = np.array(frame.truth["pins_img"])
        # The last frame predicts a place that is off by about a pixel.
        predicted = true[: len(rest)] + rng.normal(0.0, 0.7, rest.xy_img.shape)
        ways: dict[str, Callable[[], Array]] = {
            "SimpleBlobDetector, whole image": lambda: np.array(
                [k.pt for k in blob.detect(frame.image)]  # noqa: B023  (run at once)
            ),
            "our search, whole image": lambda: detect(frame.image, rest.pattern).xy_img,  # noqa: B023
            "fitted discs in windows": lambda: refiner.refine(frame.image, predicted).xy_img,  # noqa: B023
        }
        for half in HALVES_PX:
            ways[f"intensity centroid, {2 * half + 1} px window"] = partial(
                _centroids, frame.image, predicted, half, rest.pattern.background
            )
        for name, way in ways.items():
            xy, us = timed(way, 3)
            gap, _ = cKDTree(true).query(xy[np.isfinite(xy[:, 0])])
            found.setdefault(name, []).append((us, gap))
    why = (
        "an order of magnitude faster than any search of the whole image, and nearer to the truth than a "
        "plain centroid, whose window takes in neighbours; the search remains for start-up and recovery"
    )
    return [
        Row(
            "pins",
            name,
            float(np.median([us for us, _ in runs])),
            float(np.sqrt(np.mean(np.concatenate([gap for _, gap in runs]) ** 2))),
            "px rms",
            why if name.startswith("fitted") else "",
        )
        for name, runs in found.items()
    ]


def _blob_detector(radius_px: float) -> Any:
    opencv: Any = cv2  # its stubs lack the detector
    p = opencv.SimpleBlobDetector_Params()
    p.filterByColor, p.blobColor = True, 255
    p.filterByArea, p.minArea, p.maxArea = True, 0.2 * np.pi * radius_px**2, 4.0 * np.pi * radius_px**2
    p.minThreshold, p.maxThreshold, p.thresholdStep = 40.0, 220.0, 20.0
    p.minRepeatability, p.minDistBetweenBlobs = 2, radius_px
    return opencv.SimpleBlobDetector_create(p)


def _centroids(image: Any, at: Array, half: int, background: float) -> Array:
    """Intensity-weighted centroid of a square window round each place, twice iterated."""
    span = np.arange(-half, half + 1)
    for _ in range(2):
        middle = np.rint(at).astype(int)
        rows = np.clip(middle[:, 1, None, None] + span[:, None], 0, image.shape[0] - 1)
        cols = np.clip(middle[:, 0, None, None] + span[None, :], 0, image.shape[1] - 1)
        weight = np.maximum(image[rows, cols] - background - 10.0, 0.0)
        total = np.maximum(weight.sum(axis=(1, 2)), 1e-9)
        at = np.column_stack([(weight * cols).sum(axis=(1, 2)), (weight * rows).sum(axis=(1, 2))])
        at /= total[:, None]
    return at


def tessellations(rest: Rest, results: Sequence[Result]) -> list[Row]:
    """Cell areas: qhull anew in every frame against the mesh that is kept; rms difference in % of a cell."""
    tessellator = Tessellator(rest)
    exact_us, kept_us, off = [], [], []
    for result in results:
        kept, us = timed(lambda: tessellator.cells(result.tracks))  # noqa: B023
        points = np.vstack([kept.xy_img, kept.boundary_img])
        exact, slow = timed(lambda: _voronoi_areas(points, len(rest)))  # noqa: B023
        exact_us.append(slow)
        kept_us.append(us)
        off.append((kept.area_px2 - exact) / kept.rest_area_px2)
    difference = float(np.sqrt(np.nanmean(np.square(np.concatenate(off))))) * 100.0
    why = "the same areas to rounding; the triangulation of the last frame is checked and flipped, not made"
    return [
        Row("cells", "qhull in every frame", float(np.median(exact_us)), 0.0, "% of a cell"),
        Row("cells", "mesh kept and flipped", float(np.median(kept_us)), difference, "% of a cell", why),
    ]


def _voronoi_areas(points: Array, n: int) -> Array:
    diagram = Voronoi(points)
    area = np.full(n, np.nan)
    for i in range(n):
        region = diagram.regions[diagram.point_region[i]]
        if region and -1 not in region:
            area[i] = ConvexHull(diagram.vertices[region]).volume
    return area


def surfaces(rest: Rest, results: Sequence[Result], depths: Array) -> list[Row]:
    """Volume of deformation as a measure of depth: held-out MAE of the paper's curve, in mm."""
    rows: list[Row] = []
    r = rest.pattern.tip_radius_px
    change = [_of(result).area_change for result in results]

    def add(name: str, volumes: list[float], us: list[float], why: str = "") -> None:
        _, predicted = paper_curve(np.array(volumes) / (np.pi * r * r), depths)
        error = np.abs(predicted - depths).mean()
        rows.append(Row("surface", name, float(np.median(us)), float(error), "mm depth", why))

    volumes, us = [], []
    line = np.linspace(-r, r, CT_GRID)
    mesh = np.meshgrid(line + rest.pattern.centre_img[0], line + rest.pattern.centre_img[1])
    cell = float(line[1] - line[0]) ** 2
    for result, area_change in zip(results, change, strict=True):
        xy = result.tracks.xy_img
        use = np.isfinite(xy[:, 0]) & np.isfinite(area_change)
        height, took = timed(
            lambda: griddata(xy[use], area_change[use], (mesh[0], mesh[1]), method="cubic"),  # noqa: B023
            1,
        )
        volumes.append(float(np.nansum(np.maximum(height, 0.0))) * cell)
        us.append(took)
    add(f"Clough-Tocher at current places, {CT_GRID} grid", volumes, us)
    volumes, us = [], []
    changes = AreaChange(rest.xy_img, rest.pattern.pitch_px, _cells(results[0]).rest_area_px2)
    for result, area_change in zip(results, change, strict=True):
        changes.fill(area_change, np.ascontiguousarray(_cells(result).xy_img))
        volume, took = timed(partial(changes.volume, 0.01), 3)
        volumes.append(volume)
        us.append(took)
    why = "the cells at rest tile the tip: their sum is the integral, and depth gains nothing from a grid"
    add("sum over the cells", volumes, us, why)
    return rows


def _cells(result: Result) -> Cells:
    assert result.cells is not None
    return result.cells


def _of(result: Result) -> Any:
    assert result.features is not None
    return result.features


def places(rest: Rest, results: Sequence[Result], targets: Targets, calibrated: Array) -> list[Row]:
    """Where one probe touches: mean error in mm.

    calibrated  (n, 2) mm, the calibration's values
    """
    true = targets.values["contact_x_mm"] + 1j * targets.values["contact_y_mm"]
    surface = Surface(rest)
    divergence_us, on_grid, by_pins = [], [], []
    for result in results:
        xy = np.where(np.isfinite(result.tracks.xy_img), result.tracks.xy_img, rest.xy_img)
        change = np.nan_to_num(_of(result).area_change)
        surface.field.set_area_change(change)
        _, us = timed(lambda: surface.field.find(xy), 3)  # noqa: B023
        on_grid.append(surface.points_img[int(np.argmax(surface.field.blend))])
        contacts = _of(result).contacts
        by_pins.append(contacts[0].weighted_img if contacts else np.full(2, np.nan))
        divergence_us.append(us)
    rows = []
    for name, at in (("highest grid point", on_grid), ("pins weighted by area change", by_pins)):
        z = (np.array(at) - rest.pattern.centre_img) @ np.array([1.0, 1j])
        ok = np.isfinite(z) & np.isfinite(true)
        scale = abs(np.vdot(z[ok], true[ok])) / np.vdot(z[ok], z[ok]).real
        rows.append(
            Row(
                "place",
                name,
                float(np.median(divergence_us)),
                float(np.abs(scale * z - true)[ok].mean()),
                "mm",
            )
        )
    z = calibrated @ np.array([1.0, 1j])
    ok = np.isfinite(z) & np.isfinite(true)
    why = "takes the dome's and the lens's bend out; one small polynomial a contact"
    psi = term_columns(terms_of_spin(1, (("p", 1), ("p*", -1)), 3), ("p",))
    _, us = timed(lambda: evaluate_terms(np.array([[0.1 + 0.2j]]), psi), 50)
    rows.append(
        Row(
            "place",
            "that, calibrated",
            float(np.median(divergence_us)) + us,
            float(np.abs(z - true)[ok].mean()),
            "mm",
            why,
        )
    )
    return rows


def shear_models(rest: Rest, targets: Targets, seen: Extract) -> list[Row]:
    """Shear from the mean motion, the paper's, against modes of degree 1..5; held-out direction error."""
    true = targets.values["shear_x_mm"] + 1j * targets.values["shear_y_mm"]
    use = seen.trusted & np.isfinite(seen.inputs).all(axis=1)
    inputs, true = seen.inputs[use], true[use]
    poses = np.column_stack([values[use] for values in targets.values.values()])
    large = np.abs(true) > 1.5
    designs: list[tuple[str, list[list[str]], int]] = [("plain mean of all pins", [["shear"]], 1)]
    for degree in DEGREES:
        for factors in (1, 2):
            name = f"modes to degree {degree}, {'linear' if factors == 1 else 'and their products'}"
            count = (degree + 1) * (degree + 2) // 2
            designs.append((name, terms_of_spin(1, letters(degree), factors), count))
    designs.append(("modes to degree 2, products of three", terms_of_spin(1, letters(2), 3), 6))
    motion = np.zeros(len(rest), dtype=np.complex128)
    rows = []
    for name, terms, modes in designs:
        if len(terms) * 1.5 > len(true):
            continue
        columns = term_columns([*terms, []], FRAME_INPUTS)
        predicted = cross_validated_terms(evaluate_terms(inputs, columns), true, poses)
        off = np.degrees(np.abs(np.angle(predicted[large] * true[large].conj())))
        project = np.zeros((modes, len(rest)), dtype=np.complex128)
        _, us = timed(lambda: (project @ motion, evaluate_terms(inputs[:1], columns)), 50)  # noqa: B023
        why = ""
        if name.endswith("products of three"):
            why = "what cross-validation chooses: fewest terms within a standard error of the best"
        rows.append(Row("shear", f"{name} ({len(terms) + 1} terms)", us, float(off.mean()), "deg mean", why))
    return rows
