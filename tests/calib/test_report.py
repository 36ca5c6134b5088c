"""The report: alternatives measured against truth, a complete page."""

from pathlib import Path

import numpy as np
import pytest

from calib.fit import fit
from calib.report import slip, study
from calib.report.page import ReportPage, model_table, write_page
from calib.report.pairs import pairs, resolvable_mm, shares
from calib.report.sections import Requirement
from calib.rig.simulated import Simulation
from calib.sim import Camera, Simulator, Tip, Tool, ToolPose
from edge.frame import Pipeline
from edge.geometry.parts import stack
from edge.pins import take_rest
from edge.types import Frame, Rest, Result
from tests.support.synthetic import REST, make, targets

pytestmark = pytest.mark.usefixtures("quick_fits")
DEPTHS = np.linspace(0.5, 4.0, 24)


@pytest.fixture(scope="module")
def pressed() -> tuple[Rest, list[Frame], list[Result]]:
    """A flat press of growing depth on a small tip."""
    simulator = Simulator(Camera(tip=Tip(127, "hex"), size_px=(240, 240)))
    rest = take_rest([simulator.frame().image for _ in range(3)])
    pipeline = Pipeline(rest)
    frames = [simulator.frame((ToolPose(Tool("flat"), depth_mm=float(d)),)) for d in DEPTHS]
    return rest, frames, [pipeline.process(frame, even_untrusted=True) for frame in frames]


def test_windows_are_close_to_the_truth_and_marked(pressed: tuple[Rest, list[Frame], list[Result]]) -> None:
    rest, frames, _ = pressed
    rows = {row.choice: row for row in study.detectors(rest, frames[:4])}
    ours = rows["fitted discs in windows"]
    assert ours.chosen
    assert ours.error < 0.1
    assert sum(row.chosen for row in rows.values()) == 1


def test_the_kept_mesh_has_the_areas_of_qhull(pressed: tuple[Rest, list[Frame], list[Result]]) -> None:
    rest, _, results = pressed
    exact, kept = study.tessellations(rest, results[::8])
    assert kept.chosen
    assert not exact.chosen
    assert kept.error < 1e-6


def test_every_surface_carries_the_depth(pressed: tuple[Rest, list[Frame], list[Result]]) -> None:
    rest, _, results = pressed
    rows = study.surfaces(rest, results, DEPTHS)
    assert all(row.error < 0.4 for row in rows)
    assert [row.chosen for row in rows].count(True) == 1
    assert rows[0].choice.startswith("Clough-Tocher")


def test_richer_shear_models_are_closer_where_the_law_has_products() -> None:
    extract, values = make(300, noise=0.05)
    rows = {r.choice.split(" (")[0]: r for r in study.shear_models(REST, targets(values), extract)}
    linear, products = rows["modes to degree 1, linear"], rows["modes to degree 1, and their products"]
    assert products.error < 0.5 * linear.error
    assert rows["plain mean of all pins"].error > products.error


def test_a_page_shows_terms_weights_and_no_markup_of_its_texts(tmp_path: Path) -> None:
    extract, values = make(100, noise=0.02)
    _, choices = fit(REST, targets(values), extract, mm_per_px=None)
    page = ReportPage("A & B")
    section = page.section("<models>")
    section.text("1 < 2")
    model_table(section, choices)
    write_page(page, tmp_path / "index.html")
    text = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert "A &amp; B" in text
    assert "&lt;models&gt;" in text
    assert "1 &lt; 2" in text
    for choice in choices:
        for term in getattr(choice.model, "terms", []):
            assert f"<code>{' · '.join(term) or '1'}</code>" in text


def test_checks_compare_with_their_side_of_the_limit() -> None:
    assert Requirement("error", 1.0, 0.5, "mm").holds
    assert not Requirement("error", 1.0, 1.5, "mm").holds
    assert not Requirement("error", 1.0, float("nan"), "mm").holds
    assert Requirement("share", 99.0, 100.0, "%", at_least=True).holds


def test_resolution_is_the_smallest_distance_from_which_all_pairs_are_two() -> None:
    gap = np.repeat([2.0, 3.0, 4.0, 5.0], 4)
    counts = np.array([1, 1, 1, 1, 2, 2, 2, 2, 2, 1, 2, 3, 2, 2, 2, 2], dtype=np.int32)
    rows = shares(gap, counts)
    assert rows == [
        (2.0, 100.0, 0.0, 0.0),
        (3.0, 0.0, 100.0, 0.0),
        (4.0, 25.0, 50.0, 25.0),
        (5.0, 0.0, 100.0, 0.0),
    ]
    assert resolvable_mm(rows) == 5.0  # 3 mm was luck: 4 mm is not
    assert resolvable_mm(rows[:3]) == np.inf
    steps = [step for step in pairs().steps if step.frames and step.role == "sample"]
    assert {step.tool.distance_mm for step in steps} >= {2.0, 4.0, 8.0}
    assert max(np.hypot(step.pose.x_mm, step.pose.y_mm) for step in steps) <= 5.0


def test_slip_is_evaluated_against_the_true_motion() -> None:
    seen = slip.Slipped(
        share=np.array([0.0, 0.0, 0.3, 0.4, 0.6, 1.0, 1.0]),
        true_mm_s=np.array([0.0, 0.0, 0.5, 1.0, 2.0, 6.0, 6.0]),
        read_mm_s=np.array([0.0, 0.0, 0.0, 0.5, 0.7, 0.0, 0.0]),
        probability=np.array([0.0, 0.9, 0.0, 0.9, 1.0, 0.2, 0.1]),
    )
    got = slip.outcome(stack([seen, seen]))
    assert got.false_percent == 50.0
    assert got.detected_percent == pytest.approx(200.0 / 3.0)
    assert got.glide_percent == 0.0
    assert (got.true_mm_s, got.read_mm_s) == pytest.approx((1.5, 0.6))
    assert slip.outcome(seen).detected_from == 0.0
    silent = slip.Slipped(seen.share, seen.true_mm_s, seen.read_mm_s, np.zeros(7))
    assert np.isnan(slip.outcome(silent).detected_from)


def test_a_drag_creeps_before_it_glides() -> None:
    tip = Tip(127, "hex")
    seen = slip.drag(Simulation(tip=tip), slip.Drag(Tool("flat"), 0.35, 30.0))
    assert len(seen.share) > 50
    assert seen.share[0] < slip.STICKS
    assert seen.share[-1] > slip.GLIDES
    assert seen.true_mm_s[-1] == pytest.approx(slip.WAY_MM, rel=0.05)  # all of it: 3 mm in a second
    assert slip.outcome(seen).false_percent == 0.0
    assert slip.outcome(seen).detected_percent > 0.0
