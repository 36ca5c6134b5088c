"""From a frame to a result that may be sent: rest frame, pipeline, drift, and the fault detector's verdict.

Everything here runs in the loop's thread except `_job`. The rest frame and the calibration in use change
together, and only after the new ones have been tried.
"""

import logging
from collections.abc import Sequence
from dataclasses import replace

from edge.calibration import Calibration
from edge.config import Config
from edge.drift import Drift, DriftParams
from edge.errors import CalibrationError, EdgeError, RequestRefused, SourceError
from edge.faults.detector import FaultDetector
from edge.faults.judge import NO_CALIBRATION
from edge.faults.registry import FaultRegistry
from edge.frame import Pipeline
from edge.rest.request import Prepared, TareRequest, TareState
from edge.rest.tare import RestFrame, TareParams, TareRefused, take_rest_frame
from edge.runtime.process import give_back_memory
from edge.runtime.statistics import StatisticsCollector
from edge.types import Feature, Frame, FrameSource, Rest, Result
from hostlink.output_file import OutputError
from hostlink.wire import FaultCode, RestFrameReason, RestFrameState

log = logging.getLogger(__name__)


class Measurement:
    """Rest frame, calibration and stages of one finger.

    calibration  in use; None: values that need one are invalid
    on_surface   what the sensor's file says of its skin; a calibration knows better
    fallbacks    calibrations that the first rest frame is tried with where `calibration` is another tip's
    pipeline     the computing stages; None: there is no rest frame yet
    last         the last result
    tares_n      rest frames taken
    tare         the rest frame that is being taken, and the outcome of the last request for one
    """

    def __init__(
        self,
        source: FrameSource,
        calibration: Calibration | None,
        config: Config,
        faults: FaultRegistry,
        detector: FaultDetector,
        counters: StatisticsCollector,
    ) -> None:
        self.calibration = calibration
        self.on_surface, self.fallbacks = False, tuple[Calibration, ...]()
        self.pipeline: Pipeline | None = None
        self.last: Result | None = None
        self.tares_n = 0
        self._source, self._config, self._faults = source, config, faults
        self._detector, self._counters = detector, counters
        self.demand = frozenset(config.features.demand)
        self._shown: frozenset[Feature] = frozenset()
        self._watchers: set[object] = set()
        self.tare = TareState(config.tare.frames_n)
        self._reference: Rest | None = None  # the last rest frame that was not forced
        self._shape = (0, 0)  # of the rest frame's image
        self._failing = False  # the last frame could not be computed
        self._forced = False  # the rest frame in use was: against it, an untouched tip may seem touched
        if calibration is None:
            faults.report(FaultCode.CALIBRATION_MISSING, True, NO_CALIBRATION)

    def ask_tare(self, force: bool) -> TareRequest:
        """As `TareState.ask`; refused too after a frame that showed a touch. Raises RequestRefused."""
        features = self.last.features if self.last else None
        if features is not None and features.in_contact and not (force or self._forced):
            raise RequestRefused("something touches the tip; let go, or force the tare")
        return self.tare.ask(force)

    # ---- settings -----------------------------------------------------------------------------------

    def set_demand(
        self, demand: frozenset[Feature] | None = None, shown: frozenset[Feature] | None = None
    ) -> None:
        """Compute these features from the next frame on, and those that viewers see; None: as before."""
        self.demand = self.demand if demand is None else demand
        self._shown = self._shown if shown is None else shown
        if self.pipeline is not None:
            self.pipeline.demand = self.demand | self._shown

    def watch(self, who: object, watches: bool = True) -> None:
        """Have the cells of an untouched tip made, too, as long as anybody looks at them."""
        if watches is (who in self._watchers):
            return
        (self._watchers.add if watches else self._watchers.discard)(who)
        if self.pipeline is not None:
            self.pipeline.watch(bool(self._watchers))

    # ---- frames -------------------------------------------------------------------------------------

    def measure(self, frame: Frame) -> Result | None:
        """Result of one frame; None: there is no rest frame, or the image cannot be computed.

        No image raises an error: one that cannot be computed reports TRACKER_LOST.
        Raises  SourceError, CalibrationError: a recording that cannot be used, at its start
        """
        try:
            result = self._measure(frame)
        except (CalibrationError, SourceError):
            raise
        except Exception as error:  # noqa: BLE001  (logged, counted and reported as a fault by `_failed`)
            self._failed(frame, error)
            return None
        self._failing = False
        if result is not None:
            self.last = result
        return result

    def _failed(self, frame: Frame, error: Exception) -> None:
        if not self._failing:
            expected = isinstance(error, EdgeError)
            level = logging.WARNING if expected else logging.ERROR
            log.log(level, "image %d: %s", frame.sequence, error, exc_info=not expected)
        self._failing = True
        self._counters.counts.failed_n += 1
        self._detector.failed(str(error))
        if self.tare.frames is not None:
            self.tare.frames = []
        if self.pipeline is not None:
            self.pipeline.forget()

    def _measure(self, frame: Frame) -> Result | None:
        """Raises EdgeError: the camera changed its size, and the rest frame no longer applies."""
        if self.pipeline is not None and frame.image.shape != self._shape:
            now, rest = (f"{width}x{height}" for height, width in (frame.image.shape, self._shape))
            raise EdgeError(f"it has {now} px, the rest frame {rest}; set the camera back, or restart")
        if self.tare.busy or self.tare.request is not None:
            self._tare(frame)
        if self.pipeline is None:
            self._detector.judge_image(frame)
            return None
        if self._detector.after_gap:
            self.pipeline.forget()
        result = self.pipeline.step(frame, self._detector)
        if result.searched:
            self._counters.counts.full_searches_n += 1
        return result

    def use_rest(self, rest: Rest, frame: Frame) -> None:
        """Measure against this rest frame, taken from `frame`, instead of one from the first images."""
        self.tare.frames = None
        self._accept_tare(RestFrame(rest), self._stages(rest, self.calibration), frame)

    def _stages(self, rest: Rest, calibration: Calibration | None) -> Pipeline:
        if self.on_surface:
            rest = replace(rest, pattern=replace(rest.pattern, on_surface=True))
        features = self._config.features
        return Pipeline(rest, calibration, several=features.several, smooth_s=features.smooth_ms * 1e-3)

    # ---- tare ---------------------------------------------------------------------------------------

    def _tare(self, frame: Frame) -> None:
        """Collect this image for a requested rest frame, and use one that is ready."""
        frames = self.tare.collect(frame, usable=not self._detector.frozen)
        if frames is not None:
            self._check_rest(frames)
        if self.tare.checked:
            self._end_tare()

    def _check_rest(self, frames: Sequence[Frame]) -> None:
        request = self.tare.request or TareRequest(0)

        def job() -> Prepared:
            try:
                return self._prepare(frames, request)
            finally:
                give_back_memory()

        def make_tables(pipeline: Pipeline) -> None:
            try:
                pipeline.prepare(self.demand)
            except Exception:  # the frame that needs a table makes it, and says what is wrong
                log.exception("tables could not be made in advance")
            give_back_memory()

        self.tare.start(job, make_tables)

    def _end_tare(self) -> None:
        try:
            prepared = self.tare.result()
        except TareRefused as error:
            self._refuse_tare(error)
        except (OSError, OutputError) as error:
            self._refuse_tare(
                TareRefused(RestFrameReason.NOT_STORED, f"the calibration cannot be stored: {error}")
            )
        except Exception as error:
            log.exception("a rest frame could not be taken")
            self._refuse_tare(TareRefused(RestFrameReason.OTHER, str(error)))
        else:
            self._accept_tare(*prepared)

    def _prepare(self, frames: Sequence[Frame], request: TareRequest) -> Prepared:
        """Take and check the rest frame, make stages, store a calibration. Raises TareRefused, OSError."""
        calibration = request.calibration or self.calibration
        try:
            rest_frame = self.take_rest_frame(frames, calibration, request.force)
        except TareRefused as error:
            is_start = self.pipeline is None and request.calibration is None
            if not is_start or error.reason is not RestFrameReason.OTHER_TIP:
                raise
            calibration, rest_frame = self._fall_back(frames, error)
        pipeline = self._stages(rest_frame.rest, calibration)
        if request.store is not None:
            request.store()
        return rest_frame, pipeline, frames[-1]

    def take_rest_frame(
        self, frames: Sequence[Frame], calibration: Calibration | None, force: bool = False
    ) -> RestFrame:
        """The rest frame that these images give; it is not used yet. Raises TareRefused."""
        tare, force = self._config.tare, force or not self._source.live
        params = TareParams(tare.frames_n, tare.steady_px).of(self._source)
        images = [frame.image for frame in frames]
        return take_rest_frame(images, params, calibration, self._reference, force=force)

    def _fall_back(self, frames: Sequence[Frame], error: TareRefused) -> tuple[Calibration, RestFrame]:
        """A calibration of this tip, where the first choice was another's. Raises TareRefused: none is."""
        for calibration in self.fallbacks:
            try:
                rest_frame = self.take_rest_frame(frames, calibration)
            except TareRefused:
                continue
            log.warning("%s; using the calibration stored before, %08x", error, calibration.content_id)
            return calibration, rest_frame
        raise error

    def _accept_tare(self, found: RestFrame, pipeline: Pipeline, frame: Frame) -> None:
        """Use this rest frame and its calibration from now on."""
        self.pipeline, self.calibration = pipeline, pipeline.calibration
        self.set_demand()
        pipeline.watch(bool(self._watchers))
        pipeline.drift = Drift(found.rest, DriftParams(limit_px=self._config.tare.drift_px))
        self._shape = found.rest.pattern.size_px[::-1]
        self.tares_n += 1
        self._detector.learn(found.rest, frame, self.calibration is not None)
        self._forced = found.reason is not RestFrameReason.NONE
        if not self._forced:
            self._reference = found.rest
            state = RestFrameState.ACCEPTED
        else:
            self._faults.report(FaultCode.TARE_IMPLAUSIBLE, True, f"rest frame forced: {found.message}")
            state = RestFrameState.FORCED
        self.tare.finish(state, found.reason, found.message)
        log.info("%s: rest frame with %d pins", self._source.name, len(found.rest))

    def _refuse_tare(self, error: TareRefused) -> None:
        """Keep the present rest frame and calibration; without them, try again with the next images."""
        if self.pipeline is None and not self._source.live:
            kind = CalibrationError if error.reason is RestFrameReason.OTHER_TIP else SourceError
            raise kind(f"{self._source.name}: {error}")
        self._faults.report(FaultCode.TARE_IMPLAUSIBLE, True, str(error))
        if self.pipeline is None and self.tare.request is None and error.reason is RestFrameReason.OTHER_TIP:
            self._faults.report(FaultCode.CALIBRATION_FOREIGN, True, str(error))  # until one is accepted
        self.tare.finish(RestFrameState.REFUSED, error.reason, str(error))
        if self.pipeline is None:
            self.tare.frames = []

    def no_images(self) -> None:
        """The camera has given none for long: refuse a requested rest frame."""
        if self.tare.request is not None and self.tare.job is None:
            message = "; ".join(self._faults.active.values())
            self._refuse_tare(TareRefused(RestFrameReason.NO_IMAGES, f"no images: {message}"))

    def source_ended(self) -> None:
        """A recording shorter than the tare: use all its images. Raises SourceError, CalibrationError."""
        frames = self.tare.frames
        if self.pipeline is None and frames is not None and not self._source.live:
            self._check_rest(frames)
            self._end_tare()
