"""Order of the items in a link's queue, and detection of stalls."""

from __future__ import annotations

import pytest

from edge.link.send_queue import SendQueue
from edge.link.stall_watch import StallWatch


def taken(queue: SendQueue, now_s: float = 0.0) -> list[object]:
    """All items that are due, most urgent first."""
    items: list[object] = []
    while (some := queue.take(now_s)) is not None:
        items += some
        queue.done(True)
    return items


def test_answers_go_first_then_samples_then_detail() -> None:
    queue = SendQueue(4, 8)
    queue.put_detail(["d1", "d2"], 0.0)
    queue.put_sample(["s1", "s2"])
    queue.put_control("c")
    assert taken(queue) == ["c", "s1", "s2", "d1", "d2"]
    assert queue.empty


def test_the_oldest_sample_is_dropped() -> None:
    queue = SendQueue(2, 8)
    assert [queue.put_sample([k]) for k in range(4)] == [True, True, False, False]
    assert taken(queue) == [2, 3]


def test_detail_keeps_its_distance() -> None:
    queue = SendQueue(4, 8)
    queue.put_detail(["d1", "d2"], 0.5)
    assert taken(queue, 10.0) == ["d1"]
    assert queue.wait_s(10.2) == pytest.approx(0.3)
    assert taken(queue, 10.4) == []
    assert taken(queue, 10.5) == ["d2"]


def test_an_incomplete_detail_group_is_dropped() -> None:
    queue = SendQueue(4, 8)
    queue.put_detail(["d1", "d2", "d3"], 0.0)
    queue.take(0.0)
    assert queue.done(False) == {"detail_skipped": 1}
    assert queue.empty


def test_series_come_each_period_and_end() -> None:
    queue = SendQueue(4, 8)
    queue.every(0.1, lambda: "beat", 0.0)
    assert [taken(queue, t) for t in (0.05, 0.1, 0.15, 0.25)] == [[], ["beat"], [], ["beat"]]
    queue.every(0.1, None, 0.25)
    assert taken(queue, 9.0) == []
    assert queue.wait_s(9.0) is None


@pytest.mark.parametrize("begun_s", [100.0, 100.013, 100.0999, 7.21])
def test_series_of_other_phases_never_come_together(begun_s: float) -> None:
    due = []
    for phase in (0.0, 0.25, 0.5):
        queue = SendQueue(4, 8)
        queue.every(0.1, lambda: "beat", begun_s, phase)
        wait_s = queue.wait_s(begun_s)
        assert wait_s is not None
        assert 0.0 <= wait_s <= 0.1 + 1e-9
        due.append(begun_s + wait_s)
    assert [round(due_s / 0.1 % 1.0, 6) % 1.0 for due_s in due] == [0.0, 0.25, 0.5]


def test_a_stall_costs_its_periods_and_keeps_the_phase() -> None:
    queue = SendQueue(4, 8)
    queue.every(0.1, lambda: "beat", 0.0, 0.25)
    assert [taken(queue, t) for t in (0.03, 0.47, 0.48, 0.53)] == [["beat"], ["beat"], [], ["beat"]]


def test_no_sample_overtakes_one_that_is_being_written() -> None:
    queue = SendQueue(4, 8)
    queue.put_control("c")
    queue.take(0.0)
    assert not queue.sample_ahead
    queue.done(True)
    queue.put_sample(["s"])
    assert queue.sample_ahead
    queue.take(0.0)
    assert queue.sample_ahead
    assert queue.done(True) == {"sent": 1}
    assert not queue.sample_ahead


def test_clearing_counts_the_samples() -> None:
    queue = SendQueue(4, 8)
    queue.put_sample(["s1"])
    queue.put_sample(["s2"])
    queue.put_control("c")
    assert queue.clear() == 2
    assert queue.empty


def test_a_link_stalls_only_after_a_while_and_until_something_leaves() -> None:
    watch = StallWatch(3600.0)
    watch.dropped()
    assert not watch.stalled
    watch = StallWatch(-1.0)  # any time is too long
    assert not watch.stalled
    watch.dropped()
    assert watch.stalled
    watch.left(watch.write_begins(may_block=False), recovered=False)
    watch.write_ends()
    assert not watch.stalled


def test_a_watcher_is_woken_when_something_may_have_changed() -> None:
    watch = StallWatch(3600.0)
    watch.wake()
    watch.wait()  # returns at once
    watch.write_begins(may_block=True)
    watch.wait()
