"""The report's sections: captured data are fitted and evaluated; each section returns its checks."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.curve import paper_curve
from calib.dataset import Dataset
from calib.evaluate import evaluate, predict
from calib.extract import Extract
from calib.fit import Choice, fit
from calib.report import plots, slip
from calib.report.page import ReportPage, Section, model_table
from calib.report.pairs import RESOLVED, resolvable_mm, shares
from calib.targets import Targets
from edge.calibration import Calibration
from edge.geometry.parts import stack

Rows = NDArray[np.intp]
HELD_OUT = 0.2  # share of random poses that is held out
NETWORK = (
    "depth 0.148 mm, tilt 1.27 and 1.45 deg, shear 1.22 and 1.19 mm, torsion 1.60 deg, direction 25.9 deg"
)


@dataclass(frozen=True, slots=True)
class Requirement:
    """A limit, and the measured value."""

    what: str
    limit: float
    measured: float
    unit: str
    at_least: bool = False

    @property
    def holds(self) -> bool:
        return self.measured >= self.limit if self.at_least else self.measured <= self.limit


@dataclass(frozen=True, slots=True)
class Seen:
    """A data set and the edge's results for it."""

    data: Dataset
    extract: Extract

    def fit(self, rows: Any = None) -> tuple[Calibration, list[Choice]]:
        return fit(self.data.rest, *self._some(rows), mm_per_px=None)

    def evaluate(self, calibration: Calibration, rows: Any = None) -> dict[str, Any]:
        return evaluate(calibration, *self._some(rows))

    def _some(self, rows: Any) -> tuple[Targets, Extract]:
        """rows: None: all of them."""
        targets, extract = self.data.targets, self.extract
        return (targets, extract) if rows is None else (targets.rows(rows), extract.rows(rows))

    def shear(self) -> Any:
        values = self.data.targets.values
        return values["shear_x_mm"] + 1j * values["shear_y_mm"]


def paper(page: ReportPage, out: Path, seen: dict[str, Seen]) -> list[Requirement]:
    """Displacement, shear and direction as the paper does them: every second frame is fitted."""
    section = page.section("The paper's protocols")
    press, shear, round_ = seen["displacement"], seen["shear"], seen["direction"]
    both = Seen(
        Dataset((*press.data.parts, *shear.data.parts)),
        stack([press.extract, shear.extract]),
    )
    calibration, choices = both.fit(np.arange(0, len(both.data), 2))
    on_press = press.evaluate(calibration, np.arange(1, len(press.data), 2))
    on_shear = shear.evaluate(calibration, np.arange(1, len(shear.data), 2))
    on_round = round_.evaluate(calibration)
    depth = press.data.targets.values["displacement_mm"]
    volume = press.extract.inputs[:, 0].real
    curve, _ = paper_curve(volume, depth)
    moved = np.abs(shear.extract.inputs[:, 1]) * shear.data.rest.pattern.tip_radius_px
    line = plots.curves(
        out / "curves.png", volume, depth, np.array(curve.knots), moved, np.abs(shear.shear())
    )
    section.text(
        "Calibration curves (paper, Fig. 10): volume of deformation over displacement, mean motion of the "
        f"pins over shear. The line misses zero by {line['offset_px']:+.2f} px, unsheared frames read "
        f"{line['at_rest_px']:.2f} px. An offset of unsheared frames is preload, as in the paper; the models "
        "carry it as their constant term, and follow the bend that the line does not."
    )
    section.picture(out / "curves.png", "displacement and shear curves")
    values, _ = predict(calibration, round_.extract)
    read = values["shear_x_mm"] + 1j * values["shear_y_mm"]
    mean = plots.directions(out / "directions.png", round_.shear(), read)
    section.text(
        "Direction (paper, Fig. 11): 36 directions, 10 frames each, read by a calibration that saw shear "
        "along x alone. A round tip does not care which way it is sheared, so its models cannot either."
    )
    section.picture(out / "directions.png", "true and read directions")
    model_table(section, choices)
    return [
        Requirement("direction of shear, mean (36 directions)", 1.0, mean, "deg"),
        Requirement("displacement, 0..5 mm", 0.03, on_press["displacement_mae_mm"], "mm"),
        Requirement("shear magnitude, 0..2 mm along x", 0.03, on_shear["shear_magnitude_mae_mm"], "mm"),
        Requirement("shear magnitude, 2 mm all round", 0.03, on_round["shear_magnitude_mae_mm"], "mm"),
    ]


def _split(n: int) -> tuple[Rows, Rows]:
    order = np.random.default_rng(0).permutation(n)
    held = round(HELD_OUT * n)
    return order[held:], order[:held]


def tilted(page: ReportPage, surface: Seen) -> list[Requirement]:
    section = page.section("Tilted and off-centre contact")
    train, test = _split(len(surface.data))
    calibration, choices = surface.fit(train)
    result = surface.evaluate(calibration, test)
    section.text(
        f"{len(train)} random flat poses are fitted, {len(test)} held out: depth 1..5 mm, tilt up to "
        "15 deg about both axes (the contact wanders up to 7 mm off the tip's axis), shear up to 2 mm per "
        "axis, twist up to 5 deg."
    )
    names = (
        "displacement_mae_mm",
        "shear_magnitude_mae_mm",
        "shear_direction_mean_deg",
        "shear_direction_median_deg",
        "torsion_mae_deg",
        "force_mae_n",
        "contact_area_mae_mm2",
        "sigma_coverage_68",
    )
    rows = [(name, "-" if result[name] is None else f"{result[name]:.3g}") for name in names]
    section.table(("held-out frames", "error"), rows)
    model_table(section, choices)
    flat_one = float((surface.extract.counts == 1).mean()) * 100.0
    return [
        Requirement(
            "direction of shear, tilt to 15 deg, off centre", 3.0, result["shear_direction_mean_deg"], "deg"
        ),
        Requirement("flat contacts found as one", 99.0, flat_one, "%", at_least=True),
    ]


def contacts(page: ReportPage, out: Path, seen: dict[str, Seen]) -> list[Requirement]:
    section = page.section("Contact places")
    calibration, choices = seen["contacts"].fit()
    checks = [
        *_single_probes(section, out, seen["contacts"], calibration, choices),
        *_pairs_of_probes(section, out, seen["pairs"], seen["contacts"], calibration),
        *_bars(section, seen["edges"]),
    ]
    model_table(section, choices)
    return checks


def _single_probes(
    section: Section, out: Path, probes: Seen, calibration: Calibration, choices: Sequence[Choice]
) -> list[Requirement]:
    place = next(c for c in choices if c.outputs[0] == "contact_x_mm")
    values = probes.data.targets.values
    true = values["contact_x_mm"] + 1j * values["contact_y_mm"]
    used = np.isfinite(true) & np.isfinite(probes.extract.contact[:, 0])
    scale = (calibration.mm_per_px or math.nan) * probes.data.rest.pattern.tip_radius_px
    raw = probes.extract.contact[used, 0] * scale
    plots.place_map(out / "places.png", true[used], raw, place.held_out)
    section.text(
        "A probe of 1.5 mm radius pressed 2 mm deep, on a 3 mm grid; each place is read by a calibration "
        "that has not seen it."
    )
    section.picture(out / "places.png", "error of the contact's place over the tip")
    off_mm = float(np.abs(place.held_out - true[used]).mean())
    single = probes.extract.counts[_column(probes, "tool") == "sphere"]
    return [
        Requirement("place of a single contact, mean over the tip", 0.2, off_mm, "mm"),
        Requirement("single probes found as one", 99.0, _percent(single == 1), "%", at_least=True),
    ]


def _pairs_of_probes(
    section: Section, out: Path, pairs: Seen, probes: Seen, calibration: Calibration
) -> list[Requirement]:
    apart_mm = _column(pairs, "tool_distance_mm").astype(float)
    counts = pairs.extract.counts
    found = shares(apart_mm, counts)
    plots.apart(out / "pairs.png", found)
    pitch_mm = (calibration.mm_per_px or math.nan) * pairs.data.rest.pattern.pitch_px
    section.text(
        "Two probes of 1 mm radius, 2 mm deep, anywhere within 5 mm of the axis and any way round: resolved "
        f"(found as two in {RESOLVED:g} % of the frames and more) from {resolvable_mm(found):g} mm on. The "
        f"pins are {pitch_mm:.1f} mm apart."
    )
    section.picture(out / "pairs.png", "share of pairs found as one, two, more, over their distance")
    section.table(
        ("distance, mm", "one, %", "two, %", "more, %"),
        [tuple(f"{value:g}" if i == 0 else f"{value:.0f}" for i, value in enumerate(row)) for row in found],
    )
    two = _column(probes, "tool") == "two"
    gap_mm = _column(probes, "tool_distance_mm").astype(float)
    at_gap = {gap: probes.extract.counts[two & (gap_mm == gap)] for gap in (4.0, 5.0)}
    more = np.concatenate([probes.extract.counts, counts]) > 2
    return [
        *(
            Requirement(f"probes {gap:g} mm apart found as two", 99.0, _percent(n == 2), "%", at_least=True)
            for gap, n in at_gap.items()
        ),
        Requirement(
            "random pairs 3 mm apart and more found as two",
            RESOLVED,
            _percent(counts[apart_mm >= 3.0] == 2),
            "%",
            at_least=True,
        ),
        Requirement(
            "random pairs 2 mm apart found as one",
            RESOLVED,
            _percent(counts[apart_mm == 2.0] == 1),
            "%",
            at_least=True,
        ),
        Requirement("a third contact beside two probes", 0.0, _percent(more), "%"),
    ]


def _bars(section: Section, bars: Seen) -> list[Requirement]:
    angle_deg = _column(bars, "tool_angle_deg").astype(float)
    off_deg = np.abs((np.degrees(bars.extract.angle_rad) - angle_deg + 90.0) % 180.0 - 90.0)
    section.text(
        f"A bar in 18 directions, through the middle and beside it: direction off by "
        f"{np.nanmean(off_deg):.2f} deg in the mean, {np.nanmax(off_deg):.2f} at the most; "
        f"{_percent(bars.extract.counts == 1):.0f} % found as one contact."
    )
    return [Requirement("direction of a long contact, mean", 3.0, float(np.nanmean(off_deg)), "deg")]


def _column(seen: Seen, name: str) -> NDArray[np.str_]:
    """A column of a capture's table, unchanged."""
    return np.array([row[name] for row in seen.data.rows])


def _percent(which: NDArray[np.bool_]) -> float:
    return float(which.mean()) * 100.0


def slips(page: ReportPage, slipped: list[slip.Slipped]) -> list[Requirement]:
    section = page.section("Slip")
    every = slip.outcome(stack(slipped))
    section.text(
        f"A tool pressed {slip.DEPTH_MM:g} mm deep is dragged {slip.WAY_MM:g} mm in a second at "
        "several frictions, until it creeps (more than a quarter of it slides, from the rim inwards) and "
        "then glides. Slip counts as detected at a probability over one half (that more than half of the "
        f"contact slides): {every.detected_percent:.0f} % of the frames that creep; the speed read there is "
        f"the skin's own motion against itself, {every.read_mm_s:.2f} mm/s where the tool runs at "
        f"{every.true_mm_s:.2f} mm/s over the contact in the mean."
    )
    rows = []
    for one, seen in zip(slip.DRAGS, slipped, strict=True):
        o = slip.outcome(seen)
        numbers = (o.false_percent, o.detected_percent, o.glide_percent, 100.0 * o.detected_from)
        speeds = (o.true_mm_s, o.read_mm_s)
        cells = [f"{v:.0f}" for v in numbers] + [f"{v:.2f}" for v in speeds]
        cells = ["-" if cell == "nan" else cell for cell in cells]
        rows.append((one.tool.kind, f"{one.friction:g}", *cells))
    section.table(
        ("tool", "friction", "detected while it sticks, %", "while it creeps, %", "while it glides, %",
         "first detected when so much slides, %", "tool over skin, mm/s", "read, mm/s"),
        rows,
    )  # fmt: skip
    return [Requirement("slip detected while the contact sticks", 1.0, every.false_percent, "%")]


def real(page: ReportPage, out: Path, published: Seen) -> None:
    section = page.section("Published recordings")
    train, test = _split(len(published.data))
    calibration, choices = published.fit(train)
    result = published.evaluate(calibration, test)
    values, sigmas = predict(calibration, published.extract.rows(test))
    true = {name: column[test] for name, column in published.data.targets.values.items()}
    plots.real_scatter(out / "real.png", true, values, sigmas)
    section.text(
        f"One random split, {len(train)} frames fitted, {len(test)} held out (five: python -m tests.bench "
        f"real). The network published with the set: {NETWORK}. Direction here: "
        f"{result['shear_direction_mean_deg']:.1f} deg mean, "
        f"{result['shear_direction_median_deg']:.1f} median. One-sigma intervals hold "
        f"{100 * result['sigma_coverage_68']:.0f} % of the values. {result['n_refused']} frames refused."
    )
    section.picture(out / "real.png", "read against true values on held-out frames")
    model_table(section, choices)
