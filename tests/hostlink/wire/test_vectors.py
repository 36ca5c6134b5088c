"""Golden frames, both ways: they detect a change of a single bit on the wire."""

from __future__ import annotations

import json
from typing import Any

import pytest

from hostlink.decoder import CanDecoder, Sample, SerialDecoder
from hostlink.wire import (
    VERSION,
    CanIds,
    Contact,
    DetailAssembler,
    Message,
    State,
    Status,
    encode_frame,
    pack_detail,
    pack_parts,
    pack_state,
    unpack_segment,
    unpack_state,
)
from tests.support.states import same
from tests.vectors.__main__ import FILE

GOLDEN = json.loads(FILE.read_text(encoding="utf-8"))


def state_of(row: dict[str, Any]) -> State:
    values: dict[str, Any] = {
        k: float(v) if isinstance(v, str) else v for k, v in row.items() if k != "contacts"
    }
    values["status"] = Status(values["status"])
    contacts = tuple(Contact(*(float(v) for v in c.values())) for c in row["contacts"])
    return State(**values, contacts=contacts)


def test_the_file_belongs_to_this_version() -> None:
    assert GOLDEN["version"] == VERSION


@pytest.mark.parametrize("row", GOLDEN["samples"], ids=lambda row: row["name"])
def test_encode(row: dict[str, Any]) -> None:
    state, counter = state_of(row["state"]), row["counter"]
    assert pack_state(state, counter).hex() == row["frame"]
    assert [[tpdo, part.hex()] for tpdo, part in pack_parts(state, counter)] == row["parts"]
    assert encode_frame(Message.STATE, pack_state(state, counter)).hex() == row["serial"]


@pytest.mark.parametrize("row", GOLDEN["samples"], ids=lambda row: row["name"])
def test_decode(row: dict[str, Any]) -> None:
    once = unpack_state(bytes.fromhex(row["frame"]))
    classic, serial = CanDecoder(), SerialDecoder()
    events = [e for t, p in row["parts"] for e in classic.receive(CanIds().tpdo(t, 1), bytes.fromhex(p))]
    events += serial.receive(bytes.fromhex(row["serial"]))
    assert len(events) == 2
    assert all(isinstance(e, Sample) and same(e.state, once) for e in events)


def test_a_full_sample_reads_as_it_was_written() -> None:
    """Its values are multiples of the steps: nothing may be lost but a float's last bit."""
    row = next(r for r in GOLDEN["samples"] if r["name"] == "full")
    sent, got = state_of(row["state"]), unpack_state(bytes.fromhex(row["frame"]))
    for name in row["state"]:
        if name == "status":
            assert got.status == sent.status
        elif name != "contacts":
            assert getattr(got, name) == pytest.approx(getattr(sent, name), rel=1e-9), name
    for a, b in zip(sent.contacts, got.contacts, strict=True):
        assert (b.x_mm, b.y_mm) == pytest.approx((a.x_mm, a.y_mm))
        assert b.depth_mm == pytest.approx(a.depth_mm, nan_ok=True)


def test_detail() -> None:
    golden = GOLDEN["detail"]
    rows = [tuple(float(v) for v in row) for row in golden["rows"]]
    segments = pack_detail(golden["sample"], rows, golden["counter"])  # type: ignore[arg-type]
    assert [s.hex() for s in segments] == golden["segments"]
    assembler = DetailAssembler()
    detail = [assembler.add(unpack_segment(s)) for s in segments][-1]
    assert detail is not None
    for a, b in zip(rows, detail.rows, strict=True):
        assert b == pytest.approx(a, nan_ok=True)
