"""Recordings: exact round trips, refused formats, damage, and decoding from file."""

from __future__ import annotations

import struct
import tracemalloc
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from random import Random

import can
import pytest

from hostlink.decoder import CanDecoder, Sample, SerialDecoder
from hostlink.errors import LinkError, LogError
from hostlink.recording import LogWriter, SerialWriter, decode_recording, read_log, read_serial
from hostlink.wire import Message, State, encode_frame, pack_parts, pack_state
from tests.support.seeds import SEED
from tests.support.states import random_state

START_S = 1_767_225_600.123457  # 2026: where a double resolves 0.24 us


def traffic(n: int) -> list[can.Message]:
    """State frames, classic parts and heartbeats of two fingers, times in whole microseconds."""
    rng, messages = Random(1), []
    for i in range(n):
        time_s = round(START_S + i * 0.004167, 6)
        state = random_state(rng, i)
        frames = [(0x181, pack_state(state, i), True)]
        frames += [(0x82 + 0x100 * tpdo, part, False) for tpdo, part in pack_parts(state, i)]
        frames.append((0x701, b"\x05", False))
        for k, (can_id, data, fd) in enumerate(frames):
            messages.append(
                can.Message(
                    timestamp=round(time_s + k * 1e-6, 6), arbitration_id=can_id, data=data,
                    is_extended_id=False, is_fd=fd, bitrate_switch=fd, channel=0, is_rx=True,
                )
            )  # fmt: skip
    return messages


@pytest.mark.parametrize("suffix", [".log", ".blf"])
def test_exact_round_trip(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"bus{suffix}"
    messages = traffic(300)
    with LogWriter(path) as writer:
        for message in messages:
            writer.write(message)
    assert (writer.written_n, writer.stepped_n) == (len(messages), 0)
    back = list(read_log(path))
    assert len(back) == len(messages)
    for sent, got in zip(messages, back, strict=True):
        assert got.equals(sent, timestamp_delta=None, check_channel=False), (sent, got)
        assert got.timestamp == sent.timestamp
    decoder = CanDecoder()
    samples = [e for e in decode_recording(path, decoder) if isinstance(e, Sample)]
    assert len(samples) == 600
    assert all(s.lost_n + s.corrupt_n == 0 for s in decoder.statistics.values())
    assert samples[0].arrival_s == messages[0].timestamp


@pytest.mark.parametrize("suffix", [".log", ".blf"])
def test_time_never_runs_backwards(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"bus{suffix}"
    with LogWriter(path) as writer:
        for time_s in (10.0, 12.0, 11.0, 13.0000004):
            writer.write(can.Message(timestamp=time_s + START_S, arbitration_id=1, data=b"x"))
    assert writer.stepped_n == 1
    times = [round(m.timestamp - START_S, 5) for m in read_log(path)]
    assert times == [10.0, 12.0, 12.0, 13.0]


@pytest.mark.parametrize("name", ["a.asc", "a.csv", "a.db", "a.trc", "a.mf4", "a.log.gz", "a.txt", "a"])
def test_formats_that_lose_something_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(LogError, match=r"use \.log or \.blf"):
        LogWriter(tmp_path / name)
    with pytest.raises(LogError, match=name):
        next(iter(read_log(tmp_path / name)))
    assert list(tmp_path.iterdir()) == []


def test_missing_unwritable_and_damaged(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="no such file"):
        list(read_log(tmp_path / "none.log"))
    with pytest.raises(LogError, match="cannot be written"):
        LogWriter(tmp_path / "none" / "bus.log")
    for name, text in (("a.log", "(1.0) can0 181#00\nnonsense\n"), ("b.blf", "nonsense" * 100)):
        (tmp_path / name).write_text(text)
        with pytest.raises(LogError, match=r"damaged after (0 messages|1 message):"):
            list(read_log(tmp_path / name))


def test_serial_round_trip(tmp_path: Path) -> None:
    path, rng = tmp_path / "line.serial", Random(2)
    stream = b"".join(encode_frame(Message.STATE, pack_state(State(sample=i), i)) for i in range(200))
    chunks, at = [], 0
    while at < len(stream):
        size = rng.randrange(0, 200)
        chunks.append((round(at / 1e4, 6), stream[at : at + size]))
        at += size
    with SerialWriter(path) as writer:
        for time_s, data in chunks:
            writer.write(data, time_s)
    assert list(read_serial(path)) == chunks
    decoder = SerialDecoder(3)
    samples = [e for e in decode_recording(path, decoder) if isinstance(e, Sample)]
    assert [s.state.sample for s in samples] == list(range(200))
    path.write_bytes(path.read_bytes()[:-3])
    assert list(read_serial(path)) == chunks[:-1], "an unfinished record is the end"


def test_serial_damage(tmp_path: Path) -> None:
    path = tmp_path / "line.serial"
    path.write_bytes(b"something else entirely")
    with pytest.raises(LogError, match="not a serial recording"):
        list(read_serial(path))
    path.write_bytes(b"voronoi-touch serial 1\n" + b"\xff" * 40)
    with pytest.raises(LogError, match="damaged at byte"):
        list(read_serial(path))


def test_decoder_of_the_wrong_kind(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="CanDecoder"):
        list(decode_recording(tmp_path / "a.log", SerialDecoder()))
    with pytest.raises(TypeError, match="SerialDecoder"):
        list(decode_recording(tmp_path / "a.serial", CanDecoder()))


def test_a_channel_with_a_long_number_is_recorded(tmp_path: Path) -> None:
    message = can.Message(timestamp=1.5, arbitration_id=0x181, data=b"12345678", channel="bus-1d1372d93861")
    with LogWriter(tmp_path / "bus.blf") as writer:
        writer.write(message)
    assert message.channel == "bus-1d1372d93861"
    (back,) = read_log(tmp_path / "bus.blf")
    assert (back.arbitration_id, bytes(back.data), back.channel) == (0x181, b"12345678", 0)


# ---- damage of every kind ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    "line",
    [
        "(1.0) can0 181#00 (1.1) can0 182#11",  # two lines that became one
        "(1.0) can0 181#00(1.1) can0 182#11",
        "(1.0) can0 181#" + "00" * 9,  # more than a classic frame holds
        "(1.0) can0 181##1" + "00" * 65,
        "(1.0) can0 181#0",
        "(nan) can0 181#00",
        "(inf) can0 181#00",
        "(-1.0) can0 181#00",
        "(1.0) can0 FFFFFFFFF#00",
        "(1.0) can0",
        "x" * 100_000,
    ],
    ids=lambda line: line[:24],
)
def test_a_line_of_another_form_is_reported_as_damage(tmp_path: Path, line: str) -> None:
    path = tmp_path / "a.log"
    path.write_text(f"(1.0) can0 181#00\n{line}\n")
    messages = read_log(path)
    assert next(messages).data == b"\0"
    with pytest.raises(LogError, match=r"after 1 message: line 2 is not one that candump -L writes: '"):
        next(messages)


@pytest.mark.parametrize(
    "line",
    [
        "(1.5)  can0  181#0011 R",
        "(1767225600.123457) vcan0 1FFFFFFF##700",
        "(1.0) 0 181#R",
        "(1.0) can0 181#R8 T",
    ],
)
def test_lines_of_other_tools_are_read(tmp_path: Path, line: str) -> None:
    path = tmp_path / "a.log"
    path.write_text(line + "\n\n")
    assert len(list(read_log(path))) == 1


def blf_of(container: bytes, stated: int | None = None) -> bytes:
    """A file with one container; the length in its header may be wrong."""
    body = struct.pack("<H6xL4x", 2, 0) + container
    size = 16 + len(body) if stated is None else stated
    return (
        b"LOGG"
        + struct.pack("<L", 144)
        + bytes(136)
        + struct.pack("<4sHHLL", b"LOBJ", 16, 1, size, 10)
        + body
    )


@pytest.mark.parametrize("stated", [0, 15, 20, 1 << 30, (1 << 32) - 1])
def test_a_false_blf_length_allocates_no_memory(tmp_path: Path, stated: int) -> None:
    path = tmp_path / "a.blf"
    path.write_bytes(blf_of(zlib.compress(b"LOBJ" + bytes(60)), stated))
    with peak_below(4 << 20), pytest.raises(LogError, match=r"damaged after 0 messages: .* at byte 144"):
        list(read_log(path))


def test_a_blf_container_that_unpacks_endlessly_counts_as_damaged(tmp_path: Path) -> None:
    packer = zlib.compressobj(9)
    parts = [packer.compress(bytes(1 << 20)) for _ in range(256)]
    path = tmp_path / "a.blf"
    path.write_bytes(blf_of(b"".join([*parts, packer.flush()])))
    with peak_below(96 << 20), pytest.raises(LogError, match="a container too large at byte 144"):
        list(read_log(path))


@pytest.mark.parametrize("split", [None, 40])
@pytest.mark.parametrize("version", [1, 12289])
def test_an_object_of_no_length_in_a_blf_container_ends_the_reading(
    tmp_path: Path, version: int, split: int | None
) -> None:
    """python-can would go on from it to itself, for ever; it may reach into the next container."""
    whole = struct.pack("<4sHHLL", b"LOBJ", 32, 1, 48, 99) + bytes(32)
    endless = struct.pack("<4sHHLL", b"LOBJ", 32, version, 0, 1) + bytes(48)
    content = whole + endless
    parts = [content] if split is None else [content[:split], content[split:]]
    files = [blf_of(zlib.compress(part)) for part in parts]
    containers = [file[144:] + bytes((len(file) - 144) % 4) for file in files]
    path = tmp_path / "a.blf"
    path.write_bytes(files[0][:144] + b"".join(containers))
    with pytest.raises(LogError, match="a container with an object of no length at byte"):
        list(read_log(path))


def test_a_truncated_blf_file_is_read_up_to_its_end(tmp_path: Path) -> None:
    path = tmp_path / "a.blf"
    with LogWriter(path) as writer:
        for message in traffic(300):
            writer.write(message)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 3 // 4])
    messages = read_log(path)
    assert len(list(islice(messages, 300))) == 300
    with pytest.raises(LogError, match="cut off at byte"):
        list(messages)


@contextmanager
def peak_below(n_bytes: int) -> Iterator[None]:
    tracemalloc.start()
    try:
        yield
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < n_bytes


@pytest.mark.generative
@pytest.mark.parametrize("suffix", [".log", ".blf", ".serial"])
def test_random_damage_is_read_up_to_or_refused(tmp_path: Path, suffix: str) -> None:
    """Randomly changed files give events, then at most one LinkError."""
    path, dice = tmp_path / f"a{suffix}", Random(16 + SEED)
    if suffix == ".serial":
        with SerialWriter(path) as serial:
            for i in range(20):
                serial.write(encode_frame(Message.STATE, pack_state(State(sample=i), i)), i / 10)
    else:
        with LogWriter(path) as writer:
            for message in traffic(10):
                writer.write(message)
    good = path.read_bytes()
    lengths = [0, 1, 16, 32, 0xFFFF, 1 << 24, (1 << 31) - 1, 1 << 31, (1 << 32) - 1]
    whole_n = 0
    with peak_below(64 << 20):
        for _ in range(600):
            data = bytearray(good)
            for _ in range(dice.choice([1, 1, 2, 5])):
                at = dice.randrange(len(data) - 8)
                match dice.randrange(5):
                    case 0:
                        data[at] ^= 1 << dice.randrange(8)
                    case 1:
                        data[at : at + 4] = struct.pack("<I", dice.choice(lengths))
                    case 2:
                        del data[at : at + dice.randrange(1, 8)]
                    case 3:
                        data[at:at] = data[at : at + dice.randrange(1, 64)]
                    case _:
                        end = data.find(b"\n", at)
                        del data[end : end + 1 if end > 0 else end]
            path.write_bytes(data)
            try:
                list(decode_recording(path))
                whole_n += 1
            except LinkError:
                pass
    assert 0 < whole_n < 600
