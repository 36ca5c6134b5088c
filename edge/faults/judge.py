"""The table of faults that follow from measured numbers (`Facts`), and one walk over it a frame (`Judge`)."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import nan
from typing import Any

from edge.faults.image_quality import HALF_REL, ONE_LEVEL
from edge.faults.registry import FaultRegistry
from edge.params import ASTRAY_REL, PARAMS
from edge.pins.params import PARAMS as PINS
from hostlink.wire import FaultCode

F = FaultCode
NO_CALIBRATION = "values are in px; to get mm and N, calibrate (docs/from-camera-to-newtons.md)"
_MOVED = "the pins stand {off_px:.1f} px off the rest frame, all alike; tare"
#: What a check may measure: numbers whose limits are reached from above, others, and answers.
BELOW = ("level", "level_rel", "sharpness")
MEASURES = (
    *BELOW, "newly_saturated", "far_share", "off_pitches", "drifted_share", "black", "camera_lost",
    "camera_stalled", "clock_stepped", "unidentified", "failed", "pins_missing",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Check:
    """One row: the fault holds while the answer is yes; or it appears when the number reaches `raise_at`, and
    clears when it is away from it by the share of `raise_at` that all checks have in common. Rows of the same
    fault are alternatives: it holds while one of them does. NaN reaches no limit.
    """

    code: FaultCode
    measure: str  # name of the answer or the number, a field of `Facts`
    reason: str  # for the log; a format of the fields of `Facts`
    raise_at: float = 0.5  # of an answer, 1 or 0

    def limit(self, holds: bool) -> float:
        """The level that a number has to reach for the fault to appear, or to go on."""
        away = PARAMS.hysteresis_rel * self.raise_at if holds else 0.0
        return self.raise_at + (away if self.measure in BELOW else -away)


def fault_checks() -> tuple[Check, ...]:
    """All that is judged once a frame."""
    dark = "mean level {level:.1%} of full scale, {rest_level:.1%} at rest"
    return (
        Check(F.CAMERA_LOST, "camera_lost", "{camera}"),
        Check(F.CAMERA_STALLED, "camera_stalled", "{camera}"),
        Check(F.IMAGE_DARK, "level", dark, ONE_LEVEL),
        Check(F.IMAGE_DARK, "level_rel", dark, PINS.pin_share_min),
        Check(F.IMAGE_DARK, "black", "black"),
        Check(
            F.IMAGE_BRIGHT, "newly_saturated", "{saturated:.0%} of the image is at full scale", 1.0 - HALF_REL
        ),
        Check(F.IMAGE_BLURRED, "sharpness", "sharpness {sharpness:.0%} of that at rest", HALF_REL),
        Check(F.CLOCK_STEP, "clock_stepped", "images' clock jumped by {clock_jump_s:+.3f} s"),
        Check(F.TRACKER_LOST, "failed", "image cannot be measured: {failure}"),
        Check(F.TRACKER_LOST, "unidentified", "pins cannot be identified"),
        Check(F.PINS_LOST, "pins_missing", "{why_missing}"),
        Check(F.OVERLOAD, "far_share", "{far_n} pins moved by more than {limit_px:.0f} px", ASTRAY_REL),
        Check(F.CAMERA_MOVED, "off_pitches", _MOVED, PARAMS.still_pitches),
        Check(F.CAMERA_MOVED, "drifted_share", _MOVED, ASTRAY_REL),
    )


class Judge:
    """Reports to the registry which faults of the checks hold."""

    def __init__(self, checks: Sequence[Check], registry: FaultRegistry) -> None:
        self._registry, self._checks = registry, checks
        self._places = [MEASURES.index(check.measure) for check in checks]
        self._codes = list(dict.fromkeys(check.code for check in checks))

    def limits(self) -> list[float]:
        """What each of `MEASURES` has to reach now; NaN: it is not judged. For any thread."""
        limits = [nan] * len(MEASURES)
        for place, check in zip(self._places, self._checks, strict=True):
            limits[place] = check.limit(self._registry.holds(check.code))
        return limits

    def first(self, reached: int) -> dict[FaultCode, Check]:
        """Each fault of which a limit is reached, with the first row that says so; a bit a measure."""
        places = zip(self._places, self._checks, strict=True)
        return {check.code: check for place, check in reversed([*places]) if reached >> place & 1}

    def report(self, reached: int, facts: Any) -> None:
        """Report these faults, and that no other holds; facts by name, for the reasons."""
        first = self.first(reached)
        for code in self._codes:
            check = first.get(code)
            reason = partial(check.reason.format_map, facts) if check else ""
            self._registry.report(code, check is not None, reason)
