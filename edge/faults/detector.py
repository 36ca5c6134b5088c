"""Which faults hold, from what the loop sees: camera, order of images, picture, pins, load, place.

`image_quality` measures a single image or set of pins; this module turns that into faults and status bits.
Every check is one method, runs on every frame, and reports to the `FaultRegistry` each time: the line that
raises a fault also clears it. The message is composed only when a fault appears.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from edge.faults.frame_counts import count_longer
from edge.faults.image_quality import ImageQuality, common_step_px, image_checks, median_offset_px
from edge.faults.judge import Check, run_checks
from edge.faults.pin_visibility import PinVisibility
from edge.faults.registry import FaultRegistry
from edge.params import PARAMS as RUNTIME
from edge.pipeline import Result
from edge.sources.live import stalled_after_s
from edge.types import Array, Clock, Features, Frame, FrameSource, LiveSource, Rest, Tracks
from hostlink.clock import DRIFT_MAX
from hostlink.wire import FaultCode as F
from hostlink.wire import Status

__all__ = ["NO_CALIBRATION", "FaultDetector", "FaultParams"]


@dataclass(frozen=True, slots=True)
class FaultParams:
    """Parameters by name; evidence in docs/tuning.md."""

    search_s: float = RUNTIME.wait_s  # a frame that takes longer is one whose pins are being searched for
    clock_step_s: float = 0.5  # by which the capture clock is further ahead of ours than it ever was
    moved_pitches: float = RUNTIME.still_pitches  # if all pins are off by more, the camera moved
    load_pitches: float = RUNTIME.load_pitches  # motion of a pin beyond which it counts as overloaded
    astray_rel: float = RUNTIME.astray_rel  # share of such pins, or of those whose drift is at its limit


PARAMS = FaultParams()
NO_CALIBRATION = "no calibration file was given"


def fault_checks(p: FaultParams = PARAMS) -> tuple[Check, ...]:
    """Of the images' clock, of load and of place."""
    moved = "the pins stand {off_px:.1f} px off the rest frame, all alike; tare"
    return (
        Check(
            F.CLOCK_STEP, "clock_off_s", p.clock_step_s, "s",
            "images' clock jumped by {clock_jump_s:+.3f} s",
        ),
        Check(F.CLOCK_STEP, "clock_back_s", 1e-9, "s", "images' clock jumped by {clock_jump_s:+.3f} s"),
        Check(
            F.OVERLOAD, "far_share", p.astray_rel, "of the pins",
            "{far_n} pins moved by more than {limit_px:.0f} px",
        ),
        Check(
            F.CAMERA_MOVED, "off_pitches", p.moved_pitches, "pitches", moved
        ),
        Check(F.CAMERA_MOVED, "drifted_share", p.astray_rel, "of the pins", moved),
    )  # fmt: skip


_CAMERA = {
    "lost": F.CAMERA_LOST,
    "stalled": F.CAMERA_STALLED,
    "frozen": F.CAMERA_STALLED,
    "black": F.IMAGE_DARK,
}
#: Faults that a new rest frame clears.
_OF_THE_REST = (
    F.TARE_IMPLAUSIBLE,
    F.CALIBRATION_FOREIGN,
    F.CAMERA_MOVED,
    F.TRACKER_LOST,
    F.PINS_LOST,
)
#: Faults under which no drift is learnt.
_NOT_QUIET = (
    Status.CAMERA_FAULT | Status.IMAGE_FAULT | Status.PINS_LOST | Status.TRACKER_LOST | Status.CAMERA_MOVED
)


class FaultDetector:
    """Checks one finger's frames and their results.

    source        reports the condition of its camera
    registry      receives the faults
    clock_ns      the host's monotonic clock
    """

    def __init__(
        self,
        source: FrameSource,
        registry: FaultRegistry,
        clock_ns: Callable[[], int],
        params: FaultParams = PARAMS,
    ) -> None:
        self._source, self._registry, self._clock_ns = source, registry, clock_ns
        self._live = source if isinstance(source, LiveSource) else None
        self._params = params
        self._checks = (*image_checks(), *fault_checks(params))
        self._image = ImageQuality()
        self._pins: PinVisibility | None = None
        self._pitch_px = 0.0
        self._motion_px: Array = np.empty((0, 2))  # of the last frame that gave it
        self._offset_px: Array = np.zeros(2)  # by which the camera moved, as last known
        self._skipped_n = 0
        self._least_age_ns = 0.0  # of an image when work on it begins, since the capture clock last stepped
        self.gaps_n = 0  # in the frames' numbers, since the start
        self.last: tuple[Frame, int] | None = None  # the newest, and when work on it began, our clock
        self.frozen = False  # the current frame repeats an earlier one
        self._repeated = False  # the frame before it did too
        self.after_gap = False  # too long after the frame before it to follow the pins from there

    @property
    def blind(self) -> bool:
        """Whether the camera gives no images, or none that may be used."""
        return self.frozen or Status.CAMERA_FAULT in self._registry.status

    @property
    def quiet(self) -> bool:
        """Whether drift may be learnt: no gap before this frame, and no fault that would spoil it."""
        return not (self.after_gap or self._registry.status & _NOT_QUIET)

    def learn(self, rest: Rest, frame: Frame, calibrated: bool) -> None:
        """Take `rest`, seen in `frame`, as the untouched tip from now on."""
        self._pins = PinVisibility(rest)
        self._pitch_px = rest.pattern.pitch_px
        self._motion_px, self._offset_px = np.zeros_like(rest.xy_img), np.zeros(2)
        self._image.learn(rest, frame)
        for code in _OF_THE_REST:
            self._registry.report(code, False)
        self._registry.report(F.CALIBRATION_MISSING, not calibrated, NO_CALIBRATION)

    def camera(self) -> None:
        """Report the condition that the source gives for its camera."""
        condition = "frozen" if self.frozen else self._live.condition if self._live else ""
        now = _CAMERA.get(condition)
        for code in (F.CAMERA_LOST, F.CAMERA_STALLED):
            self._registry.report(code, code is now, lambda: f"{self._source.name}: {condition}")

    def order(self, frame: Frame, now_ns: int) -> None:
        """Clock steps, and gaps in the camera's numbering (`gaps_n`)."""
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
        back_ns = max(0, -step_ns)
        if live := self._source.live:
            self._least_age_ns += DRIFT_MAX * passed_ns
        ahead_ns = max(0.0, self._least_age_ns - age_ns) if live else float(back_ns)
        self._check(
            clock_off_s=ahead_ns / 1e9,
            clock_back_s=back_ns / 1e9 if live else 0.0,
            clock_jump_s=(step_ns - (passed_ns if live else 0)) / 1e9,
        )
        stepped = self._registry.holds(F.CLOCK_STEP)
        self._least_age_ns = float(age_ns) if stepped else min(self._least_age_ns, age_ns)
        gap_ns = passed_ns if stepped else step_ns
        self.after_gap |= gap_ns > stalled_after_s(self._source.rate_hz) * 1e9
        self.gaps_n += max(0, frame.sequence - before.sequence - 1)

    def image(self, frame: Frame) -> None:
        """Brightness and focus."""
        black = self._live is not None and self._live.frame_condition == "black"
        self._check(**self._image.brightness(frame), black=float(black))
        self._check_focus(frame)

    def _check_focus(self, frame: Frame, now: bool = False) -> None:
        """Nothing is said of the focus where brightness explains what is seen."""
        if not (self._registry.holds(F.IMAGE_DARK) or self._registry.holds(F.IMAGE_BRIGHT)):
            self._image.measure_focus(frame, now)
        self._check(sharpness=self._image.sharpness)

    def _check(self, **measured: float) -> None:
        run_checks(self._checks, measured, self._registry)

    def slow(self, begun_ns: int | None) -> None:
        """Whether the current frame takes long, and the brightness of the next one. For another thread.

        begun_ns  when work on it began, our clock; None: there is none, or it need not be timed
        """
        if begun_ns is not None and self._clock_ns() - begun_ns >= self._params.search_s * 1e9:
            self._registry.report(F.TRACKER_LOST, True, "the pins are being searched for")
            waiting = self._live.peek() if self._live is not None else None
            if waiting is not None:  # report its brightness without waiting for the search
                run_checks(self._checks, self._image.brightness(waiting), self._registry, clear=False)

    def impossible(self, tracks: Tracks) -> bool:
        """Whether pins moved further than skin can: the pattern was matched to itself rotated."""
        assert self._pins is not None
        return self._pins.impossible(tracks)

    def pins(self, frame: Frame, tracks: Tracks, features: Features | None) -> bool:
        """Whether pins are seen and identified. False: no values may be sent for this frame."""
        assert self._pins is not None
        untrusted = features is None
        self._registry.report(F.TRACKER_LOST, untrusted, "pins cannot be identified")
        missing = self._pins.problem(tracks)
        self._registry.report(F.PINS_LOST, bool(missing), missing)
        if untrusted or self._pins.needs_focus_check(tracks):
            self._check_focus(frame, now=True)
        return not (untrusted or missing)

    def load(self, features: Features | None) -> None:
        """Whether the pins moved beyond the load limit."""
        if features is None or not features.in_contact:
            self._registry.report(F.OVERLOAD, False)
            return
        limit_px = self._params.load_pitches * self._pitch_px
        far_n = count_longer(features.displacement_px, limit_px)  # a lost pin does not count
        self._check(far_share=far_n / len(features.displacement_px), far_n=far_n, limit_px=limit_px)

    def place(self, motion_px: Array, in_contact: bool, drifted_share: float) -> None:
        """Whether the camera is where it was when the rest frame was taken.

        An untouched tip shows that by the places of its pins; under a touch, the step common to all pins
        shows a knock.

        motion_px      (n, 2) since rest; NaN where lost
        drifted_share  of the pins whose learnt drift is at its limit
        """
        before_px, self._motion_px = self._motion_px, motion_px
        limit_px = self._params.moved_pitches * self._pitch_px
        if in_contact:
            step_px = common_step_px(motion_px - before_px, limit_px)
            if step_px is None:
                return
            self._offset_px = self._offset_px + step_px
            off_px, drifted_share = float(np.hypot(*self._offset_px)), 0.0
        else:
            off_px = median_offset_px(motion_px)
            off = self._registry.holds(F.CAMERA_MOVED) or off_px > limit_px
            self._offset_px = np.nanmedian(motion_px, axis=0) if off else np.zeros(2)
        self._check(off_pitches=off_px / self._pitch_px, off_px=off_px, drifted_share=drifted_share)

    def status(self, result: Result | None, skipped_n: int) -> Status:
        """The sample's status bits.

        skipped_n  frames lost so far, for any reason
        """
        status = self._registry.status
        if result is not None:
            if self.frozen:
                status |= Status.CAMERA_FAULT
            if result.features is not None and result.features.in_contact:
                status |= Status.TOUCHED
            if result.reading.saturated:
                status |= Status.SATURATED
        if not self._source.live or (self._live is not None and self._live.recorded):
            status |= Status.NOT_LIVE
        if skipped_n != self._skipped_n:
            self._skipped_n = skipped_n
            status |= Status.FRAMES_DROPPED
        return status
