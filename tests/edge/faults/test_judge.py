"""A fault appears at one limit and clears at another; rows of one fault are alternatives."""

from __future__ import annotations

import math

from edge.faults.judge import Check, run_checks
from edge.faults.registry import FaultRegistry
from hostlink.wire import FaultCode

DARK, BRIGHT = FaultCode.IMAGE_DARK, FaultCode.IMAGE_BRIGHT
CHECKS = (
    Check(DARK, "level", 0.25, "", "level {level:.0%}", below=True),
    Check(DARK, "black", 1.0, "", "black"),
    Check(BRIGHT, "full", 0.5, "", "full {full:.0%}"),
)


def held_after(*values: dict[str, float]) -> list[dict[FaultCode, str]]:
    registry, held = FaultRegistry(), []
    for measured in values:
        run_checks(CHECKS, measured, registry)
        held.append(registry.active)
    return held


def test_limits_have_a_hysteresis_either_way() -> None:
    levels = [{"level": v} for v in (0.26, 0.25, 0.27, 0.28, 0.27)]
    assert [bool(h) for h in held_after(*levels)] == [False, True, True, False, False]
    full = [{"full": v} for v in (0.49, 0.5, 0.46, 0.44, 0.46)]
    assert [bool(h) for h in held_after(*full)] == [False, True, True, False, False]


def test_any_row_of_a_fault_holds_it_and_the_first_gives_the_reason() -> None:
    assert held_after({"level": 0.9, "black": 1.0}) == [{DARK: "black"}]
    assert held_after({"level": 0.1, "black": 1.0}) == [{DARK: "level 10%"}]


def test_checks_without_a_measurement_stay_unchanged() -> None:
    assert held_after({"full": 0.9}, {"level": 0.9}, {"full": 0.1}) == [{BRIGHT: "full 90%"}] * 2 + [{}]


def test_nan_is_no_fault() -> None:
    assert held_after({"level": math.nan, "full": math.nan}) == [{}]


def test_faults_may_be_raised_without_clearing_others() -> None:
    registry = FaultRegistry()
    run_checks(CHECKS, {"full": 0.9}, registry)
    run_checks(CHECKS, {"level": 0.1, "full": 0.1}, registry, clear=False)
    assert set(registry.active) == {DARK, BRIGHT}
