"""Windows of samples, and the observations that the documentation shows for LeRobot."""

from functools import partial
from math import isfinite, nan
from typing import Any

import numpy as np
import pytest

import hostlink
from hostlink.bridge.lerobot import TactileObservation
from hostlink.events import Event
from hostlink.hand_file import HandFile, Mount
from hostlink.window import MEASURED
from hostlink.wire import State, pack_detail
from tests.support.bus import Wire
from tests.support.fingers import Fingers
from tests.support.waiting import present, until

HAND = HandFile(mounts=(Mount("thumb", 3, (0.0, 0.0, 0.0)), Mount("index", 1, (0.0, 0.0, 0.0))))


def sent(k: int) -> State:
    """One in three is not valid."""
    return State(
        sample=k, capture_time_us=1000 * k, latency_us=10.0, displacement_mm=nan if k % 3 == 0 else k / 100
    )


def begin(wire: Wire) -> list[Event]:
    """Begin the window; what it has taken is in this list, since these callbacks come after its own."""
    received: list[Event] = []
    assert wire.hand.window() == {}, "it begins"
    wire.hand.on_sample(received.append)
    wire.hand.on_detail(received.append)
    return received


def test_windows_hold_each_sample_once(wire: Wire) -> None:
    received = begin(wire)
    windows, count = [], 0
    for n in (1, 40, 0, 259):
        for _ in range(n):
            if count != 200:  # which is lost
                wire.send_state(3, sent(count))
            count += 1
        until(partial(lambda n: len(received) == n, count - (count > 200)), "all samples")
        windows.append(wire.hand.window(["displacement_mm", "force_n"])[3])
    assert [len(w.time_s) for w in windows] == [1, 40, 0, 258]
    assert sum(w.lost_n for w in windows) == 1
    got = [w.column("displacement_mm") for w in windows]
    values, valid = (np.concatenate(part) for part in zip(*got, strict=True))
    numbers = np.delete(np.arange(300), 200)
    assert valid.tolist() == (numbers % 3 != 0).tolist()
    assert values == pytest.approx(np.where(valid, numbers / 100, 0.0), abs=0.0011)
    assert not any(w.column("force_n")[1].any() for w in windows)
    assert all(np.isfinite(w.values).all() and np.isfinite(w.time_s).all() for w in windows)


def test_samples_not_taken_in_time_count_as_lost(wire: Wire, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hostlink.window.SAMPLES_MAX", 4)
    received = begin(wire)
    for k in range(10):
        wire.send_state(3, sent(k))
    until(lambda: len(received) == 10, "all samples")
    window = wire.hand.window(["displacement_mm"])[3]
    assert (window.lost_n, len(window.time_s)) == (6, 4)
    assert window.values[1:3, 0] == pytest.approx([0.07, 0.08]), "the newest are kept"


def test_pins_come_with_the_time_of_their_sample(wire: Wire) -> None:
    received = begin(wire)
    wire.send_state(3, sent(0))
    wire.send_state(3, sent(1))
    rows = [(1.0, -2.0, 0.5), (nan, nan, nan), (0.5, 0.0, 0.0)]
    counter = 0
    for sample in (1, 9):  # of the second one no sample came, and nothing says when it was
        for segment in pack_detail(sample, rows, counter):
            wire.send(0x480 + 3, segment)
            counter += 1
    until(lambda: len(received) == 4, "two samples and both frames")
    window = wire.hand.window()[3]
    assert window.pin_time_s.tolist() == window.time_s[1:].tolist()
    assert window.pins_valid.tolist() == [[True, False, True]]
    assert window.pins[0] == pytest.approx(
        np.array([[1.0, -2.0, 0.5], [0.0] * 3, [0.5, 0.0, 0.0]]), abs=0.011
    )
    assert window.names == MEASURED


def test_a_window_of_an_unknown_value_is_one_line(wire: Wire) -> None:
    with pytest.raises(hostlink.UsageError, match="no value 'colour'; known: latency_us, "):
        wire.hand.window(["colour"])


def test_an_observation_has_its_features_and_no_nan() -> None:
    values = ("displacement_mm", "force_n")
    touch = TactileObservation("virtual:lerobot", HAND, values, slots=4)
    with pytest.raises(hostlink.UsageError, match="connect first"):
        touch.get_observation()
    with Fingers("virtual:lerobot", (1, 3), lambda number, k: sent(3 * (k % 500) + number % 3)) as fingers:
        touch.connect()
        assert touch.is_connected

        def full() -> dict[str, float]:
            seen = touch.get_observation()
            assert seen.keys() == touch.observation_features.keys()
            assert all(isfinite(value) and type(value) is float for value in seen.values())
            return seen

        connection = present(touch._connection)
        full()
        begun_n = connection.statistics[1].received_n
        until(lambda: connection.statistics[1].received_n >= begun_n + 40, "a window of 40 samples")
        seen = full()
        slots = [seen[f"index.displacement_mm.{i}"] for i in range(4)]
        assert 0.0 < slots[0] < slots[1] < slots[2] < slots[3]
        assert seen["index.displacement_mm.3.valid"] == 1.0
        assert seen["thumb.displacement_mm.0.valid"] == 0.0
        assert full()["index.force_n.0.valid"] == 0.0
        fingers.running.clear()
        until(lambda: not any(full().values()), "silence is not valid")
    touch.disconnect()
    assert not touch.is_connected


@pytest.mark.parametrize("options", [{"values": ("colour",)}, {"slots": 0}, {"hand": HandFile()}])
def test_an_observation_of_nothing_is_one_line(options: dict[str, Any]) -> None:
    with pytest.raises(hostlink.UsageError, match="observation: give a hand with fingers"):
        TactileObservation("virtual:none", **({"hand": HAND} | options))
