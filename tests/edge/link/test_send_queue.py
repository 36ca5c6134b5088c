"""Order of the items in a link's queue, where no sink's test sees it."""

import pytest

from edge.link.send_queue import SendQueue


@pytest.fixture
def queue() -> SendQueue:
    return SendQueue(4, 8)


def taken(queue: SendQueue, now_s: float = 0.0) -> list[object]:
    """All items that are due, most urgent first."""
    items: list[object] = []
    while (some := queue.take(now_s)) is not None:
        items += some
        queue.done(True)
    return items


def test_detail_keeps_its_distance_and_an_incomplete_group_is_dropped(queue: SendQueue) -> None:
    queue.put_spaced("detail", ["d1", "d2"], 0.5)
    assert taken(queue, 10.0) == ["d1"]
    assert queue.wait_s(10.2) == pytest.approx(0.3)
    assert [taken(queue, now_s) for now_s in (10.4, 10.5)] == [[], ["d2"]]
    queue.put_spaced("detail", ["d1", "d2", "d3"], 0.0)
    queue.take(11.0)
    assert queue.done(False) == "detail_skipped"
    assert queue.empty


def test_a_block_keeps_its_distance_lets_samples_pass_and_gives_way_to_the_next(queue: SendQueue) -> None:
    queue.put_spaced("block", ["b1", "b2", "b3"], 0.5)
    queue.put_spaced("detail", ["d1"], 0.5)
    assert taken(queue, 10.0) == ["b1", "d1"]
    queue.put_sample(["s"])
    assert taken(queue, 10.5) == ["s", "b2"]
    queue.put_spaced("block", ["b2", "b3"], 0.5)
    queue.take(11.0)
    assert queue.done(False) == ""  # the client asks for it again
    assert taken(queue, 11.5) == ["b3"]
    queue.put_spaced("block", ["b4"], 0.5)
    assert queue.clear() == 0
    assert queue.empty


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


def test_a_stall_costs_a_series_its_periods_and_keeps_the_phase(queue: SendQueue) -> None:
    queue.every(0.1, lambda: "beat", 0.0, 0.25)
    assert [taken(queue, t) for t in (0.03, 0.47, 0.48, 0.53)] == [["beat"], ["beat"], [], ["beat"]]
    queue.every(0.1, None, 0.53)
    assert taken(queue, 9.0) == []
    assert queue.wait_s(9.0) is None


def test_no_sample_overtakes_one_that_is_being_written(queue: SendQueue) -> None:
    queue.put_control("c")
    queue.take(0.0)
    assert not queue.sample_ahead
    queue.done(True)
    queue.put_sample(["s"])
    assert queue.sample_ahead
    queue.take(0.0)
    assert queue.sample_ahead
    assert queue.done(True) == "sent"
    assert not queue.sample_ahead
