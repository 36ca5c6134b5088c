"""The table of faults that follow from measured numbers (`Facts`), and one walk over it a frame (`Judge`)."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from math import nan
from operator import attrgetter

from edge.faults.frame_counts import which_reach
from edge.faults.registry import FaultRegistry
from edge.params import PARAMS
from hostlink.wire import FaultCode


@dataclass(slots=True)
class Facts:
    """The newest frame as it was measured; a number that was not measured anew keeps its last value.

    The first group says what `Check.measure` may name; the rest only stands in the reasons for the log.
    """

    level: float = nan  # mean grey level, of full scale
    level_rel: float = nan  # of the rest frame's
    black: bool = False  # the camera says so
    newly_saturated: float = nan  # of the pixels that were not saturated at rest
    sharpness: float = nan  # of the rest frame's
    camera_lost: bool = False
    camera_stalled: bool = False
    clock_stepped: bool = False
    unidentified: bool = False
    failed: bool = False  # the image could not be computed
    pins_missing: bool = False
    far_share: float = nan  # of the pins that have moved beyond the load limit
    off_pitches: float = nan  # of all pins from the rest frame
    drifted_share: float = nan  # of the pins whose drift is at its limit

    rest_level: float = nan
    saturated: float = nan
    clock_jump_s: float = nan
    off_px: float = nan
    far_n: int = 0
    limit_px: float = nan
    camera: str = ""
    failure: str = ""
    why_missing: str = ""

    def forget_pins(self) -> None:
        """Forget what was found of the pins: there is a new rest frame."""
        self.unidentified = self.failed = self.pins_missing = False
        self.off_pitches = self.drifted_share = nan


@dataclass(frozen=True, slots=True)
class Check:
    """One row: the fault holds while the answer is yes; or it appears when the number reaches `raise_at`, and
    clears when it is away from it by the share of `raise_at` that all checks have in common. Rows of the same
    fault are alternatives: it holds while one of them does. NaN reaches no limit.
    """

    code: FaultCode
    measure: str  # name of the answer or the number, a field of `Facts`
    reason: str  # for the log; a format of the fields of `Facts`
    raise_at: float | None = None  # None: an answer, yes or no
    unit: str = ""  # of the number and of the limit
    below: bool = False  # the fault is below the limit

    def limit(self, holds: bool) -> float:
        """The level that a number has to reach for the fault to appear, or to go on."""
        assert self.raise_at is not None
        away = PARAMS.hysteresis_rel * self.raise_at if holds else 0.0
        return self.raise_at + (away if self.below else -away)


class Judge:
    """Reports to the registry which faults of the checks hold."""

    def __init__(self, checks: Sequence[Check], registry: FaultRegistry) -> None:
        self._registry = registry
        rows = sorted(checks, key=lambda check: not check.below)
        self._limited = [check for check in rows if check.raise_at is not None]
        self._checks = [*self._limited, *(check for check in rows if check.raise_at is None)]
        self._below_n = sum(check.below for check in checks)
        self._measured = attrgetter(*[check.measure for check in self._checks])
        self._codes = list(dict.fromkeys(check.code for check in checks))
        self._limits: tuple[int, list[float]] = (-1, [])  # at so many changes of the registry
        self._reached = -1  # a bit a check
        self._changes_n = -1  # of the registry when it was last reported to

    def judge(self, facts: Facts) -> None:
        """Judge a frame: one walk, and where nothing has changed one comparison."""
        changes_n = self._registry.changes_n
        reached = self._compare(facts)
        if reached == self._reached and changes_n == self._changes_n:
            return
        self._reached, self._changes_n = reached, changes_n
        first = self._first(reached)
        for code in self._codes:
            check = first.get(code)
            reason = partial(check.reason.format_map, asdict(facts)) if check else ""
            self._registry.report(code, check is not None, reason)

    def would_hold(self, facts: Facts) -> dict[FaultCode, Check]:
        """The faults that hold by these facts, each with its row; reports nothing. For any thread."""
        return self._first(self._compare(facts))

    def _compare(self, facts: Facts) -> int:
        changes_n, (limits_n, limits) = self._registry.changes_n, self._limits
        if changes_n != limits_n:
            limits = [check.limit(self._registry.holds(check.code)) for check in self._limited]
            self._limits = changes_n, limits
        return which_reach(self._measured(facts), limits, self._below_n)

    def _first(self, reached: int) -> dict[FaultCode, Check]:
        """Each fault whose limit is reached, with the first row that says so."""
        rows = [check for i, check in enumerate(self._checks) if reached >> i & 1]
        return {check.code: check for check in reversed(rows)}
