"""CANopen's own master reads a finger's values by name, with the data sheet alone."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from random import Random
from typing import Any

import canopen
import pytest

from edge.link.node import Node
from hostlink.wire import State, Status, pack_parts, pack_state, unpack_part, unpack_state
from hostlink.wire.fields import LAYOUT
from hostlink.wire.process_data import MAPPING, SAMPLE_DATA
from tests.edge.link.test_node import Bench
from tests.support.states import random_state
from tests.support.waiting import until

LIMITS = {d.name: (d.low, d.high) for d in SAMPLE_DATA}


@pytest.fixture
def master(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Bench]:
    with closing(Bench(request.node.name, tmp_path, getattr(request, "param", "&fd=0"))) as made:
        made.remote.tpdo.read()
        yield made


def by_name(tpdo: Any) -> dict[str, Any]:
    return {variable.name.partition(".")[2]: variable.raw for variable in tpdo}


def raws_of(state: State) -> dict[str, int]:
    """What TPDO 1 and 2 hold, as our own receiver takes them apart."""
    first, second = (unpack_part(tpdo, data).raws for tpdo, data in pack_parts(state, 0)[:2])
    return first | second


def test_values_by_name_as_they_are_sent(master: Bench) -> None:
    rng, remote = Random(7), master.remote
    received: list[dict[str, Any]] = []
    for number in (1, 2):
        remote.tpdo[number].add_callback(lambda tpdo: received.append(by_name(tpdo)))
    for i in range(200):
        received.clear()
        state = random_state(rng, i)
        assert master.node.send(state)
        until(lambda: len(received) == 2, "two TPDOs")
        values = received[0] | received[1]
        for name, raw in raws_of(state).items():
            low, high = LIMITS.get(name, (raw, raw))
            got: Any = values.get(name, values.get(f"pdo_{name}"))
            if low <= raw <= high:
                assert got == raw, name
            else:
                assert not low <= got <= high, f"{name} is not valid"
        assert values["pdo_sample_high"] << 5 | values["pdo_sample_low"] == state.sample & 0xFFFF


def test_values_in_units_by_pdo_and_sdo(master: Bench) -> None:
    with pytest.raises(canopen.SdoAbortedError, match="No data available"):
        master.remote.sdo["sample_data"]["force_n"].raw  # noqa: B018 - read for its error
    state = State(
        sample=77, status=Status.TOUCHED | Status.CAMERA_MOVED, displacement_mm=1.5, shear_x_mm=-0.25,
        shear_y_mm=0.75, force_n=-2.5, torque_z_nmm=12.5, pins_tracked=1.0, temperature_degc=-7.0,
    )  # fmt: skip
    remote = master.remote
    page: list[int] = []
    remote.tpdo[3].add_callback(lambda tpdo: page.append(tpdo["pdo.pdo_page"].raw))
    remote.tpdo[2].add_callback(lambda tpdo: page.append(-1))
    assert master.node.send(state)
    until(lambda: len(page) == 5, "the status, and pages 0, 1, 2 and 7")
    assert page == [-1, 0, 1, 2, 7]
    tpdo = remote.tpdo
    assert tpdo["sample_data.displacement_mm"].phys == pytest.approx(1.5)
    assert tpdo["sample_data.shear_x_mm"].phys == pytest.approx(-0.25)
    assert tpdo["sample_data.shear_y_mm"].phys == pytest.approx(0.75)
    assert tpdo["sample_data.status"].raw == Status.TOUCHED | Status.CAMERA_MOVED
    sent = unpack_state(pack_state(state, 0))
    for f in LAYOUT:
        entry = remote.sdo["sample_data"][f.name]
        low, high = LIMITS[f.name]
        assert (entry.od.min, entry.od.max) == (low, high), f.name
        value = getattr(sent, f.name, float("nan"))  # there are no contacts
        if value == value:
            assert entry.phys == pytest.approx(float(value)), f.name
        else:
            assert not low <= entry.raw <= high, f.name


def test_a_rate_is_an_inhibit_time(master: Bench) -> None:
    timing = master.remote.sdo["tpdo1_communication"]
    master.remote.sdo["settings"]["rate_hz"].raw = 40.0
    assert (timing["tpdo1_inhibit"].raw, timing["tpdo1_event_timer"].raw) == (250, 0), "25 ms apart, no timer"


@pytest.mark.parametrize("master", [""], indirect=True)
def test_on_can_fd_nothing_is_mapped(master: Bench) -> None:
    assert isinstance(master.node, Node)
    assert [len(master.remote.tpdo[i].map) for i in MAPPING] == [0] * 4
    assert master.node.send(State(sample=1, force_n=2.5))
    assert master.remote.sdo["sample_data"]["force_n"].phys == pytest.approx(2.5)
