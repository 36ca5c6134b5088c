"""All stages composed: one frame in, one result out. No input, no output, no threads.

    Frame -> pins -> tracking -> cells -> features -> calibration -> Result

While identities are held, only the windows round the predicted pins are read. On loss the whole frame is
searched and the pins are identified again, in the same frame. Only features in demand are computed, and a
frame whose identities are not trusted yields no values at all.
"""

from __future__ import annotations

import numpy as np

from edge.calibration import OF_GRIP, Calibration, Grip, uncalibrated
from edge.cells import Tessellator
from edge.drift import Drift
from edge.errors import DegenerateLayout
from edge.features import FeatureExtractor, Fits
from edge.pins import CentroidRefiner, detect
from edge.tracking import Tracker
from edge.types import Cells, Feature, Features, Frame, Image, Reading, Rest, Tracks, per_frame

#: Features that need cell areas; the others need only the pins' motion.
OF_CELLS = frozenset(f for f in Feature if f.cells)
#: Those whose models may depend on the pins' motion alone: areas only say when a contact begins and ends.
OF_MODES = frozenset(f for f in Feature if not f.areas)
ALL = frozenset(Feature)


@per_frame
class Result:
    """The result of one frame.

    cells, features  None if identities are not trusted, or nothing in demand depends on them
    reading          empty if nothing is calibrated or trusted
    searched         True: the whole frame was searched, not only the windows
    """

    frame: Frame
    tracks: Tracks
    cells: Cells | None
    features: Features | None
    reading: Reading
    searched: bool


class Pipeline:
    """The computing stages of one tip, with their state."""

    def __init__(
        self, rest: Rest, calibration: Calibration | None = None, demand: frozenset[Feature] = ALL
    ) -> None:
        self.rest = rest
        self.calibration = calibration
        self.demand = demand
        self._asked: frozenset[Feature] | None = None
        self._needed = demand  # the demand, and the features that the calibration needs for it
        self._with_cells = self._with_areas = self._with_grip = True  # whether it needs them
        self._capture_ns: int | None = None  # of the last frame that gave features
        self._moments = calibration is None or calibration.of_moments  # what is wanted of contacts
        self._fits = Fits.ALL if calibration is None else Fits.SEVERAL if calibration.of_fits else Fits.NONE
        self._grip = Grip()
        self._refiner = CentroidRefiner(rest)
        self.tracker = Tracker(rest)
        self._tessellator = Tessellator(rest)
        still = Tracks(rest.xy_img, rest.pins.sigma_px, np.ones(len(rest), dtype=np.bool_), 1.0)
        self._extractor = FeatureExtractor(rest, self._tessellator.cells(still).rest_area_px2)

    def process(self, frame: Frame, drift: Drift | None = None, *, even_untrusted: bool = False) -> Result:
        """Compute everything in demand from one frame.

        drift           subtracted from the pins' places before anything is computed from them; the result's
                        tracks are where the pins are seen
        even_untrusted  give values for identities that are not trusted too: for statistics
        """
        if self.demand is not self._asked:
            self._ask()
        tracks, searched = self._locate(frame.image)
        if searched:
            self._extractor.forget_contacts()
        if tracks.confidence < Tracks.LOW_CONFIDENCE and not (even_untrusted and tracks.n_seen >= 3):
            return Result(frame, tracks, None, None, uncalibrated(), searched)
        moved = tracks if drift is None else drift.correct(tracks)
        holds = self._with_cells and not self._with_areas and self._extractor.contact_holds(moved)
        if holds:
            self._tessellator.keep(moved)
        try:
            cells = self._tessellator.cells(moved) if self._with_cells and not holds else None
        except DegenerateLayout:  # the pins that remain span no plane: treat them as lost
            return Result(frame, tracks, None, None, uncalibrated(), searched)
        calibration = self.calibration
        features = self._extractor.extract(
            moved,
            cells,
            self._needed,
            contact_holds=holds,
            modes_at_rest=calibration is None,
            moments=self._moments,
            fits=self._fits,
            capture_ns=frame.capture_ns,
        )
        if calibration is None:
            reading = uncalibrated(features)
        else:
            before_ns, self._capture_ns = self._capture_ns, frame.capture_ns
            interval_s = None if before_ns is None else (frame.capture_ns - before_ns) * 1e-9
            reading = calibration.apply(features, self.rest.pattern, interval_s, self.demand)
            if self._with_grip:
                self._add_grip(calibration, features, reading)
        return Result(frame, tracks, cells, features, reading, searched)

    def _add_grip(self, calibration: Calibration, features: Features, reading: Reading) -> None:
        """Add friction and slip margin."""
        if not features.in_contact:
            self._grip.forget()
        else:
            area_mm2 = calibration.area_mm2(features, reading.values)
            reading.values.update(self._grip.update(reading.values, reading.sigmas, area_mm2))

    def prepare(self, demand: frozenset[Feature]) -> None:
        """Make now what otherwise the first contacts and lost pins would wait for (100 ms); before the first
        frame.
        """
        self._tessellator.prepare()
        self._extractor.prepare(self._features_for(demand))

    def _ask(self) -> None:
        """Look at the demand once: an enum's hash is Python code."""
        self._asked, self._needed = self.demand, self._features_for(self.demand)
        self._with_cells = not OF_CELLS.isdisjoint(self._needed)
        self._tessellator.forget()  # the last cells may be of long ago
        of_volume = self.calibration is None or self.calibration.of_volume
        self._with_areas = of_volume or not self._needed <= OF_MODES
        outputs = frozenset() if self.calibration is None else self.calibration.outputs
        self._with_grip = Feature.FORCE in self.demand and outputs >= OF_GRIP
        if not self._with_grip:
            self._grip.forget()

    def _features_for(self, demand: frozenset[Feature]) -> frozenset[Feature]:
        """The demand, and the features that the calibration needs for it."""
        return demand if self.calibration is None else self.calibration.needed(demand)

    def features(self, tracks: Tracks) -> Features:
        """Features of pins at given places; contacts do not follow from the last frame's.

        Raises   DegenerateLayout: they span no plane
        """
        cells = self._tessellator.cells(tracks) if self.demand & OF_CELLS else None
        self._extractor.forget_contacts()
        return self._extractor.extract(tracks, cells, self.demand)

    def forget(self) -> None:
        """Treat the next frame on its own, as after a jump: no pin positions are carried over."""
        self.tracker.forget()
        self._tessellator.forget()
        self._extractor.forget_contacts()

    def _locate(self, image: Image) -> tuple[Tracks, bool]:
        predicted = self.tracker.predict()
        if predicted is not None:
            tracks = self.tracker.follow(self._refiner.read(image, predicted))
            if tracks.confidence >= Tracks.LOW_CONFIDENCE:
                return tracks, False
        return self.tracker.identify(detect(image, self.rest.pattern)), True
