"""A fault appears at one limit and clears at another; rows of one fault are alternatives."""

import math

from edge.faults.detector import Facts
from edge.faults.judge import Check, Judge
from edge.faults.registry import FaultRegistry
from hostlink.wire import FaultCode

DARK, BRIGHT = FaultCode.IMAGE_DARK, FaultCode.IMAGE_BRIGHT
CHECKS = (
    Check(DARK, "level", "level {level:.0%}", 0.25),
    Check(DARK, "black", "black"),
    Check(BRIGHT, "newly_saturated", "full {newly_saturated:.0%}", 0.5),
)


def held_after(*values: dict[str, float]) -> list[dict[FaultCode, str]]:
    registry, facts, held = FaultRegistry(), Facts(), []
    judge = Judge(CHECKS, registry)
    for measured in values:
        for name, value in measured.items():
            setattr(facts, name, value)
        judge.report(facts.reached(judge.limits()), facts)
        held.append(registry.active)
    return held


def test_limits_have_a_hysteresis_either_way() -> None:
    levels = [{"level": v} for v in (0.26, 0.25, 0.27, 0.28, 0.27)]
    assert [bool(h) for h in held_after(*levels)] == [False, True, True, False, False]
    full = [{"newly_saturated": v} for v in (0.49, 0.5, 0.46, 0.44, 0.46)]
    assert [bool(h) for h in held_after(*full)] == [False, True, True, False, False]


def test_any_row_of_a_fault_holds_it_and_the_first_gives_the_reason() -> None:
    assert held_after({"level": 0.9, "black": True}) == [{DARK: "black"}]
    assert held_after({"level": 0.1, "black": True}) == [{DARK: "level 10%"}]
    assert held_after({"level": math.nan, "newly_saturated": math.nan}) == [{}]
    # A reading that is not measured anew stays as it was.
    full = {BRIGHT: "full 90%"}
    assert held_after({"newly_saturated": 0.9}, {"level": 0.9}, {"newly_saturated": 0.1}) == [full, full, {}]


def test_a_fault_that_another_thread_raised_is_judged_with_the_next_frame() -> None:
    registry, facts = FaultRegistry(), Facts(level=0.9, newly_saturated=0.47)
    judge = Judge(CHECKS, registry)
    judge.report(facts.reached(judge.limits()), facts)
    registry.report(DARK, True, "by another thread")
    registry.report(BRIGHT, True, "by another thread")
    judge.report(facts.reached(judge.limits()), facts)
    assert set(registry.active) == {BRIGHT}  # the limit of a fault that holds is the lower one
    held = judge.first(Facts(level=0.1, black=True, newly_saturated=0.6).reached(judge.limits()))
    assert {code: check.measure for code, check in held.items()} == {DARK: "level", BRIGHT: "newly_saturated"}
    assert set(registry.active) == {BRIGHT}  # asking reports none
