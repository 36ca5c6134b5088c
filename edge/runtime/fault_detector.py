"""Which faults hold, from what the loop sees: camera, order of images, picture, pins, load, place.

`image_quality` measures a single image or set of pins; this module turns that into faults and status bits.
Every check is one method, runs on every frame, and reports to the `FaultRegistry` each time: the line that
raises a fault also clears it. The message is composed only when a fault appears.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from edge.pipeline import Result
from edge.runtime.fault_registry import FaultRegistry
from edge.runtime.image_quality import ImageQuality, common_step_px, median_offset_px
from edge.runtime.measures import count_longer
from edge.runtime.pin_visibility import PinVisibility
from edge.types import Array, Features, Frame, FrameSource, LiveSource, Rest, Tracks
from hostlink.wire import FaultCode, Status

__all__ = ["LOAD_PITCHES", "NO_CALIBRATION", "SEARCH_NS", "FaultDetector"]

#: A frame that takes longer is one whose pins are being searched for; TRACKER_LOST is reported before they
#: are found.
SEARCH_NS = 30_000_000
#: The capture clock may differ from ours by this much from one image to the next; more is a step. A process
#: that was not scheduled for a while shows less.
STEP_NS = 500_000_000
#: After this long without a new image, and this many of the camera's periods, the motion of the pins is
#: unknown: they are searched for as from rest. When they were followed over 1500 simulated gaps of up to 3 s,
#: some were wrong in 6, with high confidence (0.4..0.6 mm); when searched, in none, and no frame was without
#: values.
GAP_S, GAP_PERIODS = 0.1, 4.0
#: If untouched pins are further off than this, in pitches, the camera moved; within half of it the fault
#: clears. 1.5 px at a pitch of 19 px: five times the largest drift.
MOVED_PITCHES = 0.08
#: If 5 % of a tip's pins move further than this, in pitches, the load is beyond what the tip stands. Within
#: the published range of the 331-pin tip (5 mm deep, 5 mm of shear) they move by up to 1.3.
LOAD_PITCHES = 1.6
OVERLOAD_SHARE = 0.05
NO_CALIBRATION = "no calibration file was given"
_CAMERA = {
    "lost": FaultCode.CAMERA_LOST,
    "stalled": FaultCode.CAMERA_STALLED,
    "frozen": FaultCode.CAMERA_STALLED,
    "black": FaultCode.IMAGE_DARK,
}
#: Faults that a new rest frame clears.
_OF_THE_REST = (
    FaultCode.TARE_IMPLAUSIBLE,
    FaultCode.CALIBRATION_FOREIGN,
    FaultCode.CAMERA_MOVED,
    FaultCode.TRACKER_LOST,
    FaultCode.PINS_LOST,
)
#: Faults under which no drift is learnt.
_NOT_QUIET = (
    Status.CAMERA_FAULT | Status.IMAGE_FAULT | Status.PINS_LOST | Status.TRACKER_LOST | Status.CAMERA_MOVED
)


class FaultDetector:
    """Checks one finger's frames and their results.

    source        reports the condition of its camera
    registry      receives the faults
    load_pitches  motion of the pins beyond which the tip is overloaded
    clock_ns      the host's monotonic clock
    """

    def __init__(
        self,
        source: FrameSource,
        registry: FaultRegistry,
        load_pitches: float,
        clock_ns: Callable[[], int],
    ) -> None:
        self._source, self._registry, self._clock_ns = source, registry, clock_ns
        self._live = source if isinstance(source, LiveSource) else None
        self._load_pitches = load_pitches
        self._image = ImageQuality()
        self._pins: PinVisibility | None = None
        self._pitch_px = 0.0
        self._motion_px: Array = np.empty((0, 2))  # of the last frame that gave it
        self._offset_px: Array = np.zeros(2)  # by which the camera moved, as last known
        self._skipped_n = 0
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
        """Whether drift may be learnt: no fault that would spoil it."""
        return not self._registry.status & _NOT_QUIET

    def learn(self, rest: Rest, frame: Frame, calibrated: bool) -> None:
        """Take `rest`, seen in `frame`, as the untouched tip from now on."""
        self._pins = PinVisibility(rest)
        self._pitch_px = rest.pattern.pitch_px
        self._motion_px, self._offset_px = np.zeros_like(rest.xy_img), np.zeros(2)
        self._image.learn(rest, frame)
        for code in _OF_THE_REST:
            self._registry.report(code, False)
        self._registry.report(FaultCode.CALIBRATION_MISSING, not calibrated, NO_CALIBRATION)

    def camera(self) -> None:
        """Report the condition that the source gives for its camera."""
        condition = "frozen" if self.frozen else self._live.condition if self._live else ""
        now = _CAMERA.get(condition)
        for code in (FaultCode.CAMERA_LOST, FaultCode.CAMERA_STALLED):
            self._registry.report(code, code is now, lambda: f"{self._source.name}: {condition}")

    def order(self, frame: Frame, now_ns: int) -> None:
        """Clock steps, and gaps in the camera's numbering (`gaps_n`)."""
        # Check this frame rather than the camera: a newer, good image may have come meanwhile.
        self.frozen = self._live is not None and self._live.frame_condition == "frozen"
        self.after_gap = self._repeated and not self.frozen
        self._repeated = self.frozen
        last, self.last = self.last, (frame, now_ns)
        if last is None:
            return
        before, before_ns = last
        step_ns = frame.capture_ns - before.capture_ns
        # A recording is read at our own pace: only a step back counts.
        live = self._source.live
        off_ns = step_ns - (now_ns - before_ns) if live else min(step_ns, 0)
        stepped = abs(off_ns) > STEP_NS or (live and step_ns < 0)
        self._registry.report(
            FaultCode.CLOCK_STEP, stepped, lambda: f"images' clock jumped by {off_ns / 1e9:+.3f} s"
        )
        period_s = 1.0 / self._source.rate_hz if self._source.rate_hz else 0.0
        passed_ns = now_ns - before_ns if stepped else step_ns
        self.after_gap |= passed_ns > max(GAP_S, GAP_PERIODS * period_s) * 1e9
        self.gaps_n += max(0, frame.sequence - before.sequence - 1)

    def image(self, frame: Frame) -> None:
        """Brightness and focus."""
        quality, registry = self._image, self._registry
        quality.check(frame)
        black = self._live is not None and self._live.frame_condition == "black"
        registry.report(FaultCode.IMAGE_DARK, black or bool(quality.dark), quality.dark or "black")
        registry.report(FaultCode.IMAGE_BRIGHT, bool(quality.bright), quality.bright)
        registry.report(FaultCode.IMAGE_BLURRED, bool(quality.blurred), quality.blurred)

    def slow(self, begun_ns: int | None) -> None:
        """Whether the current frame takes long, and the brightness of the next one. For another thread.

        begun_ns  when work on it began, our clock; None: there is none, or it need not be timed
        """
        if begun_ns is not None and self._clock_ns() - begun_ns >= SEARCH_NS:
            self._registry.report(FaultCode.TRACKER_LOST, True, "the pins are being searched for")
            waiting = self._live.peek() if self._live is not None else None
            if waiting is not None:  # report its brightness without waiting for the search
                dark, bright = self._image.brightness_problems(waiting)
                for code, reason in ((FaultCode.IMAGE_DARK, dark), (FaultCode.IMAGE_BRIGHT, bright)):
                    if reason:
                        self._registry.report(code, True, reason)

    def impossible(self, tracks: Tracks) -> bool:
        """Whether pins moved further than skin can: the pattern was matched to itself rotated."""
        assert self._pins is not None
        return self._pins.impossible(tracks)

    def pins(self, frame: Frame, tracks: Tracks, features: Features | None) -> bool:
        """Whether pins are seen and identified. False: no values may be sent for this frame."""
        assert self._pins is not None
        untrusted = features is None
        self._registry.report(FaultCode.TRACKER_LOST, untrusted, "pins cannot be identified")
        missing = self._pins.problem(tracks)
        self._registry.report(FaultCode.PINS_LOST, bool(missing), missing)
        if untrusted or self._pins.needs_focus_check(tracks):
            self._image.check_focus(frame)
            blurred = self._image.blurred
            self._registry.report(FaultCode.IMAGE_BLURRED, bool(blurred), blurred)
        return not (untrusted or missing)

    def load(self, features: Features | None) -> None:
        """Whether the pins moved beyond the load limit."""
        if features is None or not features.in_contact:
            self._registry.report(FaultCode.OVERLOAD, False)
            return
        limit_px = self._load_pitches * self._pitch_px
        motion_px = features.displacement_px
        far_n = count_longer(motion_px, limit_px)  # a lost pin does not count
        over = far_n > OVERLOAD_SHARE * len(motion_px)
        self._registry.report(
            FaultCode.OVERLOAD, over, lambda: f"{far_n} pins moved by more than {limit_px:.0f} px"
        )

    def place(self, motion_px: Array, in_contact: bool, drifted: bool) -> None:
        """Whether the camera is where it was when the rest frame was taken.

        An untouched tip shows that by the places of its pins; under a touch, the step common to all pins
        shows a knock.

        motion_px  (n, 2) since rest; NaN where lost
        drifted    the learnt drift is at its limit
        """
        before_px, self._motion_px = self._motion_px, motion_px
        held = Status.CAMERA_MOVED in self._registry.status
        limit_px = MOVED_PITCHES * self._pitch_px
        if in_contact:
            step_px = common_step_px(motion_px - before_px, limit_px)
            if step_px is None:
                return
            self._offset_px = self._offset_px + step_px
            by_px, drifted = float(np.hypot(*self._offset_px)), False
        else:
            by_px = median_offset_px(motion_px)
            off = held or by_px > limit_px
            self._offset_px = np.nanmedian(motion_px, axis=0) if off else np.zeros(2)
        self._registry.report(
            FaultCode.CAMERA_MOVED,
            by_px > limit_px * (0.5 if held else 1.0) or drifted,
            lambda: f"the pins stand {by_px:.1f} px off the rest frame, all alike; tare",
        )

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
