"""A table of faults that follow from a measured number, and its evaluation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from edge.faults.registry import FaultRegistry
from edge.params import PARAMS
from hostlink.wire import FaultCode

__all__ = ["Check", "run_checks"]


@dataclass(frozen=True, slots=True)
class Check:
    """One row: the fault appears when the number reaches `raise_at`, and clears when it is away from it by
    the share of `raise_at` that all checks have in common. Rows of the same fault are alternatives: it holds
    while one of them does.

    measure  name of the number
    unit     of the number and of the limit
    reason   for the log; a format of the numbers measured
    below    the fault is below the limit
    """

    code: FaultCode
    measure: str
    raise_at: float
    unit: str
    reason: str
    below: bool = False

    def limit(self, holds: bool) -> float:
        """What the number has to reach for the fault to appear, or to go on."""
        away = PARAMS.hysteresis_rel * self.raise_at if holds else 0.0
        return self.raise_at + (away if self.below else -away)


def run_checks(
    checks: Sequence[Check], measured: Mapping[str, float], registry: FaultRegistry, clear: bool = True
) -> None:
    """Report the faults of the checks whose number is given. NaN reaches no limit.

    clear  False: report those that hold only
    """
    holding: dict[FaultCode, Check | None] = {}
    for check in checks:
        if check.measure in measured:
            value = measured[check.measure]
            limit = check.limit(registry.holds(check.code))
            reached = value <= limit if check.below else value >= limit
            holding[check.code] = holding.get(check.code) or (check if reached else None)
    for code, holds in holding.items():
        if holds is not None:
            registry.report(code, True, partial(holds.reason.format, **measured))
        elif clear:
            registry.report(code, False)
