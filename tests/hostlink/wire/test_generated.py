"""The generated files are fresh, and other tools decode with them what our decoder decodes."""

import ctypes
import json
import re
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import canmatrix.formats
import canopen
import cantools
import pytest
from canmatrix.ArbitrationId import ArbitrationId
from cantools.database.namedsignalvalue import NamedSignalValue
from cantools.typechecking import DecodeResultType

import hostlink
from hostlink import wire
from hostlink.wire import CanIds, State, Status
from hostlink.wire.detail import PINS_PER_SEGMENT
from hostlink.wire.fields import DATA_ID_CLASSIC, LAYOUT, PARTS, field_named
from hostlink.wire.generate import generate
from hostlink.wire.objects import TYPES
from tests.support.c_programs import C, compiled
from tests.support.commands import run_host
from tests.support.states import random_state
from tests.vectors.__main__ import FILE

FOLDER = Path(hostlink.__file__).parent
SAMPLES = 2_000
UNITS = {f.name: f.unit for f in LAYOUT}

#: A message's identifier and data -> its signals by name: numbers, or the names of values.
Decoder = Callable[[int, bytes], dict[str, Any]]


def test_no_file_is_stale() -> None:
    stale = [name for name, text in generate().items() if (FOLDER / name).read_text(encoding="utf-8") != text]
    assert not stale, f"stale: {stale}; run `make generate`"


def by_cantools(path: Path) -> Decoder:
    loaded = cantools.database.load_file(path)
    assert isinstance(loaded, cantools.database.can.Database)
    return lambda can_id, data: values_of(loaded.decode_message(can_id, data))


def by_canmatrix(path: Path) -> Decoder:
    loaded = canmatrix.formats.loadp_flat(str(path))
    assert loaded is not None

    def decode(can_id: int, data: bytes) -> dict[str, Any]:
        decoded = loaded.decode(ArbitrationId(can_id, extended=False), data)
        named = {name: v.signal.values.get(int(v.raw_value)) for name, v in decoded.items()}
        return {name: named[name] or float(v.phys_value) for name, v in decoded.items()}

    return decode


def flat(state: State) -> dict[str, object]:
    """The state by the names of the DBC's signals; invalid values as named there."""
    values: dict[str, object] = {}
    for f in LAYOUT:
        if f.contact:
            i, name = int(f.name[7]), f.name[9:]
            value = getattr(state.contacts[i], name) if i < len(state.contacts) else float("nan")
        else:
            value = getattr(state, f.name)
        values[f.name] = "invalid" if value != value else int(value) if f.plain else value
    return values


def by_bit(state: State) -> dict[str, object]:
    bits: dict[str, object] = {f"status_{b.name}".lower(): ("no", "yes")[b in state.status] for b in Status}
    return {name: value for name, value in flat(state).items() if name != "status"} | bits


def values_of(decoded: DecodeResultType) -> dict[str, Any]:
    """Signals by name: numbers, or the name of a value; none of our messages has containers."""
    assert isinstance(decoded, dict)
    return {name: v.name if isinstance(v, NamedSignalValue) else v for name, v in decoded.items()}


#: A reader of DBC, and how exactly: canmatrix multiplies decimals.
READERS = [(by_cantools, 0.0, SAMPLES), (by_canmatrix, 1e-12, SAMPLES // 20)]


@pytest.mark.parametrize(("reader", "error_rel", "samples_n"), READERS)
def test_readers_of_a_hands_dbc_decode_every_fingers_frames(
    reader: Callable[[Path], Decoder], error_rel: float, samples_n: int, tmp_path: Path
) -> None:
    """Of two fingers on a bus, CAN FD and classic, made by the command."""
    decoders = []
    for kind in ("", "--classic"):
        path = tmp_path / f"hand{kind}.dbc"
        assert run_host("dbc", "--node", "3", "--node", "4", *filter(None, [kind]), "-o", path).code == 0
        decoders.append(reader(path))
    decode_fd, decode_classic = decoders
    rng, ids = Random(1), CanIds()

    def check(decoded: dict[str, Any], expected: dict[str, object]) -> None:
        for name in decoded.keys() & expected.keys():
            value: Any = expected[name]
            known = isinstance(value, str) or not error_rel
            assert decoded[name] == (value if known else pytest.approx(value, rel=error_rel)), name

    for i in range(samples_n):
        state, node = random_state(rng, i), 3 + i % 2
        frame = wire.pack_state(state, i)
        expected = by_bit(wire.unpack_state(frame)) | {"counter": i & 0xFF, "version": frame[3]}
        decoded = decode_fd(ids.state(node), frame)
        assert expected.keys() <= decoded.keys()
        check(decoded, expected)
        frames = wire.pack_parts(state, i) if i % 5 == 0 else ()  # of 9 to 12 parts each
        expected |= {"counter": i % 15, "version": frame[3] & 0xF, "part_n": len(frames)}
        expected |= {"sample_low": state.sample & 31, "sample_high": (state.sample & 0xFFFF) >> 5}
        for tpdo, part in frames:
            check(decode_classic(ids.tpdo(tpdo, node), part), expected)


def test_a_hands_dbc_is_for_people(tmp_path: Path) -> None:
    """Names fit DBC's 32 characters; values have units, limits, comments; messages have cycle times."""
    text = '[[finger]]\nname = "thumb"\nnode = 3\n[[finger]]\nname = "a_long_finger_name_xx"\nnode = 4\n'
    (tmp_path / "hand.toml").write_text(text)
    refusal = run_host("dbc", "--hand", tmp_path / "hand.toml").refusal
    assert "finger 2: name = 'a_long_finger_name_xx': give a name of at most 20" in refusal
    (tmp_path / "hand.toml").write_text(text.replace("xx", "x"))
    for kind in ([], ["--classic"]):
        done = run_host("dbc", "--hand", tmp_path / "hand.toml", "--rate", "100", *kind)
        loaded = cantools.database.load_string(done.out, "dbc")
        assert isinstance(loaded, cantools.database.can.Database)
        periods = {m.name: m.cycle_time for m in loaded.messages}
        assert periods["thumb_Heartbeat"] == 500
        assert periods["thumb_Part1" if kind else "thumb_State"] == 10
        assert periods["a_long_finger_name_x_Emergency"] is None
        assert {m.senders[0] for m in loaded.messages} == {"thumb", "a_long_finger_name_x"}
        for m in loaded.messages:
            assert len(m.name) < 32
            assert m.comment, m.name
            for signal in m.signals:
                assert len(signal.name) < 32
                assert signal.comment, signal.name
                assert signal.minimum is not None
                assert signal.maximum is not None
                assert (signal.unit or "") == UNITS.get(signal.name, signal.unit or "")
        emergency = loaded.get_message_by_name("thumb_Emergency")
        decoded = values_of(emergency.decode(wire.pack_emergency(0x5001, 0x81, 1, int(Status.CAMERA_FAULT))))
        seen = {name for name, value in decoded.items() if value == "yes"}
        assert seen == {"error_generic", "error_manufacturer", "status_camera_fault"}
        assert (decoded["emcy"], decoded["fault"]) == ("camera_lost", "camera_lost")


def test_cantools_decodes_detail_segments() -> None:
    decode, rng = by_cantools(FOLDER / "dbc" / "voronoi_touch_fd.dbc"), Random(3)
    rows = [(rng.uniform(-100, 100), rng.uniform(-100, 100), rng.uniform(-1, 1)) for _ in range(331)]
    for k, segment in enumerate(wire.pack_detail(9, rows, 0)):
        decoded = decode(CanIds().detail(1), segment)
        assert (decoded["segment"], decoded["pin_n"], decoded["sample"]) == (k, 331, 9)
        for i, row in enumerate(rows[k * PINS_PER_SEGMENT : (k + 1) * PINS_PER_SEGMENT]):
            got = [decoded[f"pin{i}_{name}"] for name in ("dx_px", "dy_px", "da")]
            assert got == pytest.approx(row, abs=0.01001)


class Codec:
    """The shipped codecs in C, called from here."""

    def __init__(self, folder: Path) -> None:
        program = compiled(folder / "codec.so", [*C.glob("*.c")], "-Wconversion", "-shared", "-fPIC")
        self._library = ctypes.CDLL(str(program))
        self._library.vt_check_state.restype = self._library.vt_check_p11.restype = ctypes.c_bool
        self._messages = {0: self._message("vt_fd", "state")}
        self._messages |= {tpdo: self._message("vt_classic", f"part{tpdo}") for tpdo in range(1, 5)}

    def _message(self, header: str, message: str) -> tuple[Any, Any, dict[str, Any]]:
        """Its struct as the header has it, its function that unpacks, and those that make floats."""
        text = (C / f"{header}.h").read_text(encoding="utf-8")
        body = text.split(f"struct {header}_{message}_t {{", 1)[1].split("};", 1)[0]
        members = re.findall(r"(u?int\d+)_t (\w+);", body)
        kinds = {name: getattr(ctypes, f"c_{kind}") for kind, name in members}
        floats = {name: self._library[f"{header}_{message}_{name}_decode"] for name in kinds}
        for name, kind in kinds.items():
            floats[name].argtypes, floats[name].restype = (kind,), ctypes.c_float
        struct = type(message, (ctypes.Structure,), {"_fields_": list(kinds.items())})
        return struct, self._library[f"{header}_{message}_unpack"], floats

    def decode(self, tpdo: int, data: bytes) -> dict[str, tuple[int, float]]:
        """Each signal, raw and as a float. tpdo: of a part; 0: a state frame. Raises ValueError: refused"""
        struct, unpack, floats = self._messages[tpdo]
        decoded, size = struct(), ctypes.c_size_t(len(data))
        if tpdo == 0:
            holds = self._library.vt_check_state(data, size)
        else:
            data_id = DATA_ID_CLASSIC | self._library.vt_part_index(tpdo, data)
            holds = self._library.vt_check_p11(data, size, ctypes.c_uint16(data_id))
        if unpack(ctypes.byref(decoded), data, size) or not holds:
            raise ValueError("refused")
        raws = {name: getattr(decoded, name) for name in floats}
        return {name: (raw, floats[name](raw)) for name, raw in raws.items()}


@pytest.fixture(scope="module")
def codec(tmp_path_factory: pytest.TempPathFactory) -> Codec:
    return Codec(tmp_path_factory.mktemp("c"))


def single(value: float) -> float:
    """Rounded to a C float."""
    return ctypes.c_float(value).value


def agrees(name: str, raw: int, as_float: float, value: Any, width: int) -> None:
    """C's raw value is that of the Python value, and its float is that value as a float."""
    f = field_named(name)
    if value == "invalid":
        assert raw == f.raw_nan(width), name
        return
    assert (raw * f.scale if f.scale else raw) == value, name
    assert as_float == single(single(raw) * single(f.scale or 1)), (
        f"{name}: one rounding, of an exact product"
    )
    assert as_float == pytest.approx(value, rel=2.5e-7), name


def test_c_decodes_state_frames_and_classic_parts_bit_identically(codec: Codec) -> None:
    rng, pages = Random(4), {(p.tpdo, p.page): p for p in PARTS}
    for i in range(SAMPLES):
        state = random_state(rng, i)
        frame = wire.pack_state(state, i)
        values = flat(wire.unpack_state(frame))
        row = codec.decode(0, frame)
        for name, value in values.items():
            agrees(name, *row[name], value, 8 * field_named(name).size)
        for tpdo, data in wire.pack_parts(state, i) if i % 5 == 0 else ():
            row = codec.decode(tpdo, data)
            part = pages[tpdo, row["page"][0] if "page" in row else None]
            for name in values.keys() & set(part.fields):
                agrees(name, *row[name], values[name], field_named(name).bits)


@pytest.mark.parametrize("version", [1, 2])
def test_c_refuses_frames_of_versions_before(codec: Codec, version: int) -> None:
    golden = json.loads(FILE.with_name(f"frames_v{version}.json").read_text(encoding="utf-8"))
    for row in golden["samples"]:
        for tpdo, data in [(0, row["frame"]), *row["parts"]]:
            with pytest.raises(ValueError, match="refused"):
                codec.decode(tpdo, bytes.fromhex(data))


def test_canopen_reads_the_eds() -> None:
    dictionary = canopen.import_od(str(FOLDER / "eds" / "voronoi_touch.eds"), node_id=5)
    for o in wire.OBJECTS:
        entry = dictionary[o.index]
        variable = entry if isinstance(entry, canopen.objectdictionary.ODVariable) else entry[o.sub]
        assert (variable.index, variable.subindex) == (o.index, o.sub)
        assert variable.data_type == TYPES[o.type][0], o.name
        assert variable.access_type == o.access, o.name
        if isinstance(o.default, int):
            assert variable.default == o.default + (5 if o.node_id else 0), o.name
        if o.low is not None and o.type != "real32":
            assert (variable.min, variable.max) == (o.low, o.high), o.name
    assert len(dictionary) == len({o.index for o in wire.OBJECTS})
