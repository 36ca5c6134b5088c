"""The way of one image, top to bottom: `Pipeline.step`. No input, no output, no threads.

    Frame -> pins -> tracking -> drift -> cells -> features -> calibration -> faults -> Result

While identities are held, only the windows round the predicted pins are read. On loss the whole frame is
searched and the pins are identified again, in the same frame. `FramePlan` says what is computed; it is made
when the demand changes. A frame whose identities are not trusted yields no values at all. Several views of
one skin, as mirrors show it, go that way each by itself, and are joined (`edge.views`).
"""

from dataclasses import dataclass, replace

import numpy as np

from edge.calibration import OF_GRIP, Calibration, Grip, uncalibrated
from edge.calibration.evaluation import area_mm2
from edge.calibration.smoothing import Smoother
from edge.cells import Tessellator
from edge.drift import Drift
from edge.errors import DegenerateLayout
from edge.faults.detector import FaultDetector
from edge.features import FeatureExtractor, FeaturePlan, Fits
from edge.geometry.parts import own_pins, parts_of, tracks_of
from edge.pins import CentroidRefiner, detect
from edge.tracking import Tracker
from edge.types import Feature, Features, Frame, Image, Index, Reading, Rest, Result, Tracks
from edge.views import JoinedViews

#: Features that need cell areas; the others need only the pins' motion.
OF_CELLS = frozenset(f for f in Feature if f.cells)
#: Their models may depend on the pins' motion alone: areas only say when a contact begins and ends.
OF_MODES = frozenset(f for f in Feature if not f.areas)
ALL = frozenset(Feature)
_NOTHING = FeaturePlan(frozenset())


@dataclass(frozen=True, slots=True, eq=False)
class FramePlan:
    """The steps of a frame, as a demand needs them of a calibration.

    cells     whether cells are made
    areas     whether they are needed of each frame in contact; else not while the pins' motion shows that it
              goes on
    watched   somebody looks at the cells: frames without a contact have them, too, and all have triangles;
              else they are not made while the pins' motion shows that nothing touches
    features  what is computed of them
    grip      whether friction and slip margin are made of the forces
    """

    cells: bool
    areas: bool
    watched: bool
    features: FeaturePlan
    grip: bool


def plan_of(
    demand: frozenset[Feature], calibration: Calibration | None, several: bool = True, watched: bool = True
) -> FramePlan:
    """The one place where a demand becomes steps; several: contacts of one frame are fitted together;
    watched: somebody looks at the cells of an untouched tip, too.
    """
    if calibration is None:
        features = FeaturePlan(demand, fits=Fits.ALL if several else Fits.NONE)
        return FramePlan(not OF_CELLS.isdisjoint(demand), True, True, features, False)
    needed = calibration.needed(demand)
    fits = Fits.SEVERAL if several and calibration.of_fits else Fits.NONE
    return FramePlan(
        cells=not OF_CELLS.isdisjoint(needed),
        areas=calibration.of_volume or not needed <= OF_MODES,
        watched=watched,
        features=FeaturePlan(needed, moments=calibration.of_moments, fits=fits, modes_at_rest=False),
        grip=Feature.FORCE in demand and calibration.outputs >= OF_GRIP,
    )


class _View:
    """The stages of one view of the skin, as a rule the only one, with their state; rows: its pins.

    plan, demand  what is computed of each frame; to be set
    """

    def __init__(self, rest: Rest, rows: Index, calibration: Calibration | None) -> None:
        self.rows, self._rest, self._calibration = rows, rest, calibration
        self._capture_ns: int | None = None  # of the last frame that gave features
        self._refiner = CentroidRefiner(rest)
        self._tracker = Tracker(rest, self._refiner.found, self._refiner.predicted)
        since = rest.since or rest
        self._pattern, self.tessellator = since.pattern, Tessellator(since)
        known, area_px2 = rest if calibration is None else calibration.rest, self.tessellator.rest_area_px2
        self._extractor = self._touch = FeatureExtractor(since, area_px2, known.pattern.on_surface)
        if rest.since:
            still = Tracks.of(rest.xy_img, rest.pins.sigma_px, np.ones(len(rest), dtype=np.bool_))
            self._touch = FeatureExtractor(rest, self.tessellator.cells(still).area_px2)
        self.demand: frozenset[Feature] = frozenset()
        self.plan = plan_of(self.demand, None)

    def process(self, frame: Frame, drift: Drift | None, even_untrusted: bool) -> Result:
        """As of the pipeline, whose drift this is."""
        plan = self.plan
        tracks, searched = self._locate(frame.image)
        if searched:
            self._extractor.forget_contacts(tracks.confidence < Tracks.LOW_CONFIDENCE)
            if tracks.confidence < Tracks.LOW_CONFIDENCE and not (even_untrusted and tracks.n_seen >= 3):
                return Result(frame, tracks, None, None, uncalibrated(), searched)
        moved = tracks
        if drift is not None and drift.learnt:
            t, extractor = tracks, self._extractor
            xy_img = extractor.less_offset(t.xy_img, t.sigma_px, drift.offset_of(self.rows))
            moved = Tracks(xy_img, t.sigma_px, t.seen, t.n_seen, t.confidence, t.autocorrelation)
        touched = self._touch.touched(moved, plan.areas, plan.watched) if plan.cells else None
        if touched is not None:
            self.tessellator.keep(moved)
        try:
            wanted = plan.cells and touched is None
            cells = self.tessellator.cells(moved, plan.watched) if wanted else None
        except DegenerateLayout:  # the pins that remain span no plane: treat them as lost
            return Result(frame, tracks, None, None, uncalibrated(), searched)
        seen = None
        if self._touch is not self._extractor:  # a touch and each pin's motion are those since the tare
            seen = self._touch.extract(moved, cells, _NOTHING, touched)
            touched = seen.in_contact
        features = self._extractor.extract(moved, cells, plan.features, touched, frame.capture_ns)
        if seen is not None:
            names = ("area_change", "displacement_px", "step_px", "longest_px")
            features = replace(features, **{name: getattr(seen, name) for name in names})
        if self._calibration is None:
            reading = uncalibrated(features)
        else:
            before_ns, self._capture_ns = self._capture_ns, frame.capture_ns
            interval_s = None  # which only a speed of slip needs
            if before_ns is not None and features.slip_px is not None:
                interval_s = (frame.capture_ns - before_ns) * 1e-9
            reading = self._calibration.apply(features, self._pattern, interval_s, self.demand)
        return Result(frame, tracks, cells, features, reading, searched)

    def _locate(self, image: Image) -> tuple[Tracks, bool]:
        """Where each pin is, and whether the whole image was searched for them."""
        if self._tracker.held:
            self._refiner.read(image)
            tracks = self._tracker.follow(again=lambda: self._refiner.read(image))
            if tracks.confidence >= Tracks.LOW_CONFIDENCE:
                return tracks, False
        return self._tracker.identify(own_pins(detect(image, self._rest.pattern), self._rest)), True

    def prepare(self, plan: FramePlan) -> None:
        self.tessellator.prepare()
        self._extractor.prepare(plan.features)

    def features(self, tracks: Tracks, plan: FramePlan) -> Features:
        cells = self.tessellator.cells(tracks) if plan.cells else None
        self._extractor.forget_contacts()
        return self._extractor.extract(tracks, cells, plan.features)

    def forget(self, noise: bool) -> None:
        self._tracker.forget()
        self.tessellator.forget()
        self._extractor.forget_contacts(slip=True, noise=noise)


class Pipeline:
    """The stages of one tip, with their state; of several views of one skin, each has its own.

    drift  what has been learnt of the rest frame's change, subtracted from the pins' places before anything
           is computed from them; a result's tracks are where the pins are seen. None: nothing is learnt
    several  whether contacts of one frame are fitted together: `edge.features.several`
    smooth_s  time in which `step` smooths values: `edge.calibration.smoothing`; 0: it does not
    """

    def __init__(
        self,
        rest: Rest,
        calibration: Calibration | None = None,
        demand: frozenset[Feature] = ALL,
        drift: Drift | None = None,
        several: bool = True,
        smooth_s: float = 0.0,
    ) -> None:
        self.rest, self.calibration = rest, calibration
        self.drift, self._several, self._watched = drift, several, True
        self._grip = Grip()
        self._smoother = Smoother(smooth_s) if smooth_s > 0.0 else None
        parts = parts_of(rest)
        known = [None] * len(parts) if calibration is None else calibration.views
        self._views = [_View(own, rows, one) for (rows, own), one in zip(parts, known, strict=True)]
        areas_px2 = [view.tessellator.rest_area_px2 for view in self._views]
        self._joined = None if len(parts) == 1 else JoinedViews(rest, areas_px2)
        self.demand = demand

    @property
    def demand(self) -> frozenset[Feature]:
        """Features that are computed; from the next frame on."""
        return self._demand

    @demand.setter
    def demand(self, demand: frozenset[Feature]) -> None:
        self._demand = demand
        self._plan = plan_of(demand, self.calibration, self._several, self._watched)
        for view in self._views:
            view.plan, view.demand = self._plan, demand
            view.tessellator.forget()  # the last cells may be of long ago
        if not self._plan.grip:
            self._grip.forget()

    def watch(self, watched: bool) -> None:
        """Whether cells of an untouched tip are wanted as well; from the next frame on."""
        if watched != self._watched:
            self._watched = watched
            self.demand = self._demand

    def step(self, frame: Frame, judge: FaultDetector) -> Result:
        """One image to what may be sent of it."""
        result = self.process(frame)
        judged = judge.judge(frame, result, self.drift.limit_share if self.drift else 0.0)
        if judged.tracks is not result.tracks:  # the pattern was matched to itself rotated
            self.forget()
        if self._smoother is not None:
            self._smoother.update(judged)
        if self.drift is not None:
            untouched = judged.features is not None and not judged.features.in_contact
            self.drift.learn(judged.tracks, frame.capture_ns, untouched and judge.quiet)
        return judged

    def process(self, frame: Frame, even_untrusted: bool = False) -> Result:
        """Compute what the plan says of one frame.

        even_untrusted  give values for identities that are not trusted too: for statistics
        """
        if self._joined is None:
            result = self._views[0].process(frame, self.drift, even_untrusted)
        else:
            of_views = [view.process(frame, self.drift, even_untrusted) for view in self._views]
            result = self._joined.result(frame, of_views)
        if result.features is None:
            self._grip.forget()
        elif self._plan.grip:
            self._update_grip(result.features, result.reading)
        return result

    def _update_grip(self, features: Features, reading: Reading) -> None:
        """Add friction and slip margin, which follow from the forces."""
        if not features.in_contact:
            self._grip.forget()
        elif self.calibration is not None:
            area = area_mm2(features.contacts, reading.values, self.calibration.mm_per_px)
            reading.values.update(self._grip.update(reading.values, reading.sigmas, area))

    def prepare(self, demand: frozenset[Feature]) -> None:
        """Make the tables that the first contacts and lost pins would wait for (100 ms); from any thread."""
        plan = plan_of(demand, self.calibration, self._several)
        for view in self._views:
            view.prepare(plan)

    def features(self, tracks: Tracks) -> Features:
        """Features of pins at these places, on their own. Raises DegenerateLayout: they span no plane."""
        plan = plan_of(self._demand, None, self._several)
        if self._joined is None:
            return self._views[0].features(tracks, plan)
        return self._joined.features([v.features(tracks_of(tracks, v.rows), plan) for v in self._views])

    def forget(self, noise: bool = False) -> None:
        """Treat the next frame on its own, as after a jump: neither places nor loads are carried over.

        noise  also forget what untouched frames have taught of it, as if no frame had been seen
        """
        self._grip.forget()
        if self._smoother is not None:
            self._smoother.forget()
        for view in self._views:
            view.forget(noise)
