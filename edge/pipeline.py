"""All stages composed: one frame in, one result out. No input, no output, no threads.

    Frame -> pins -> track -> tessellate -> features -> calibrate -> Result

While identities are held, only the windows round the predicted pins are read. On loss the whole frame is
searched and the pins are identified anew, in the same frame. What the demand does not ask for is not
computed, and a frame whose identities are in doubt yields no values at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from edge.calibration import Calibration, uncalibrated
from edge.drift import Drift
from edge.errors import CalibrationError, DegenerateLayout, NoPins
from edge.features import FeatureExtractor
from edge.pins import Refiner, detect, take_rest
from edge.tessellate import Tessellator
from edge.track import Tracker
from edge.types import Array, Cells, Feature, Features, Frame, Image, Pins, Reading, Rest, Tracks

#: Features that are made of cell areas; the others need only the pins' motion.
OF_CELLS = frozenset(Feature) - {Feature.SHEAR, Feature.TORSION}
ALL = frozenset(Feature)


@dataclass(frozen=True, slots=True)
class Result:
    """What one frame gave.

    cells, features  None where identities were not sure, or nobody asked
    reading          empty where nothing is calibrated or sure
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
        self._capture_ns: int | None = None  # of the last frame that gave features
        self._refiner = Refiner(rest)
        self.tracker = Tracker(rest)
        self._tessellator = Tessellator(rest)
        still = Tracks(rest.xy_img, rest.pins.sigma_px, np.ones(len(rest), dtype=np.bool_), 1.0)
        self._extractor = FeatureExtractor(rest, self._tessellator.cells(still).rest_area_px2)

    def process(self, frame: Frame, drift: Drift | None = None, *, even_unsure: bool = False) -> Result:
        """Everything that is in demand, from one frame.

        drift        taken off the pins' places before anything is computed from them
        even_unsure  values from doubtful identities too: for statistics of what a refusal avoids
        """
        tracks, searched = self._locate(frame.image)
        if tracks.confidence < Tracks.LOW_CONFIDENCE and not (even_unsure and tracks.n_seen >= 3):
            return Result(frame, tracks, None, None, uncalibrated(), searched)
        try:
            cells = self._tessellator.cells(tracks) if self.demand & OF_CELLS else None
        except DegenerateLayout:  # what is left of the pins spans no plane: as good as lost
            return Result(frame, tracks, None, None, uncalibrated(), searched)
        features = self._extractor.extract(tracks, cells, self.demand)
        if self.calibration is None:
            reading = uncalibrated(features)
        else:
            before_ns, self._capture_ns = self._capture_ns, frame.capture_ns
            interval_s = None if before_ns is None else (frame.capture_ns - before_ns) * 1e-9
            reading = self.calibration.apply(features, self.rest.pattern, interval_s)
        return Result(frame, tracks, cells, features, reading, searched)

    def forget(self) -> None:
        """Take the next frame for itself, as after a jump: no pin positions are carried over."""
        self.tracker.forget()

    def _locate(self, image: Image) -> tuple[Tracks, bool]:
        predicted = self.tracker.predict()
        if predicted is not None:
            tracks = self.tracker.follow(self._refiner.refine(image, predicted))
            if tracks.confidence >= Tracks.LOW_CONFIDENCE:
                return tracks, False
        return self.tracker.identify(detect(image, self.rest.pattern)), True


def tare(images: Sequence[Image], steady_px: float, calibration: Calibration | None = None) -> Rest:
    """The rest frame from a few images of the untouched tip.

    With a calibration its pins' order is kept, and the tip must be the one that it belongs to.

    steady_px  largest motion of a pin from the first to the last image
    Raises     NoPins: no pins in view, or they move; CalibrationError: another tip, another image size
    """
    rest = take_rest(images)
    drift = np.hypot(*(_positions(images[-1], rest) - _positions(images[0], rest)).T)
    if np.nanpercentile(drift, 90) > steady_px:
        raise NoPins(
            f"tare: the pins moved by {np.nanpercentile(drift, 90):.1f} px while the rest frame was taken; "
            f"leave the tip untouched (limit {steady_px:g} px, key [tare] steady_px)"
        )
    return rest if calibration is None else in_order_of(calibration, rest)


def _positions(image: Image, rest: Rest) -> np.ndarray:
    return Refiner(rest).refine(image, rest.xy_img).xy_img


#: In pitches. A camera that was taken out and put back shifts and turns all pins alike; what is left after
#: that is bending: under 0.02 from one tare to the next in the recordings at hand, over 0.2 under a touch.
SHIFT_MAX, BEND_MAX = 0.4, 0.1


def _moved_and_bent(before: Array, now: Array) -> tuple[float, float]:
    """How far the pins moved together, and how far the worst twentieth is off a common turn, shift and zoom.

    before, now  (n, 2) px
    Returns      median motion and 95 % quantile of the rest, px
    """
    z, w = before @ (1, 1j), now @ (1, 1j)
    shape = np.column_stack([z, np.ones_like(z)])
    left = w - shape @ np.linalg.lstsq(shape, w, rcond=None)[0]
    return float(np.median(np.abs(w - z))), float(np.quantile(np.abs(left), 0.95))


def in_order_of(calibration: Calibration, rest: Rest) -> Rest:
    """The rest frame with row i being pin i of the calibration file."""
    made_with = calibration.rest
    if rest.pattern.size_px != made_with.pattern.size_px:
        raise CalibrationError(
            f"the calibration was made at {made_with.pattern.size_px[0]}x{made_with.pattern.size_px[1]}, "
            f"the images are {rest.pattern.size_px[0]}x{rest.pattern.size_px[1]}: "
            "give the calibration of this tip, or set a live camera to that size"
        )
    tracks = Tracker(made_with).identify(rest.pins)
    moved = tracks.xy_img - made_with.xy_img
    if tracks.confidence < Tracks.LOW_CONFIDENCE or tracks.n_seen < 0.9 * len(made_with):
        raise CalibrationError(
            f"the calibration belongs to another tip: {tracks.n_seen} of its {len(made_with)} pins were found"
        )
    shift, bend = _moved_and_bent(made_with.xy_img[tracks.seen], tracks.xy_img[tracks.seen])
    pitch = made_with.pattern.pitch_px
    if shift > SHIFT_MAX * pitch or bend > BEND_MAX * pitch:
        raise CalibrationError(
            f"the pins are shifted by {shift:.1f} px and bent by {bend:.1f} px against the calibration's "
            f"(limits {SHIFT_MAX * pitch:.1f} and {BEND_MAX * pitch:.1f}): something touches the tip, or "
            "it is another one"
        )
    # A pin that this tare missed stands where the calibration's pin moved with its neighbours.
    xy = np.where(tracks.seen[:, None], tracks.xy_img, made_with.xy_img + np.nanmedian(moved, axis=0))
    sigma = np.where(tracks.seen, tracks.sigma_px, made_with.pattern.pin_radius_px)
    # How bright each is is today's light; a pin that was missed is taken for a usual one.
    light = np.full(len(made_with), np.median(rest.pins.brightness))
    of_rest = np.hypot(*(tracks.xy_img[tracks.seen][:, None] - rest.xy_img).transpose(2, 0, 1)).argmin(1)
    light[tracks.seen] = rest.pins.brightness[of_rest]
    pins = Pins(xy, sigma, made_with.pins.radius_px, light)
    return Rest(pins, rest.pattern)
