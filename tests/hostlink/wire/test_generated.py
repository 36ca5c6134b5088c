"""The generated files are fresh, and other tools decode with them what our decoder decodes."""

import json
import struct
import subprocess
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import canmatrix.formats
import canopen
import cantools
import pytest
from canmatrix.ArbitrationId import ArbitrationId
from cantools.database.can import Signal
from cantools.database.namedsignalvalue import NamedSignalValue
from cantools.typechecking import DecodeResultType

import hostlink
from hostlink import wire
from hostlink.wire import CanIds, State, Status
from hostlink.wire.detail import PINS_PER_SEGMENT
from hostlink.wire.fields import LAYOUT, PARTS, field_named
from hostlink.wire.generate import generate
from hostlink.wire.generate.dbc import classic_signals, state_signals
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
    (tmp_path / "hand.toml").write_text(
        '[[finger]]\nname = "thumb"\nnode = 3\n[[finger]]\nname = "a_long_finger_name_xx"\nnode = 4\n'
    )
    refusal = run_host("dbc", "--hand", tmp_path / "hand.toml").refusal
    assert "finger 2: name = 'a_long_finger_name_xx': give a name of at most 20" in refusal
    (tmp_path / "hand.toml").write_text(
        '[[finger]]\nname = "thumb"\nnode = 3\n[[finger]]\nname = "a_long_finger_name_x"\nnode = 4\n'
    )
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


def _c_program(raws: dict[str, list[Signal]]) -> str:
    """Reads records (byte: message number, byte: length, data) and prints every signal: raw, float bits."""
    cases = []
    for number, (message, signals) in enumerate(raws.items()):
        prefix = "vt_fd" if message == "state" else "vt_classic"
        check = (
            "vt_check_state(data, size)"
            if message == "state"
            else "vt_check_p11(data, size, "
            f"(uint16_t)((int)VT_DATA_ID_PART | vt_part_index({number}u, data)))"
        )
        prints = "".join(
            f"        f = (float){prefix}_{message}_{s.name}_decode(m.{s.name}); memcpy(&u, &f, 4);\n"
            f'        printf("{s.name} %ld %08lx ", (long)m.{s.name}, (unsigned long)u);\n'
            for s in signals
        )
        cases.append(
            f"    case {number}: {{\n        struct {prefix}_{message}_t m;\n"
            f"        memset(&m, 0, sizeof m);\n"
            f"        if ({prefix}_{message}_unpack(&m, data, size) != 0 || !({check})) return 2;\n{prints}"
            "        break; }\n"
        )
    return (
        '#include <stdio.h>\n#include <string.h>\n#include "vt_fd.h"\n#include "vt_classic.h"\n'
        '#include "vt_e2e.h"\n\nint main(void)\n{\n    uint8_t head[2], data[64];\n    uint32_t u;\n'
        "    float f;\n    while (fread(head, 1, 2, stdin) == 2) {\n        const size_t size = head[1];\n"
        "        if (fread(data, 1, size, stdin) != size) return 1;\n        switch (head[0]) {\n"
        + "".join(cases)
        + '    default: return 3;\n    }\n    printf("\\n");\n    }\n    return 0;\n}\n'
    )


@pytest.fixture(scope="module")
def c_decoder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped codecs, and a program that prints what they decode."""
    folder = tmp_path_factory.mktemp("c")
    signals = {"state": state_signals(), **{f"part{i}": classic_signals(i) for i in range(1, 5)}}
    (folder / "main.c").write_text(_c_program(signals))
    for source in C.glob("*.c"):
        compiled(folder / f"{source.stem}.o", [source], "-Wconversion", "-c")
    return compiled(folder / "decode", [folder / "main.c", *folder.glob("*.o")])


def run_c(program: Path, records: list[tuple[int, bytes]]) -> list[dict[str, tuple[int, str]]]:
    stream = b"".join(bytes((number, len(data))) + data for number, data in records)
    result = subprocess.run([str(program)], input=stream, capture_output=True, check=True)
    rows = []
    for line in result.stdout.decode().splitlines():
        words = line.split()
        rows.append({words[i]: (int(words[i + 1]), words[i + 2]) for i in range(0, len(words), 3)})
    return rows


def single(value: float) -> float:
    """Rounded to a C float."""
    return float(struct.unpack("<f", struct.pack("<f", value))[0])


def c_float(raw: int, scale: float) -> str:
    """Bits of the C codec's `(float)raw * scale_f`: one rounding, of an exact product in double."""
    return struct.pack(">f", single(raw) * single(scale)).hex()


def agrees(name: str, raw: int, bits: str, value: float, width: int) -> None:
    """C's raw value is that of the Python value, and its float is that value as a float."""
    f = field_named(name)
    if value != value:
        assert raw == f.raw_nan(width), name
        return
    assert (raw * f.scale if f.scale else raw) == value, name
    assert bits == c_float(raw, f.scale or 1), name
    assert struct.unpack(">f", bytes.fromhex(bits))[0] == pytest.approx(value, rel=2.5e-7), name


def number_of(value: object) -> float:
    return float("nan") if value == "invalid" else value  # type: ignore[return-value]


def test_c_decodes_state_frames_bit_identically(c_decoder: Path) -> None:
    rng = Random(4)
    frames = [wire.pack_state(random_state(rng, i), i) for i in range(SAMPLES)]
    for frame, row in zip(frames, run_c(c_decoder, [(0, f) for f in frames]), strict=True):
        for name, value in flat(wire.unpack_state(frame)).items():
            agrees(name, *row[name], number_of(value), 8 * field_named(name).size)


def test_c_decodes_classic_parts_bit_identically(c_decoder: Path) -> None:
    rng = Random(5)
    states = [random_state(rng, i) for i in range(SAMPLES // 5)]
    sent = [(s, tpdo, part) for i, s in enumerate(states) for tpdo, part in wire.pack_parts(s, i)]
    assert len(sent) > SAMPLES
    rows = run_c(c_decoder, [(tpdo, part) for _, tpdo, part in sent])
    pages = {(p.tpdo, p.page): p for p in PARTS}
    for (state, tpdo, _), row in zip(sent, rows, strict=True):
        values = flat(wire.unpack_state(wire.pack_state(state, 0)))
        part = pages[tpdo, row["page"][0] if "page" in row else None]
        for name in part.fields:
            if name in values:
                agrees(name, *row[name], number_of(values[name]), field_named(name).bits)


@pytest.mark.parametrize("version", [1, 2])
def test_c_refuses_frames_of_versions_before(c_decoder: Path, version: int) -> None:
    golden = json.loads(FILE.with_name(f"frames_v{version}.json").read_text(encoding="utf-8"))
    for row in golden["samples"]:
        for number, data in [(0, row["frame"]), *row["parts"]]:
            with pytest.raises(subprocess.CalledProcessError):
                run_c(c_decoder, [(number, bytes.fromhex(data))])


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
