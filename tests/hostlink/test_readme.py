"""The documentation's code is compiled and run unchanged, and obeys WIRE.md's rules."""

import ctypes
import re
import threading
import time
from dataclasses import replace
from itertools import count
from math import nan
from pathlib import Path

import pytest

import hostlink
from hostlink.order_and_time import RESTART_RUN
from hostlink.recording import LogWriter
from hostlink.wire import NO_CONTROL, State, Status, pack_state
from tests.support.bus import message
from tests.support.c_programs import C, compiled
from tests.support.fingers import make_node
from tests.support.waiting import SOON_S, until

NONE = Status(0)
ROOT = Path(hostlink.__file__).parents[1]


def code(heading: str, language: str) -> str:
    """The first block of code in this language under a heading of a page for its readers."""
    page = ROOT / "docs" / {"python": "robot.md", "c": "firmware.md"}[language]
    text = page.read_text(encoding="utf-8").split(f"## {heading}\n", 1)[1]
    found = re.search(rf"```{language}\n(.*?)```", text, re.DOTALL)
    assert found is not None
    return found[1]


def sample(number: int, mm: float, status: Status = NONE) -> State:
    now_us = time.monotonic_ns() // 1000
    state = State(sample=number, capture_time_us=now_us, latency_us=10.0, displacement_mm=mm, status=status)
    return replace(state, displacement_sigma_mm=1.5 if status & Status.SATURATED else 0.01)


def patiently(program: str) -> str:
    """With longer times: on a busy machine 50 ms may pass between two samples."""
    assert program.count("0.05") == 2
    return program.replace("0.05", "5.0")


def test_python_control_loop_moves_on_valid_live_samples_alone(request: pytest.FixtureRequest) -> None:
    bus = f"virtual:{request.node.name}"
    node, _ = make_node(f"{bus}?node=1")
    sequence = [
        (0.25, Status(0)),
        (nan, Status(0)),
        *((0.25, bit) for bit in Status if bit & (NO_CONTROL | Status.SATURATED)),
        (0.25, Status.TOUCHED | Status.IMAGE_FAULT),
        (1.5, Status(0)),
    ]

    moves: list[str] = []
    moved, numbers = threading.Semaphore(0), count()

    def note(line: str) -> None:
        moves.append(line.split()[0])
        moved.release()

    def answered() -> bool:
        """Whether the program, which hears nothing before its tare has succeeded, answers samples."""
        node.send(sample(next(numbers), 0.5))
        return moved.acquire(timeout=0.005)

    def send() -> None:
        until(answered)
        for mm, status in sequence:
            for _ in range(4):
                node.send(sample(next(numbers), mm, status))
                assert moved.acquire(timeout=SOON_S)

    (sender := threading.Thread(target=send)).start()
    with pytest.raises(SystemExit, match=r"no sample for 5 s"):  # silence ends it
        exec(patiently(code("A control loop", "python").replace("can:can0", bus)), {"print": note})
    sender.join(SOON_S)
    node.close()
    changes = [speed for i, speed in enumerate(moves) if i == 0 or moves[i - 1] != speed]
    assert [c for c in changes if c != "+0.400"] == ["+0.600", "+0.000", "+0.600", "-0.400", "+0.000"]


def test_python_control_loop_without_a_finger_ends_in_one_line(request: pytest.FixtureRequest) -> None:
    program = code("A control loop", "python")
    for address, expected in (
        ("can:no-such-bus", r"no-such-bus"),
        (f"virtual:{request.node.name}", r"no finger was heard for \d+ s"),
    ):
        with pytest.raises(SystemExit, match=expected) as end:
            exec(program.replace("can:can0", address), {})
        assert "\n" not in str(end.value)


def test_python_loop_over_a_recording_finds_its_samples(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    with LogWriter("press.log") as log:
        for k in range(5):
            log.write(message(0x183, pack_state(State(sample=k, displacement_mm=k / 10), k), float(k)))
    exec(code("Record and decode", "python"), {})
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [row[1] for row in rows] == ["3"] * 5
    assert [float(row[2]) for row in rows] == pytest.approx([k / 10 for k in range(5)])


def test_the_wire_document_names_the_restart_run() -> None:
    """The document is generated without the decoder, whose number this is."""
    text = (ROOT / "hostlink" / "WIRE.md").read_text(encoding="utf-8")
    assert f"after {RESTART_RUN} frames of another sequence" in " ".join(text.split())


def test_c_receive_interrupt_drops_old_invalid_and_replayed_samples(tmp_path: Path) -> None:
    (tmp_path / "receive.c").write_text(code("A receive interrupt", "c"))
    sources = [tmp_path / "receive.c", C / "vt_e2e.c", C / "vt_fd.c"]
    program = ctypes.CDLL(str(compiled(tmp_path / "receive.so", sources, "-shared", "-fPIC")))
    program.on_can_frame.argtypes = (ctypes.c_uint32, ctypes.c_char_p, ctypes.c_size_t, ctypes.c_uint32)
    program.pressed.argtypes, program.pressed.restype = (ctypes.c_uint32,), ctypes.c_float
    good = State(displacement_mm=0.5, displacement_sigma_mm=0.01)
    damaged = bytearray(pack_state(good, 9))
    damaged[20] ^= 1
    steps: list[tuple[int, int, bytes, float]] = [
        (0x181, 4_294_967_290, pack_state(good, 1), 0.5),
        (0x181, 4_294_967_294, pack_state(replace(good, displacement_mm=nan), 2), nan),
        (0x181, 2, pack_state(good, 3), 0.5),  # the millisecond counter wrapped
        *((0x181, 2, pack_state(replace(good, status=bit), 4 + i), nan)
          for i, bit in enumerate(b for b in Status if b & NO_CONTROL)),
        (0x181, 6, pack_state(good, 9), 0.5),
        (0x181, 8, bytes(damaged), 0.5),
        *((node, 8, pack_state(replace(good, displacement_mm=2.0), k), 0.5)
          for node, k in ((0x182, 10), (0x181, 9))),  # another's; came again
        *((0, now_ms, b"", 0.5) for now_ms in (5, 26)),  # the frame came after the loop had read its clock
        (0, 27, b"", nan),  # silence
        (0x181, 28, pack_state(good, 12), 0.5),
        *((0x181, 28, pack_state(replace(good, displacement_sigma_mm=x), 13), nan) for x in (1.5, nan)),
    ]  # fmt: skip
    for can_id, now_ms, data, expected in steps:
        if data:
            program.on_can_frame(can_id, data, len(data), now_ms)
        assert program.pressed(now_ms) == pytest.approx(expected, nan_ok=True)
    assert ctypes.c_uint32.in_dll(program, "samples_lost").value == 2, "frames 10 and 11 never came"


@pytest.mark.parametrize(
    "page", sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("deploy/*.md")])
)
def test_addresses_in_commands_are_quoted(page: Path) -> None:
    """zsh takes a bare `?` for a pattern of file names, every shell a bare `&` for the end of a command."""
    text = page.read_text(encoding="utf-8")
    commands = [line for line in text.splitlines() if re.match(r"( {4}|\$ ).*[a-z]:\S", line)]
    for line in commands:
        bare = re.sub(r"'[^']*'|\"[^\"]*\"|#.*", "", line)
        assert not re.search(r":\S*[?&]", bare), line
