"""Which faults hold, from what the loop sees: camera, order of images, picture, pins, load, place.

`begin` looks at a frame's time before it is computed, since that decides how; `judge` does all else after it.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np

from edge.faults.image_quality import HALF_REL, ONE_LEVEL, ImageQuality
from edge.faults.judge import Check, Facts, Judge
from edge.faults.pin_visibility import PinVisibility
from edge.faults.registry import FaultRegistry
from edge.params import ASTRAY_REL
from edge.params import PARAMS as RUNTIME
from edge.pins.params import PARAMS as PINS
from edge.sources.live import ThreadedSource, stalled_after_s
from edge.types import NOWHERE, Array, Clock, Features, Frame, FrameSource, Reading, Rest, Result
from hostlink.order_and_time import DRIFT_MAX
from hostlink.wire import FaultCode as F
from hostlink.wire import Status

STEP_S = 0.5  # by which an image comes too early where its clock was set, and not late before
NO_CALIBRATION = "values are in px; to get mm and N, calibrate (docs/from-camera-to-newtons.md)"
_MOVED = "the pins stand {off_px:.1f} px off the rest frame, all alike; tare"


def fault_checks() -> tuple[Check, ...]:
    """All that is judged once a frame."""
    dark = "mean level {level:.1%} of full scale, {rest_level:.1%} at rest"
    return (
        Check(F.CAMERA_LOST, "camera_lost", "{camera}"),
        Check(F.CAMERA_STALLED, "camera_stalled", "{camera}"),
        Check(F.IMAGE_DARK, "level", dark, ONE_LEVEL, "full scale", below=True),
        Check(F.IMAGE_DARK, "level_rel", dark, PINS.pin_share_min, "rest level", below=True),
        Check(F.IMAGE_DARK, "black", "black"),
        Check(
            F.IMAGE_BRIGHT, "newly_saturated", "{saturated:.0%} of the image is at full scale",
            1.0 - HALF_REL, "of the others",
        ),
        Check(
            F.IMAGE_BLURRED, "sharpness", "sharpness {sharpness:.0%} of that at rest",
            HALF_REL, "that at rest", below=True,
        ),
        Check(F.CLOCK_STEP, "clock_stepped", "images' clock jumped by {clock_jump_s:+.3f} s"),
        Check(F.TRACKER_LOST, "failed", "image cannot be measured: {failure}"),
        Check(F.TRACKER_LOST, "unidentified", "pins cannot be identified"),
        Check(F.PINS_LOST, "pins_missing", "{why_missing}"),
        Check(
            F.OVERLOAD, "far_share", "{far_n} pins moved by more than {limit_px:.0f} px",
            ASTRAY_REL, "of the pins",
        ),
        Check(F.CAMERA_MOVED, "off_pitches", _MOVED, RUNTIME.still_pitches, "pitches"),
        Check(F.CAMERA_MOVED, "drifted_share", _MOVED, ASTRAY_REL, "of the pins"),
    )  # fmt: skip


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
_DARK_OR_BRIGHT = {F.IMAGE_DARK, F.IMAGE_BRIGHT}


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
        self._load_pitches = load_pitches
        self._facts = Facts()
        self.without_values: Counter[str] = Counter()  # images that gave none, by the fault that explains it
        self._gap_ns = stalled_after_s(None) * 1e9  # no camera's is shorter
        self._calibrated = False
        self._verdict = Judge(fault_checks(), registry)
        self._image = ImageQuality()
        self._pins: PinVisibility | None = None
        self._pitch_px = 0.0
        self._motion_px: Array = np.empty((0, 2))  # of the last frame that gave it
        self._offset_px: Array | float = 0.0  # (2,), by which the camera moved, as last known; 0: it did not
        self._skipped_n = 0
        self._least_age_ns = 0.0  # of an image when work on it begins, since the capture clock last stepped
        self.gaps_n = 0  # in the frames' numbers, since the start
        self.last: tuple[Frame, int] | None = None  # the newest, and when work on it began, our clock
        self.frozen = False  # the current frame repeats an earlier one
        self._repeated = False  # the frame before it did too
        self.after_gap = False  # too long after the frame before it to follow the pins from there

    @property
    def quiet(self) -> bool:
        """Whether drift may be learnt: no gap before this frame, and no fault that would spoil it."""
        return not (self.after_gap or self._registry.status & _NOT_QUIET)

    def learn(self, rest: Rest, frame: Frame, calibrated: bool) -> None:
        """Take `rest`, seen in `frame`, as the untouched tip from now on."""
        self._pins = PinVisibility(rest)
        self._pitch_px = rest.pattern.pitch_px
        self._motion_px, self._offset_px = np.zeros_like(rest.xy_img), 0.0
        self._image.learn(rest, frame)
        self._facts.forget_pins()
        self._calibrated = calibrated
        for code in _OF_THE_REST:
            self._registry.report(code, False)
        self._registry.report(F.CALIBRATION_MISSING, not calibrated, NO_CALIBRATION)

    def camera(self) -> None:
        """Report the condition that the source gives for its camera, when no frame is judged."""
        condition = self._condition()
        message = f"{self._source.name}: {condition}"
        self._registry.report(F.CAMERA_LOST, condition == "lost", message)
        self._registry.report(F.CAMERA_STALLED, condition in _STALLED, message)

    def _condition(self) -> str:
        return "frozen" if self.frozen else self._live.condition if self._live else ""

    def begin(self, frame: Frame, now_ns: int) -> None:
        """Look at a frame's time: clock steps, and gaps in the camera's numbering (`gaps_n`)."""
        # Check this frame rather than the camera: a newer, good image may have come meanwhile.
        self.frozen = self._live is not None and self._live.frame_condition == "frozen"
        self.after_gap = self._repeated and not self.frozen
        self._repeated = self.frozen
        last, self.last = self.last, (frame, now_ns)
        age_ns = now_ns - frame.capture_ns
        if last is None:
            # On a clock of this computer no image can come before it was taken.
            self._least_age_ns = float(age_ns) if frame.clock is Clock.DEVICE else 0.0
            return
        before, before_ns = last
        step_ns, passed_ns = frame.capture_ns - before.capture_ns, now_ns - before_ns
        # A delay (a busy processor) makes images older, and no two of them change places: only an image that
        # is too young, or older than the one before it, shows a step. A recording is read at our own pace.
        facts, live = self._facts, self._source.live
        if live:
            self._least_age_ns += DRIFT_MAX * passed_ns
            ahead_ns, stepped = self._least_age_ns - age_ns, step_ns < 0
        else:
            ahead_ns, stepped = -step_ns, False
        stepped |= ahead_ns >= STEP_S * 1e9
        facts.clock_stepped = stepped
        facts.clock_jump_s = (step_ns - (passed_ns if live else 0)) / 1e9
        if stepped or age_ns < self._least_age_ns:
            self._least_age_ns = float(age_ns)
        gap_ns = passed_ns if stepped else step_ns
        if gap_ns > self._gap_ns:
            self.after_gap |= gap_ns > stalled_after_s(self._source.rate_hz) * 1e9
        if frame.sequence > before.sequence:
            self.gaps_n += frame.sequence - before.sequence - 1

    def judge(self, frame: Frame, result: Result, drifted_share: float) -> Result:
        """Judge a computed frame; returns what may be sent of it: all, the tracks, or not even identities."""
        facts, pins = self._facts, self._pins
        assert pins is not None
        facts.why_missing = pins.problem(result.tracks, result.features)
        facts.pins_missing = bool(facts.why_missing)
        if pins.impossible and result.features is not None:
            result = replace(result, tracks=replace(result.tracks, confidence=0.0), cells=None, features=None)
        features = result.features
        facts.unidentified = features is None
        facts.far_share = 0.0
        if features is not None:
            self._note_motion(features, drifted_share)
        self.judge_image(frame, features is None or pins.needs_focus_check(features.sigma_px))
        blind = self.frozen or self._registry.status & _CAMERA_FAULT
        missing = facts.pins_missing and not pins.explained
        if facts.unidentified or missing or blind:
            self._count_without_values()
            nothing = Reading({}, {}, NOWHERE, calibrated=self._calibrated)
            result = replace(result, cells=None, features=None, reading=nothing)
        return result

    def _count_without_values(self) -> None:
        explains = next(filter(self._registry.holds, _BLINDING), F.PINS_LOST)
        self.without_values[explains.name] += 1

    def judge_image(self, frame: Frame, look_closer: bool = False) -> None:
        """Judge brightness; and focus, if due, or if pins are missing and brightness does not explain it."""
        facts = self._facts
        facts.failed = False
        facts.black = self._live is not None and self._live.frame_condition == "black"
        self._image.brightness(frame, facts)
        due = look_closer or self._image.focus_due(frame)
        if due and _DARK_OR_BRIGHT.isdisjoint(self._verdict.would_hold(facts)):
            self._image.measure_focus(frame, facts)
        self._end()

    def failed(self, why: str) -> None:
        """Judge a frame that could not be computed."""
        self._facts.failed, self._facts.failure = True, why
        self._end()
        self._count_without_values()

    def _end(self) -> None:
        facts, condition = self._facts, self._condition()
        facts.camera_lost, facts.camera_stalled = condition == "lost", condition in _STALLED
        if condition:
            facts.camera = f"{self._source.name}: {condition}"
        self._verdict.judge(facts)

    def slow(self, begun_ns: int | None) -> None:
        """Whether the current frame takes long, and the brightness of the next one. For another thread.

        begun_ns  when work on it began, our clock; None: there is none, or it need not be timed
        """
        if begun_ns is not None and self._clock_ns() - begun_ns >= RUNTIME.wait_s * 1e9:
            self._registry.report(F.TRACKER_LOST, True, "the pins are being searched for")
            waiting = self._live.peek() if self._live is not None else None
            if waiting is not None:  # report its brightness without waiting for the search
                facts = Facts()
                self._image.brightness(waiting, facts)
                for code, check in self._verdict.would_hold(facts).items():
                    self._registry.report(code, True, check.reason.format_map(asdict(facts)))

    def _note_motion(self, features: Features, drifted_share: float) -> None:
        """Whether pins moved beyond the load limit, and the camera from where it was at the rest frame.

        An untouched tip shows by the places of its pins whether the camera moved; under a touch, the step
        common to all pins shows a knock.
        """
        facts, in_contact = self._facts, features.in_contact
        before_px, self._motion_px = self._motion_px, features.displacement_px
        far_px, limit_px = self._load_pitches * self._pitch_px, RUNTIME.still_pitches * self._pitch_px
        least_px = limit_px * (1.0 - RUNTIME.hysteresis_rel)
        far_n, middle_px = 0, 0.0  # which is not looked for where no pin has moved by enough
        most_px = features.step_px if in_contact else features.longest_px
        if features.longest_px > far_px or most_px >= least_px:
            far_n = int(np.count_nonzero(np.hypot(*self._motion_px.T) > far_px))
            moved_px = self._motion_px - before_px if in_contact else self._motion_px
            length_px = np.hypot(*moved_px.T)
            length_px = length_px[np.isfinite(length_px)]  # none: no pin was seen in the frame before, too
            middle_px = float(np.median(length_px)) if len(length_px) else 0.0
        if in_contact:
            facts.limit_px, facts.far_n = far_px, far_n  # a lost pin does not count
            facts.far_share = far_n / len(before_px)
            common_px = common_step_px(self._motion_px - before_px) if middle_px >= limit_px else None
            if common_px is None:
                return
            self._offset_px = self._offset_px + common_px
            facts.off_px, drifted_share = float(np.hypot(*self._offset_px)), 0.0
        else:
            facts.off_px = middle_px
            off = middle_px > limit_px or self._registry.status & _CAMERA_MOVED
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
