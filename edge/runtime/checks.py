"""A table of faults that follow from a measured number, and its evaluation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from edge.runtime.fault_registry import FaultRegistry
from hostlink.wire import FaultCode

__all__ = ["Check", "run_checks"]


@dataclass(frozen=True, slots=True)
class Check:
    """One row: the fault appears when the number reaches `raise_at`, and clears when it no longer reaches
    `clear_at`. Rows of the same fault are alternatives: it holds while one of them does.

    measure  name of the number
    unit     of the number and of both limits
    reason   for the log; a format of the numbers measured
    below    the fault is below the limits
    """

    code: FaultCode
    measure: str
    raise_at: float
    clear_at: float
    unit: str
    reason: str
    below: bool = False


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
            limit = check.clear_at if registry.holds(check.code) else check.raise_at
            reached = value <= limit if check.below else value >= limit
            holding[check.code] = holding.get(check.code) or (check if reached else None)
    for code, holds in holding.items():
        if holds is not None:
            registry.report(code, True, partial(holds.reason.format, **measured))
        elif clear:
            registry.report(code, False)
