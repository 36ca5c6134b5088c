# cython: infer_types=True
"""Which faults hold, from what the loop sees: camera, order of images, picture, pins, load, place.

A kernel (`CONTRIBUTING.md`, "Kernels"). `begin` looks at a frame's time before it is computed, since that
decides how; `judge` does all else after it.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import nan, sqrt

import cython
import numpy as np

from edge.faults.image_quality import HALF_REL, ImageQuality
from edge.faults.judge import BELOW, MEASURES, NO_CALIBRATION, Judge, fault_checks
from edge.faults.pin_visibility import BASELINE_N, PinVisibility
from edge.faults.registry import FaultRegistry
from edge.features.params import PARAMS as FEATURES
from edge.params import ASTRAY_REL
from edge.params import PARAMS as RUNTIME
from edge.sources.live import ThreadedSource, stalled_after_s
from edge.types import NOWHERE, Array, Clock, Features, Frame, FrameSource, Reading, Rest, Result, Tracks
from hostlink.order_and_time import DRIFT_MAX
from hostlink.wire import FaultCode as F
from hostlink.wire import Status

if cython.compiled:
    from cython.cimports.edge.faults.frame_counts import level_of
else:
    from edge.faults.frame_counts import level_of

NAN = cython.declare(cython.double, nan)
#: An image comes so much too early where its clock was set, and not late before.
STEP_S = cython.declare(cython.double, 0.5)
_DRIFT_MAX = cython.declare(cython.double, DRIFT_MAX)
_ROOT_HALF = cython.declare(cython.double, sqrt(HALF_REL))
_NOISE_RATIO_MAX = cython.declare(cython.double, FEATURES.noise_ratio_max)
_BASELINE_N = cython.declare(cython.double, BASELINE_N)
_BELOW_N, _MEASURES_N = cython.declare(cython.int, len(BELOW)), cython.declare(cython.int, len(MEASURES))
#: Conditions of a camera that sends no images, or one again and again.
_STALLED = ("stalled", "frozen")
#: Faults that a new rest frame clears.
_OF_THE_REST = (F.TARE_IMPLAUSIBLE, F.CALIBRATION_FOREIGN, F.CAMERA_MOVED, F.TRACKER_LOST, F.PINS_LOST)
#: Status bits as plain integers: to take a member of an enumeration, or its flags, takes long.
_CAMERA_FAULT, _CAMERA_MOVED, _TOUCHED, _NOT_LIVE, _FRAMES_DROPPED = map(
    int, (Status.CAMERA_FAULT, Status.CAMERA_MOVED, Status.TOUCHED, Status.NOT_LIVE, Status.FRAMES_DROPPED)
)
#: Why a sample has no values: the first of these that holds, causes before what follows from them.
_BLINDING = (F.CAMERA_LOST, F.CAMERA_STALLED, F.IMAGE_DARK, F.IMAGE_BRIGHT, F.IMAGE_BLURRED, F.TRACKER_LOST)
#: Faults under which no drift is learnt.
_NOT_QUIET = int(
    Status.CAMERA_FAULT | Status.IMAGE_FAULT | Status.PINS_LOST | Status.TRACKER_LOST | Status.CAMERA_MOVED
)


@cython.final
@cython.cclass
class Facts:
    """The newest frame as it was measured; a number that was not measured anew keeps its last value.

    The first two groups are what `Check.measure` may name; the rest only stands in the reasons for the log.
    """

    def __init__(self, **known: object) -> None:
        self.level = NAN  # mean grey level, of full scale
        self.level_rel = NAN  # of the rest frame's
        self.newly_saturated = NAN  # of the pixels that were not saturated at rest
        self.sharpness = NAN  # of the rest frame's
        self.far_share = NAN  # of the pins that have moved beyond the load limit
        self.off_pitches = NAN  # of all pins from the rest frame
        self.drifted_share = NAN  # of the pins whose drift is at its limit

        self.black = False  # the camera says so
        self.camera_lost = self.camera_stalled = self.clock_stepped = False
        self.failed = False  # the image could not be computed
        self.unidentified = self.pins_missing = False

        self.rest_level, self.rest_saturated = 0.0, 0.0
        self.saturated = self.clock_jump_s = self.off_px = self.limit_px = NAN
        self.far_n, self.camera, self.failure, self.why_missing = 0, "", "", ""
        for name, value in known.items():
            setattr(self, name, value)

    def __getitem__(self, name: str) -> object:
        return getattr(self, name)  # for reasons, which are formatted with what they name

    def see(self, frame: Frame) -> None:
        self.level, self.saturated = level_of(frame.image, frame.bits)
        below = 1.0 - self.rest_saturated  # bright skin round dark pins may be saturated
        self.level_rel = self.level / self.rest_level if self.rest_level != 0.0 else NAN
        self.newly_saturated = (self.saturated - self.rest_saturated) / below if below != 0.0 else NAN

    def reached(self, limits: Sequence[float]) -> int:
        """A bit for each of `MEASURES`, the lowest for the first: whether its limit is reached; NaN is none.

        Raises  ValueError: another number of limits
        """
        values: cython.double[14] = [
            self.level, self.level_rel, self.sharpness, self.newly_saturated, self.far_share,
            self.off_pitches, self.drifted_share, self.black, self.camera_lost, self.camera_stalled,
            self.clock_stepped, self.unidentified, self.failed, self.pins_missing,
        ]  # fmt: skip
        bits: cython.int = 0
        if len(limits) != _MEASURES_N:
            raise ValueError(f"{_MEASURES_N} limits are wanted, not {len(limits)}")
        for i in range(_MEASURES_N):
            limit: cython.double = limits[i]
            if values[i] <= limit if i < _BELOW_N else values[i] >= limit:
                bits |= 1 << i
        return bits


@cython.final
@cython.cclass
class FaultDetector:
    """Checks one finger's frames and their results, and reports to the registry."""

    def __init__(
        self,
        source: FrameSource,
        registry: FaultRegistry,
        clock_ns: Callable[[], int],
        load_pitches: float = RUNTIME.load_pitches,
    ) -> None:
        self._source, self._registry, self._clock_ns = source, registry, clock_ns
        self._live = source if isinstance(source, ThreadedSource) else None
        self._is_live, self._load_pitches = source.live, load_pitches
        self.without_values, self._calibrated = Counter[str](), False
        self._pins: PinVisibility = None  # type: ignore[assignment]  # `learn` comes before `judge`
        checks = fault_checks()
        self._verdict, self._limits_n = Judge(checks, registry), -1
        self._limits: list[float] = []
        self._reached = self._reported_n = -1
        spoilt = {check.measure for check in checks if check.code in (F.IMAGE_DARK, F.IMAGE_BRIGHT)}
        self._spoilt = sum(1 << MEASURES.index(measure) for measure in spoilt)
        self._facts, self._image, self._condition = Facts(), ImageQuality(), ""
        self._motion_px: Array = np.empty((0, 2))  # of the last frame that gave it
        self._offset_px: Array | float = 0.0  # (2,), by which the camera moved, as last known; 0: it did not
        self.last: tuple[Frame, int] | None = None
        self.frozen = self._repeated = self.after_gap = self._is_due = False
        self.gaps_n = self._skipped_n = self._capture_ns = self._sequence = self._begun_ns = 0
        self._due_ns, self._period_ns = -1, round(RUNTIME.check_s * 1e9)
        self._least_age_ns, self._gap_ns = 0.0, stalled_after_s(None) * 1e9  # no camera's is shorter

    @property
    def quiet(self) -> bool:
        """Whether drift may be learnt: no gap before this frame, and no fault that would spoil it."""
        return not (self.after_gap or self._registry.status & _NOT_QUIET)

    def learn(self, rest: Rest, frame: Frame, calibrated: bool) -> None:
        """Take `rest`, seen in `frame`, as the untouched tip from now on."""
        facts, self._pins, pitch_px = self._facts, PinVisibility(rest), rest.pattern.pitch_px
        self._pitch_px, self._far_px = pitch_px, self._load_pitches * pitch_px
        self._least_px = (1.0 - RUNTIME.hysteresis_rel) * RUNTIME.still_pitches * pitch_px
        self._limit_px, self._enough_n = RUNTIME.still_pitches * pitch_px, (1.0 - ASTRAY_REL) * len(rest)
        self._motion_px, self._offset_px = np.zeros_like(rest.xy_img), 0.0
        self._n, self._calm_n, self._baseline_px = len(rest), 0, self._pins.baseline_px
        self._near_px = RUNTIME.load_pitches * pitch_px  # drift moves no pin by as much
        self._image.learn(rest, frame)
        self._due_ns = -1  # at once
        facts.rest_level, facts.rest_saturated = level_of(frame.image, frame.bits)
        facts.unidentified = facts.failed = facts.pins_missing = False
        facts.off_pitches = facts.drifted_share = NAN
        self._calibrated = calibrated
        for code in _OF_THE_REST:
            self._registry.report(code, False)
        self._registry.report(F.CALIBRATION_MISSING, not calibrated, NO_CALIBRATION)

    def camera(self) -> None:
        """Report the condition that the source gives for its camera, when no frame is judged."""
        condition = self._condition_now()
        message = f"{self._source.name}: {condition}"
        self._registry.report(F.CAMERA_LOST, condition == "lost", message)
        self._registry.report(F.CAMERA_STALLED, condition in _STALLED, message)

    def _condition_now(self) -> str:
        return "frozen" if self.frozen else self._live.condition if self._live else ""

    def begin(self, frame: Frame, now_ns: cython.longlong) -> None:
        """Look at a frame's time, since that decides how it is computed: clock steps, gaps in the numbers."""
        facts = self._facts
        # Check this frame rather than the camera: a newer, good image may have come meanwhile.
        condition: str = "" if self._live is None else self._live.frame_condition
        facts.failed, facts.black, self.frozen = False, condition == "black", condition == "frozen"
        self.after_gap = self._repeated and not self.frozen
        self._repeated = self.frozen
        is_first: cython.bint = self.last is None
        before_ns, begun_ns, number = self._capture_ns, self._begun_ns, self._sequence
        self.last, self._begun_ns = (frame, now_ns), now_ns
        self._capture_ns, self._sequence = frame.capture_ns, frame.sequence
        age_ns = now_ns - self._capture_ns
        self._is_due = not 0 <= self._due_ns - self._capture_ns <= self._period_ns
        if is_first:
            # On a clock of this computer no image can come before it was taken.
            self._least_age_ns = age_ns if frame.clock is Clock.DEVICE else 0.0
            return
        step_ns, passed_ns = self._capture_ns - before_ns, now_ns - begun_ns
        # A delay (a busy processor) makes images older, and no two of them change places: only an image that
        # is too young, or older than the one before it, shows a step. A recording is read at our own pace.
        stepped: cython.bint = -step_ns >= STEP_S * 1e9
        if self._is_live:
            self._least_age_ns += _DRIFT_MAX * passed_ns
            stepped = step_ns < 0 or self._least_age_ns - age_ns >= STEP_S * 1e9
        facts.clock_stepped = stepped
        facts.clock_jump_s = (step_ns - (passed_ns if self._is_live else 0)) / 1e9
        if stepped or age_ns < self._least_age_ns:
            self._least_age_ns = age_ns
        gap_ns = passed_ns if stepped else step_ns
        if gap_ns > self._gap_ns:
            self.after_gap |= gap_ns > stalled_after_s(self._source.rate_hz) * 1e9
        if self._sequence > number:
            self.gaps_n += self._sequence - number - 1

    def judge(self, frame: Frame, result: Result, drifted_share: cython.double) -> Result:
        """Judge a computed frame; returns what may be sent of it: all, the tracks, or not even identities."""
        facts, pins, tracks, features = self._facts, self._pins, result.tracks, result.features
        is_calm: cython.bint = features is not None and self._are_calm(tracks, features)
        if is_calm:
            self._calm_n, self._xy_img, facts.why_missing = self._calm_n + 1, tracks.xy_img, ""
        else:
            if self._calm_n > 0:
                pins.note_calm(self._xy_img, self._calm_n)
            self._calm_n, pins.baseline_px = 0, self._baseline_px
            facts.why_missing = pins.problem(tracks, features)
        facts.pins_missing = facts.why_missing != ""
        if not is_calm and features is not None and pins.impossible:
            result = replace(result, tracks=replace(tracks, confidence=0.0), cells=None, features=None)
            features = None
        facts.unidentified, facts.far_share = features is None, 0.0
        look_closer: cython.bint = True
        if features is not None:
            self._note_motion(features, drifted_share)
            look_closer = tracks.n_seen < self._enough_n or self._is_noisy(features.sigma_px)
        self.judge_image(frame, look_closer)
        blind: cython.bint = facts.unidentified or self.frozen or self._registry.status & _CAMERA_FAULT
        if blind or (facts.pins_missing and not pins.explained):
            self._count_without_values()
            nothing = Reading({}, {}, NOWHERE, calibrated=self._calibrated)
            result = replace(result, cells=None, features=None, reading=nothing)
        return result

    def _are_calm(self, tracks: Tracks, features: Features) -> bool:
        """Whether no pin is lost or as noisy, nor has moved as far, as `PinVisibility` looks for."""
        n_seen: cython.Py_ssize_t = tracks.n_seen
        sigma_max_px: cython.double = features.sigma_max_px
        longest_px: cython.double = features.longest_px
        is_noisy = sigma_max_px > _NOISE_RATIO_MAX * self._baseline_px
        return n_seen == self._n and not is_noisy and longest_px <= self._near_px

    def _is_noisy(self, sigma_px: float) -> bool:
        """Whether the pins are seen with more noise than usual, which is learnt; sigma_px: the mean."""
        baseline_px = self._baseline_px
        self._baseline_px += (sigma_px - baseline_px) / _BASELINE_N
        # A centroid's sigma is as the root of the gradient's energy.
        return sigma_px * _ROOT_HALF > baseline_px

    def _count_without_values(self) -> None:
        explains = next(filter(self._registry.holds, _BLINDING), F.PINS_LOST)
        self.without_values[explains.name] += 1

    def judge_image(self, frame: Frame, look_closer: bool = False) -> None:
        """Judge brightness; and focus, if due, or if pins are missing and brightness does not explain it."""
        self._facts.see(frame)
        if (look_closer or self._is_due) and not self._now_reached() & self._spoilt:
            self._facts.sharpness = self._image.sharpness(frame.image, self._facts.level_rel)
            self._due_ns = self._capture_ns + self._period_ns
        self._end()

    def failed(self, why: str) -> None:
        """Judge a frame that could not be computed."""
        self._facts.failed, self._facts.failure = True, why
        self._end()
        self._count_without_values()

    def _end(self) -> None:
        """Report what holds, unless nothing has changed."""
        condition: str = self._condition_now()
        if condition != self._condition:
            facts, self._condition = self._facts, condition
            facts.camera_lost, facts.camera_stalled = condition == "lost", condition in _STALLED
            facts.camera = f"{self._source.name}: {condition}"
        reached = self._now_reached()
        if reached != self._reached or self._limits_n != self._reported_n:
            self._reached, self._reported_n = reached, self._limits_n
            self._verdict.report(reached, self._facts)

    def _now_reached(self) -> int:
        """What the facts reach of the present limits, which depend on the faults that hold."""
        changes_n: cython.longlong = self._registry.changes_n
        if changes_n != self._limits_n:
            self._limits, self._limits_n = self._verdict.limits(), changes_n
        return self._facts.reached(self._limits)

    def slow(self, begun_ns: int | None) -> None:
        """Whether the current frame takes long, and the brightness of the next one. For another thread.

        begun_ns  when work on it began, our clock; None: there is none, or it need not be timed
        """
        if begun_ns is not None and self._clock_ns() - begun_ns >= RUNTIME.wait_s * 1e9:
            self._registry.report(F.TRACKER_LOST, True, "the pins are being searched for")
            waiting = self._live.peek() if self._live is not None else None
            if waiting is not None:  # report its brightness without waiting for the search
                facts = Facts(rest_level=self._facts.rest_level, rest_saturated=self._facts.rest_saturated)
                facts.see(waiting)
                for code, check in self._verdict.first(facts.reached(self._verdict.limits())).items():
                    self._registry.report(code, True, check.reason.format_map(facts))

    def _note_motion(self, features: Features, drifted_share: float) -> None:
        """Whether pins moved beyond the load limit, and the camera from where it was at the rest frame.

        An untouched tip shows by the places of its pins whether the camera moved; under a touch, the step
        common to all pins shows a knock.
        """
        facts = self._facts
        in_contact: cython.bint = features.in_contact
        before_px, self._motion_px = self._motion_px, features.displacement_px
        far_n: cython.int = 0
        middle_px: cython.double = 0.0  # which is not looked for where no pin has moved by enough
        longest_px: cython.double = features.longest_px
        most_px: cython.double = features.step_px if in_contact else longest_px
        if longest_px > self._far_px or most_px >= self._least_px:
            far_n = np.count_nonzero(np.hypot(*self._motion_px.T) > self._far_px)
            moved_px = self._motion_px - before_px if in_contact else self._motion_px
            length_px = np.hypot(*moved_px.T)
            length_px = length_px[np.isfinite(length_px)]  # none: no pin was seen in the frame before, too
            middle_px = float(np.median(length_px)) if len(length_px) else 0.0
        if in_contact:
            facts.limit_px, facts.far_n = self._far_px, far_n  # a lost pin does not count
            facts.far_share = cython.cast(cython.double, far_n) / len(before_px)
            common_px = common_step_px(self._motion_px - before_px) if middle_px >= self._limit_px else None
            if common_px is None:
                return
            self._offset_px = self._offset_px + common_px
            facts.off_px, drifted_share = float(np.hypot(*self._offset_px)), 0.0
        else:
            facts.off_px = middle_px
            off = middle_px > self._limit_px or self._registry.status & _CAMERA_MOVED
            self._offset_px = np.nanmedian(self._motion_px, axis=0) if off else 0.0
        facts.off_pitches, facts.drifted_share = facts.off_px / self._pitch_px, drifted_share

    def status(self, result: Result | None, skipped_n: int) -> int:
        """The sample's status bits; skipped_n: frames lost so far, for any reason."""
        status = self._registry.status
        if result is not None:
            if self.frozen:
                status |= _CAMERA_FAULT
            if result.features is not None and result.features.in_contact:
                status |= _TOUCHED
        if not self._source.live or (self._live is not None and self._live.recorded):
            status |= _NOT_LIVE
        if skipped_n != self._skipped_n:
            self._skipped_n = skipped_n
            status |= _FRAMES_DROPPED
        return status


def common_step_px(step_px: Array) -> Array | None:
    """The step (2,) of all pins from one frame to the next, as of a knock; None: they did not move alike."""
    common: Array = np.nanmedian(step_px, axis=0)
    off_px = np.hypot(*(step_px - common).T)
    alike = np.nanquantile(off_px, RUNTIME.most_rel) < HALF_REL * np.hypot(*common)
    return common if alike else None
