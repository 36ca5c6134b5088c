"""Recordings: exact round trips, refused formats, damage, and decoding from file."""

import struct
import zlib
from contextlib import nullcontext
from datetime import datetime
from functools import partial
from itertools import islice
from math import nan
from pathlib import Path
from random import Random

import can
import numpy as np
import pytest

from edge.recording.writer import Recorder
from edge.types import Clock, Frame
from hostlink.decoder import CanDecoder, Sample, SerialDecoder
from hostlink.errors import LinkError, LogError, UsageError
from hostlink.log_formats import HEAD_N
from hostlink.recording import LogWriter, SerialWriter, decode_recording, read_log, read_serial
from hostlink.wire import Message, State, encode_frame, pack_parts, pack_state, unpack_state
from tests.support.bus import message
from tests.support.damage import damaged
from tests.support.memory import bounded_memory
from tests.support.seeds import SEED
from tests.support.states import random_state

MORNING_S = datetime(2026, 11, 26, 8, 0, 0, 500_000).timestamp()
START_S = 1_767_225_600.123457  # 2026: where a double resolves 0.24 us


def traffic(n: int) -> list[can.Message]:
    """State frames, classic parts and heartbeats of two fingers, times in whole microseconds."""
    rng, messages = Random(1), []
    for i in range(n):
        time_s = round(START_S + i * 0.004167, 6)
        state = random_state(rng, i)
        frames = [(0x181, pack_state(state, i)), (0x701, b"\x05")]
        frames += [(0x82 + 0x100 * tpdo, part) for tpdo, part in pack_parts(state, i)]
        for k, (can_id, data) in enumerate(frames):
            messages.append(message(can_id, data, round(time_s + k * 1e-6, 6)))
            messages[-1].bitrate_switch, messages[-1].channel = messages[-1].is_fd, 0
    return messages


def write_log(path: Path, messages: list[can.Message]) -> LogWriter:
    with LogWriter(path) as writer:
        for message in messages:
            writer.write(message)
    return writer


@pytest.mark.parametrize("suffix", [".log", ".blf"])
def test_exact_round_trip(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"bus{suffix}"
    messages = traffic(300)
    writer = write_log(path, messages)
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
    given = (10.0, 12.0, 11.0, 13.0000004)
    writer = write_log(path, [can.Message(START_S + time_s, 1, data=b"x") for time_s in given])
    assert writer.stepped_n == 1
    read = [round(m.timestamp - START_S, 5) for m in read_log(path)]
    assert read == [10.0, 12.0, 12.0, 13.0]


@pytest.mark.parametrize("name", ["a.asc", "a.csv", "a.db", "a.trc", "a.mf4", "a.log.gz", "a.txt", "a"])
def test_formats_that_lose_something_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(LogError, match=r"use \.log or \.blf"):
        LogWriter(tmp_path / name)
    with pytest.raises(LogError, match=name):
        next(iter(read_log(tmp_path / name)))
    assert list(tmp_path.iterdir()) == []


def test_an_unwritable_log_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="cannot be written"):
        LogWriter(tmp_path / "none" / "bus.log")


def blf_of(container: bytes, stated: int | None = None) -> bytes:
    """A file with one container; the length in its header may be wrong."""
    body = struct.pack("<H6xL4x", 2, 0) + container
    size = 16 + len(body) if stated is None else stated
    head = b"LOGG" + struct.pack("<L", 144) + bytes(136)
    return head + struct.pack("<4sHHLL", b"LOBJ", 16, 1, size, 10) + body


FALSE_LENGTHS = [
    blf_of(zlib.compress(b"LOBJ" + bytes(60)), size) for size in (0, 15, 20, 1 << 30, (1 << 32) - 1)
]


@pytest.mark.parametrize(
    ("name", "content", "stated"),
    [
        ("b.blf", b"nonsense" * 100, "damaged after 0 messages:"),
        ("line.serial", b"something else entirely", "not a serial recording"),
        ("line.serial", b"voronoi-touch serial 1\n" + b"\xff" * 40, "damaged at byte"),
        *(("a.blf", data, r"damaged after 0 messages: .* at byte 144") for data in FALSE_LENGTHS),
    ],
    ids=lambda value: value[:20] if isinstance(value, str) else "",
)
def test_damage_is_named_and_allocates_no_memory(
    tmp_path: Path, name: str, content: bytes, stated: str
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with bounded_memory(4 << 20), pytest.raises(LogError, match=stated):
        list(read_serial(path) if path.suffix == ".serial" else read_log(path))


def test_a_blf_container_that_unpacks_endlessly_counts_as_damaged(tmp_path: Path) -> None:
    packer = zlib.compressobj(9)
    parts = [packer.compress(bytes(1 << 20)) for _ in range(256)]
    path = tmp_path / "a.blf"
    path.write_bytes(blf_of(b"".join([*parts, packer.flush()])))
    with bounded_memory(96 << 20), pytest.raises(LogError, match="a container too large at byte 144"):
        list(read_log(path))


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


def test_decoder_of_the_wrong_kind(tmp_path: Path) -> None:
    for name, wrong, right in (("a.log", SerialDecoder(), "Can"), ("a.serial", CanDecoder(), "Serial")):
        with pytest.raises(TypeError, match=f"{right}Decoder"):
            list(decode_recording(tmp_path / name, wrong))


def test_a_channel_with_a_long_number_is_recorded(tmp_path: Path) -> None:
    message = can.Message(timestamp=1.5, arbitration_id=0x181, data=b"12345678", channel="bus-1d1372d93861")
    write_log(tmp_path / "bus.blf", [message])
    assert message.channel == "bus-1d1372d93861"
    (back,) = read_log(tmp_path / "bus.blf")
    assert (back.arbitration_id, bytes(back.data), back.channel) == (0x181, b"12345678", 0)


@pytest.mark.parametrize(
    "line",
    [
        "DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 3)",
        "(1.0) can0 45123#81:00:12345678#11223344.556677",  # CAN XL
        "  can0  123   [0004]  (00|567)  11 22 33 44",
        "(1.0) can0 181#00 (1.1) can0 182#11",  # two lines that became one
        "(1.0) can0 181#00 later",
        "(1.0) can0 181#" + "00" * 9,  # more than a classic frame holds
        "(1.0) can0 181#0",
        "(nan) can0 181#00",
        "(-1.0) can0 181#00",
        "(2026-13-45 00:00:00.000000) can0 181#00",
        "(1.0) can0 FFFFFFFFF#00",
        "  can0  181   [8]  11 22 33",
        "\0" * 4096,
        "x" * 100_000,
    ],
    ids=lambda line: line[:24],
)
def test_a_foreign_line_costs_that_line(tmp_path: Path, line: str, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "a.log"
    path.write_text(f"(1.0) can0 181#00\n{line}\n(1.1) can0 182#11\n")
    assert [bytes(m.data) for m in read_log(path)] == [b"\0", b"\x11"]
    (warning,) = caplog.messages
    assert warning.startswith(f"{path}: skipped lines that are no CAN frames: 1; line 2, ")
    path.write_text(line)
    with pytest.raises(LogError, match="no line is a frame as candump or Vector's tools write it: line 1, "):
        list(read_log(path))


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("(1.5)  can0  181#0011 R", (1.5, "can0", 0x181, b"\0\x11")),
        ("(1767225600.123457) vcan0 1FFFFFFF##700", (1767225600.123457, "vcan0", 0x1FFFFFFF, b"\0")),
        ("(1.0) 0 181#R", (1.0, 0, 0x181, b"")),
        ("(1.0) can0 181#R8 T", (1.0, "can0", 0x181, b"")),
        ("(1.0) can0 181#0011223344556677_E", (1.0, "can0", 0x181, bytes.fromhex("0011223344556677"))),
        ("  can0  181   [2]  00 11", (nan, "can0", 0x181, b"\0\x11")),
        ("  can0       181   [2]  00 11   '..'", (nan, "can0", 0x181, b"\0\x11")),
        (" (1.5)  can0  181  [02]  00 11", (1.5, "can0", 0x181, b"\0\x11")),
        (" (000.000000)  can0  RX B E  181  [01]  00", (0.0, "can0", 0x181, b"\0")),
        (" (1.5)  can0  1ABCDEF0   [0] ", (1.5, "can0", 0x1ABCDEF0, b"")),
        (" (2026-11-26 08:00:00.500000000)  can0  181  [01]  00", (MORNING_S, "can0", 0x181, b"\0")),
        ("  can0  181   [0]  remote request", (nan, "can0", 0x181, b"")),
        ("  can0  20000004   [1]  00    ERRORFRAME", (nan, "can0", 4, b"\0")),
    ],
)
def test_lines_of_candump_are_read(
    tmp_path: Path, line: str, expected: tuple[float, str | int, int, bytes]
) -> None:
    path = tmp_path / "a.log"
    path.write_text(line + "\n\n")
    (m,) = read_log(path)
    assert (m.channel, m.arbitration_id, bytes(m.data)) == expected[1:]
    assert m.timestamp == pytest.approx(expected[0], nan_ok=True)


def as_candump(times_s: list[float], lines: list[str], way: str) -> str:
    """What `candump` prints for frames: with -L and -l, or plain with -t and this letter, or without."""
    text, before_s = "", times_s[0]
    for time_s, line in zip(times_s, lines, strict=True):
        channel, can_id, data = line.split()
        stamp = {
            "L": f"({time_s:017.6f}) ",
            "a": f" ({time_s:017.6f}) ",
            "A": f" ({datetime.fromtimestamp(time_s):%Y-%m-%d %H:%M:%S.%f}) ",
            "d": f" ({time_s - before_s:010.6f}) ",
            "z": f" ({time_s - times_s[0]:010.6f}) ",
            "": " ",
        }[way]
        before_s = time_s
        pairs = " ".join(data[k : k + 2] for k in range(0, len(data), 2))
        plain = f" {channel}  {can_id}  [{len(data) // 2:02d}]  {pairs}"
        text += stamp + (f"{channel} {can_id}##1{data}" if way == "L" else plain) + "\n"
    return text


@pytest.mark.parametrize("way", ["L", "a", "A", "d", "z", ""])
@pytest.mark.parametrize("swapped", [False, True])
def test_each_kind_of_candump_s_times_is_recognised(tmp_path: Path, way: str, swapped: bool) -> None:
    """Two sockets of one candump may give neighbours in the wrong order, by less than a frame's period."""
    rng, times_s = Random(5), [START_S]
    for _ in range(600):
        times_s.append(round(times_s[-1] + rng.uniform(0.0001, 0.01), 6))
    if swapped and way != "d":  # candump itself gives no negative difference
        times_s[100:102] = reversed(times_s[100:102])
    lines = [f"can0 181 {pack_state(State(sample=k), k).hex().upper()}" for k in range(len(times_s))]
    path = tmp_path / "a.log"
    path.write_text(as_candump(times_s, lines, way))
    begin_s = {"": nan, "d": START_S, "z": START_S}.get(way, 0.0)
    wanted = [time_s - begin_s for time_s in times_s]
    assert [m.timestamp for m in read_log(path)] == pytest.approx(wanted, abs=2e-6, nan_ok=True)
    samples = [e for e in decode_recording(path) if isinstance(e, Sample)]
    assert [s.state.sample for s in samples] == list(range(len(times_s)))


def test_a_log_of_few_frames_or_equal_times_is_as_written(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    for times_s in ([0.0, 0.1, 0.1], [7.0], []):
        path.write_text("".join(f"({time_s}) can0 181#00\n" for time_s in times_s))
        assert [m.timestamp for m in read_log(path)] == times_s


@pytest.mark.parametrize("suffix", [".log", ".asc"])
def test_a_file_of_nothing_is_no_line(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_text("(1.0) can0 181#00\n" if suffix == ".log" else "1.0 1 181 Rx d 1 00\n")
    with path.open("r+b") as file:
        file.truncate(30 << 30)
    messages = read_log(path)
    assert next(messages).data == b"\0"
    with pytest.raises(LogError, match="damaged after 1 message: line 2 has no end"):
        next(messages)


def test_a_line_that_is_skipped_costs_no_time(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    lines = ["(0.5) can0 181 [1] 00", "(0.25) can0 123 [0004] (00|567) 11", "remark", "can0 181 [1] 00"]
    path.write_text("\ufeff" + "\n".join(20 * lines), encoding="utf-8")
    assert [m.timestamp for m in read_log(path)] == [0.75 * k + at for k in range(20) for at in (0.5, 0.75)]


ASC_HEAD = "date Wed Jul 1 {} 2026\nbase {}  timestamps {}\nno internal events logged\n"
ASC_BODY = """\
   0.500000 Start of measurement
   0.500000 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%
   {0} 1  {3}             Rx   d 2 {4} {5}  Length = 240015 BitCount = 124 ID = 385
   {1} CANFD   2 Rx        {3}  Finger_State  1 0 8 8 {4} {5} 00 00 00 00 00 00   130000  130 3000 0 0 0 0 0
   {2} 1  ErrorFrame
   {2} CANXL   1 Tx        {3}  0 0 4 {4} {5} 00 00
"""


@pytest.mark.parametrize(("base", "numbers"), [("hex", ("181", "0A", "ff")), ("dec", ("385", "10", "255"))])
@pytest.mark.parametrize(
    ("kind", "times"), [("absolute", ("1.0", "1.25", "1.5")), ("relative", ("0.5", "0.25", "0.25"))]
)
@pytest.mark.parametrize("clock", ["13:00:00.250", "01:00:00.250 pm"])
def test_lines_of_vector_s_tools_are_read(
    tmp_path: Path, base: str, numbers: tuple[str, ...], kind: str, times: tuple[str, ...], clock: str
) -> None:
    path = tmp_path / "a.asc"
    path.write_text(ASC_HEAD.format(clock, base, kind) + ASC_BODY.format(*times, *numbers))
    messages = list(read_log(path))
    begin_s = datetime(2026, 7, 1, 13, 0, 0, 250_000).timestamp()
    wanted = (1.0, 1.25, 1.5) if kind == "absolute" else (1.5, 1.75, 2.0)
    assert [m.timestamp - begin_s for m in messages] == pytest.approx(wanted)
    assert [(m.channel, m.is_fd, m.is_error_frame) for m in messages] == [
        (0, False, False), (1, True, False), (0, False, True)
    ]  # fmt: skip
    assert [m.arbitration_id for m in messages[:2]] == [0x181] * 2
    assert [bytes(m.data) for m in messages[:2]] == [b"\x0a\xff", b"\x0a\xff" + bytes(6)]


@pytest.mark.parametrize("suffix", [".log", ".blf", ".asc"])
def test_fingers_with_one_number_on_two_channels_are_two(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"bus{suffix}"
    write_buses(path, {0: 1, 1: 1})
    names = ("can0", "can1") if suffix == ".log" else ("0", "1")
    for finger in (None, 1):
        with pytest.raises(UsageError, match=f"finger 1 is on several channels: {', '.join(names)}; choose"):
            next(decode_recording(path, finger=finger))
    for channel, name in enumerate(names):
        for wanted in (name, channel if suffix != ".log" else name):
            samples = [e for e in decode_recording(path, channel=wanted) if isinstance(e, Sample)]
            assert [s.state.displacement_mm for s in samples] == [channel + 1] * 40
            assert [s.lost_n for s in samples] == [0] * 40
    with pytest.raises(UsageError, match=f"no channel can7; it has {', '.join(names)}"):
        list(decode_recording(path, channel="can7"))
    # Different numbers, or samples of one only, need no choice.
    write_buses(path, {0: 1, 1: 2})
    assert len([e for e in decode_recording(path) if isinstance(e, Sample)]) == 80
    write_buses(path, {0: 1, 1: 1}, late=HEAD_N)
    assert list(decode_recording(path, finger=2)) == []
    events = decode_recording(path)
    assert {e.state.displacement_mm for e in islice(events, HEAD_N) if isinstance(e, Sample)} == {1.0}
    with pytest.raises(UsageError, match="is on several channels"):
        next(events)


def write_buses(path: Path, finger_of: dict[int, int], late: int = 0, samples_n: int = 40) -> None:
    """Samples of a finger on each channel, whose depth tells which; the second may begin late."""
    writer = can.ASCWriter(path) if path.suffix == ".asc" else LogWriter(path)
    write = writer.on_message_received if isinstance(writer, can.ASCWriter) else writer.write
    order = [(k, c) for k in range(samples_n) for c in finger_of]
    if late:
        order = [(k, 0) for k in range(late)] + [(k, 1) for k in range(samples_n)]
    for n, (k, channel) in enumerate(order):
        state = State(sample=k, capture_time_us=k * 4000, displacement_mm=channel + 1)
        sent = message(0x180 + finger_of[channel], pack_state(state, k & 0xFF), START_S + n * 0.002)
        sent.channel = f"can{channel}" if path.suffix == ".log" else channel
        write(sent)
    writer.stop() if isinstance(writer, can.ASCWriter) else writer.close()


def write_edge(path: Path, states: list[State], finger: int = 1) -> None:
    """Samples 10 ms apart in a recording of the finger itself."""
    with Recorder(path) as recorder:
        for k, state in enumerate(states):
            frame = Frame(np.zeros((4, 4), np.uint8), k * 10_000_000, k, Clock.HOST)
            recorder.sample(frame, finger, partial(unpack_state, pack_state(state, k)))


@pytest.mark.parametrize("split", [None, 40])
@pytest.mark.parametrize("version", [1, 12289])
def test_an_object_of_no_length_costs_what_follows(tmp_path: Path, version: int, split: int | None) -> None:
    """A reader that trusts it goes on from it to itself, for ever; it may reach into the next container."""
    path = tmp_path / "a.blf"
    write_log(path, traffic(5))
    (good,) = unpacked(path.read_bytes())
    endless = struct.pack("<4sHHLL", b"LOBJ", 32, version, 0, 1) + bytes(48)
    content = good + endless + good
    parts = [content] if split is None else [content[:split], content[split:]]
    files = [blf_of(zlib.compress(part)) for part in parts]
    containers = [file[144:] + bytes((len(file) - 144) % 4) for file in files]
    path.write_bytes(files[0][:144] + b"".join(containers))
    messages = read_log(path)
    for sent in traffic(5):
        assert next(messages).data == sent.data
    with pytest.raises(LogError, match="a container with an object of no length at byte"):
        next(messages)


def unpacked(data: bytes) -> list[bytes]:
    """The contents of a whole file's containers."""
    found, at = [], 144
    while at < len(data):
        (size,) = struct.unpack_from("<L", data, at + 8)
        found.append(zlib.decompress(data[at + 32 : at + size]))
        at += size + size % 4
    return found


@pytest.mark.parametrize(("cut", "why"), [(False, "at byte"), (True, "cut off at byte")])
def test_damage_in_a_blf_file_costs_what_follows_it(tmp_path: Path, cut: bool, why: str) -> None:
    path = tmp_path / "a.blf"
    write_log(path, traffic(200))
    data = path.read_bytes()
    half = len(data) // 2
    path.write_bytes(data[:half] if cut else data[:half] + bytes(len(data) - half))
    messages = read_log(path)
    assert len(list(islice(messages, 100))) == 100
    with pytest.raises(LogError, match=why):
        list(messages)


def test_fd_messages_of_both_kinds_of_object_are_read(tmp_path: Path) -> None:
    """Vector's tools write objects of type 101, python-can those of type 100."""
    path, data = tmp_path / "a.blf", pack_state(State(sample=3), 3)
    head = struct.pack("<4sHHLLLHHQ", b"LOBJ", 32, 1, 32 + 40 + 64, 101, 2, 0, 0, 1_500_000_000)
    fields = (2, 15, 64, 0, 0x181, 0, 0x3000, 0, 0, 0, 0, 0, 0, 0, 0)
    path.write_bytes(blf_of(zlib.compress(head + struct.pack("<BBBBLLLLLLLHBBL", *fields) + data)))
    (message,) = read_log(path)
    assert (message.channel, message.arbitration_id, message.timestamp) == (1, 0x181, 1.5)
    assert (message.is_fd, message.bitrate_switch, bytes(message.data)) == (True, True, data)
    (event,) = decode_recording(path)
    assert isinstance(event, Sample)


@pytest.mark.generative
@pytest.mark.parametrize("name", ["a.log", "plain.log", "a.asc", "a.blf", "a.serial"])
def test_random_damage_is_read_up_to_or_refused(tmp_path: Path, name: str) -> None:
    """Randomly changed files give events, then at most one LinkError; a line of text costs itself alone."""
    path, dice = tmp_path / name, Random(16 + SEED)
    if path.suffix == ".serial":
        with SerialWriter(path) as serial:
            for i in range(20):
                serial.write(encode_frame(Message.STATE, pack_state(State(sample=i), i)), i / 10)
    elif name == "plain.log":
        lines = [f"can0 181 {pack_state(State(sample=k), k).hex()}" for k in range(12)]
        path.write_text(as_candump([k / 100 for k in range(12)], lines, "d"))
    else:
        write_buses(path, {0: 1, 1: 2}, samples_n=6)
    good, is_text = path.read_bytes(), path.suffix in (".log", ".asc")
    refused: list[str] = []
    with nullcontext() if is_text else bounded_memory(64 << 20):  # text has no lengths that could be believed
        for _ in range(600):
            path.write_bytes(damaged(dice, good))
            try:
                list(decode_recording(path))
            except LinkError as error:
                refused.append(str(error))
    assert 0 < len(refused) < 600 or is_text
    assert not any("damaged after" in text for text in refused) or not is_text
