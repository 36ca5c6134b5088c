"""Golden frames, both ways: they detect a change of a single bit on the wire."""

import json
from typing import Any

import pytest

from hostlink import wire
from hostlink.decoder import CanDecoder, Heartbeat, Sample, SerialDecoder
from hostlink.wire import CanIds, Contact, Message, State, Status
from hostlink.wire.e2e import protected_p5
from hostlink.wire.fields import OLDER
from tests.support.states import mismatches, same
from tests.vectors.__main__ import FILE

GOLDEN = json.loads(FILE.read_text(encoding="utf-8"))
#: Receivers still decode what senders of versions 2 and 3 sent, and refuse what those of version 1 did.
FILES = [FILE.with_name(f"frames_v{n}.json") for n in (3, 2, 1)]
*OLD, BEFORE = (json.loads(file.read_text(encoding="utf-8")) for file in FILES)
SAMPLES = [
    pytest.param(row, id=f"{row['name']}-v{golden['version']}")
    for golden in (GOLDEN, *OLD)
    for row in golden["samples"]
]


def state_of(row: dict[str, Any]) -> State:
    values: dict[str, Any] = {
        k: float(v) if isinstance(v, str) else v for k, v in row.items() if k != "contacts"
    }
    values["status"] = Status(values["status"])
    contacts = tuple(Contact(*(float(v) for v in c.values())) for c in row["contacts"])
    return State(**values, contacts=contacts)


def test_frames_of_a_version_that_is_gone_are_named_and_its_classic_parts_damaged_ones() -> None:
    on_can = [(CanIds().state(1), bytes.fromhex(row["frame"])) for row in BEFORE["samples"]]
    on_serial = [(bytes.fromhex(row["serial"]),) for row in BEFORE["samples"]]
    for raised in (mismatches(CanDecoder(), on_can), mismatches(SerialDecoder(), on_serial)):
        assert [(error.ours, error.theirs) for error in raised] == [(wire.VERSION, BEFORE["version"])]
    decoder = CanDecoder()
    parts = [part for row in BEFORE["samples"] for part in row["parts"]]
    for tpdo, part in parts:
        assert decoder.receive(CanIds().tpdo(tpdo, 1), bytes.fromhex(part)) == []
    assert decoder.statistics[1].corrupt_n == len(parts)


@pytest.mark.parametrize("row", GOLDEN["samples"], ids=lambda row: row["name"])
def test_encode(row: dict[str, Any]) -> None:
    state, counter = state_of(row["state"]), row["counter"]
    assert wire.pack_state(state, counter).hex() == row["frame"]
    assert [[tpdo, part.hex()] for tpdo, part in wire.pack_parts(state, counter)] == row["parts"]
    assert wire.encode_frame(Message.STATE, wire.pack_state(state, counter)).hex() == row["serial"]


@pytest.mark.parametrize("row", SAMPLES)
def test_decode(row: dict[str, Any]) -> None:
    once = wire.unpack_state(bytes.fromhex(row["frame"]))
    classic, serial = CanDecoder(), SerialDecoder()
    events = [e for t, p in row["parts"] for e in classic.receive(CanIds().tpdo(t, 1), bytes.fromhex(p))]
    events += serial.receive(bytes.fromhex(row["serial"]))
    assert [isinstance(e, Sample) and same(e.state, once) for e in events] == [True, True]


@pytest.mark.parametrize("golden", [GOLDEN, *OLD], ids=lambda golden: f"v{golden['version']}")
def test_a_full_sample_reads_as_it_was_written(golden: dict[str, Any]) -> None:
    """Its values are multiples of the steps: nothing may be lost but a float's last bit."""
    row = next(r for r in golden["samples"] if r["name"] == "full")
    sent, got = state_of(row["state"]), wire.unpack_state(bytes.fromhex(row["frame"]))
    for name in row["state"]:
        if name == "status":
            assert got.status == sent.status
        elif name != "contacts":
            assert getattr(got, name) == pytest.approx(getattr(sent, name), rel=1e-9), name
    for a, b in zip(sent.contacts, got.contacts, strict=True):
        assert (b.x_mm, b.y_mm) == pytest.approx((a.x_mm, a.y_mm))
        assert b.depth_mm == pytest.approx(a.depth_mm, nan_ok=True)


@pytest.mark.parametrize("old", OLD, ids=lambda old: f"v{old['version']}")
def test_every_message_of_a_version_before_is_decoded_and_a_damaged_one_is_noise(old: dict[str, Any]) -> None:
    older = OLDER[old["version"]]
    assert f"0x{older.hash:08X}" == old["schema"]
    assemblers = wire.DetailAssembler()
    assert [assemblers.add(wire.unpack_segment(bytes.fromhex(s))) for s in old["detail"]["segments"]][-1]
    heartbeat = protected_p5(bytes((older.version, 5)), 1, older.data_id + Message.HEARTBEAT & 0xFFFF)
    (event,) = SerialDecoder().receive(wire.encode_frame(Message.HEARTBEAT, heartbeat))
    assert isinstance(event, Heartbeat)
    decoder = CanDecoder()
    for counter in range(50):  # the CRC is right, `check` is not: no version, however often
        frame = bytearray(bytes.fromhex(old["samples"][1]["frame"]))
        frame[20] ^= 1 + counter
        sent = protected_p5(bytes(frame[3:]), counter, older.data_id)
        assert decoder.receive(CanIds().state(1), sent) == []
    assert decoder.statistics[1].corrupt_n == 50


def test_detail() -> None:
    """That it reads as it was written: `test_detail_round_trip` of the codec."""
    golden = GOLDEN["detail"]
    rows = [(float(x), float(y), float(change)) for x, y, change in golden["rows"]]
    segments = wire.pack_detail(golden["sample"], rows, golden["counter"])
    assert [s.hex() for s in segments] == golden["segments"]
