"""The clock map against simulated clocks: the true time lies inside of the bound, and the bound is small."""

from __future__ import annotations

import random

import pytest

from hostlink.clock import ClockMap


class World:
    """Two clocks and a wire: the device's started at `start_us` and gains `drift` on the host's."""

    def __init__(self, seed: int, drift: float, start_us: int, floor_s: float, jitter_s: float) -> None:
        self.random = random.Random(seed)
        self.drift, self.start_us, self.floor_s, self.jitter_s = drift, start_us, floor_s, jitter_s

    def device_us(self, host_s: float) -> int:
        return int(self.start_us + host_s * (1 + self.drift) * 1e6) % 2**32

    def transit_s(self) -> float:
        late = 0.02 if self.random.random() < 0.01 else 0.0  # a descheduled receiver
        return self.floor_s + self.random.expovariate(1 / self.jitter_s) + late


@pytest.mark.parametrize("drift", [0.0, 80e-6, -150e-6])
@pytest.mark.parametrize("start_us", [0, 2**32 - 3_000_000])
def test_true_time_is_inside_the_bound(drift: float, start_us: int) -> None:
    world, clock = World(1, drift, start_us, 0.0004, 0.0002), ClockMap()
    for k in range(60 * 100):
        sent = 1000.0 + k * 0.01
        clock.observe(world.device_us(sent), sent + world.transit_s())
        mapped = clock.to_host(world.device_us(sent))
        assert mapped is not None
        assert abs(mapped.time_s - sent) <= mapped.error_s + 1e-6, k
        assert mapped.error_s < 0.0014
    assert clock.drift_ppm == pytest.approx(-drift * 1e6, abs=15)
    assert clock.restarts == 0


def test_round_trip_narrows_the_bound() -> None:
    world, clock = World(2, 30e-6, 5, 0.0003, 0.0001), ClockMap(transit_s=0.01)
    for k in range(2000):
        sent = 50.0 + k * 0.01
        if k % 100 == 0:
            asked = sent - world.transit_s()
            clock.bracket(asked, world.device_us(sent), sent + world.transit_s())
        else:
            clock.observe(world.device_us(sent), sent + world.transit_s())
    mapped = clock.to_host(world.device_us(sent))
    assert mapped is not None
    assert abs(mapped.time_s - sent) <= mapped.error_s
    assert mapped.error_s < 0.0008


@pytest.mark.parametrize("new_start_us", [0, 4_000_000_000])
def test_device_restart_starts_over(new_start_us: int) -> None:
    clock = ClockMap()
    for k in range(100):
        clock.observe(1_000_000_000 + k * 10_000, 10.0 + k * 0.01)
    for k in range(100):
        clock.observe((new_start_us + k * 10_000) % 2**32, 20.0 + k * 0.01)
    mapped = clock.to_host((new_start_us + 990_000) % 2**32)
    assert clock.restarts == 1
    assert mapped is not None
    assert mapped.time_s == pytest.approx(20.99, abs=0.002)


def test_silence_longer_than_a_wrap() -> None:
    clock = ClockMap()
    clock.observe(500, 1.0)
    hours = 3 * 3600.0
    clock.observe(int(500 + hours * 1e6) % 2**32, 1.0 + hours)
    mapped = clock.to_host(int(500 + hours * 1e6) % 2**32)
    assert clock.restarts == 0
    assert mapped is not None
    assert mapped.time_s == pytest.approx(1.0 + hours, abs=0.002)


def test_late_samples_do_not_move_the_map() -> None:
    clock = ClockMap()
    for k in range(300):
        clock.observe(k * 10_000, 5.0 + k * 0.01)
    before = clock.to_host(2_990_000)
    for k in range(300, 310):
        clock.observe(k * 10_000, 5.0 + k * 0.01 + 0.5)
    assert clock.to_host(2_990_000) == before


def test_nothing_observed_nothing_told() -> None:
    assert ClockMap().to_host(5) is None
