"""The C receiver on every link: what Python decodes it decodes too, and a real node answers its requests."""

import os
import select
import shutil
import subprocess
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from dataclasses import replace
from math import nan
from pathlib import Path
from random import Random

import can
import pytest

from hostlink import RestFrameOutcome, RestFrameReason, RestFrameState, wire
from hostlink.errors import LinkError
from hostlink.wire import Message, State, Status
from hostlink.wire.parts import Assembler, unpack_part
from hostlink.wire.serial import BODY_MAX, decode_frame
from tests.support import processes
from tests.support.bus import on_line, state_on_line
from tests.support.c_programs import C, compiled
from tests.support.fingers import Application, make_node
from tests.support.ptys import Ptys
from tests.support.states import random_state, same
from tests.support.waiting import SOON_S, present

SANITIZED = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
OWN = ("vt_e2e.c", "vt_parts.c", "vt_serial.c", "vt_request.c", "examples/receiver.c")
# Advisory rules that the files do not keep: 15.5 one exit a function (guards read better), 2.5 unused macros
# (a header offers more than each program needs), 8.9 tables within the function that uses them.
MISRA_LEFT_OUT = ("15.5", "2.5", "8.9")
BUSY = RestFrameState.BUSY


def receiver(folder: Path, *options: str) -> Path:
    sources = [Path(__file__).parent / "receiver_main.c", C / "vt_fd.c", *(C / name for name in OWN)]
    return compiled(folder / "receiver", sources, "-Wconversion", *SANITIZED, *options)


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return receiver(tmp_path_factory.mktemp("c"))


@pytest.fixture(scope="module")
def serial_program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return receiver(tmp_path_factory.mktemp("serial"), "-DLINK_SERIAL")


def run(program: Path, commands: list[str]) -> list[list[str]]:
    done = processes.program(program, input="\n".join(commands) + "\n", check=True)
    return [line.split(" ") for line in done.stdout.splitlines()]


def test_our_c_files_follow_misra_rules() -> None:
    cppcheck = shutil.which("cppcheck")
    if cppcheck is None:
        pytest.skip("no cppcheck")
    left_out = [f"--suppress=misra-c2012-{rule}" for rule in MISRA_LEFT_OUT]
    command = [cppcheck, "--quiet", "--std=c99", "--enable=warning,style,performance,portability", *left_out]
    checked = processes.program(*command, "--addon=misra", "--error-exitcode=1", *OWN, cwd=C)
    assert (checked.returncode, checked.stderr) == (0, "")


def mostly_usable(rng: Random, i: int) -> State:
    """A random sample; most may move a hand."""
    state = random_state(rng, i)
    return replace(state, status=Status.TOUCHED, displacement_sigma_mm=0.1) if rng.random() < 0.8 else state


def disturbed(rng: Random, parts: list[tuple[int, bytes]]) -> list[tuple[int, bytes]]:
    """Samples after a bad bus: lost, damaged, repeated and swapped ones."""
    out: list[tuple[int, bytes]] = []
    for tpdo, data in parts:
        luck = rng.random()
        if luck < 0.004:
            continue
        if luck < 0.008:
            broken = bytearray(data)
            broken[rng.randrange(8)] ^= 1 << rng.randrange(8)
            out.append((tpdo, bytes(broken)))
        elif luck < 0.012:
            out += [(tpdo, data)] * 2
        elif luck < 0.016 and out:
            out.insert(-1, (tpdo, data))
        else:
            out.append((tpdo, data))
    return out


def test_parts_are_assembled_as_in_python(program: Path) -> None:
    rng, assembler = Random(1), Assembler()
    parts = [part for i in range(3000) for part in wire.pack_parts(random_state(rng, i), i)]
    sent = disturbed(rng, parts)
    expected: list[State] = []
    for tpdo, data in sent:
        with suppress(LinkError):
            if (state := assembler.add(unpack_part(tpdo, data))) is not None:
                expected.append(state)
    rows = run(program, [f"part {tpdo} {data.hex()}" for tpdo, data in sent])
    got = [wire.unpack_state(bytes.fromhex(row[1])) for row in rows]  # which checks CRC, version and check
    assert 2000 < len(expected) < 3000
    assert len(got) == len(expected)
    assert all(same(a, b) for a, b in zip(got, expected, strict=True))


def line_bytes(rng: Random, frames: int) -> bytes:
    """Samples, detail, heartbeats and emergencies, with noise, damage and pieces that were cut off."""
    out = bytearray(b"\x07\x11half a frame")
    for i in range(frames):
        state = state_on_line(mostly_usable(rng, i), i)
        out += state
        if i % 7 == 0:
            rows = [(rng.uniform(-9, 9), rng.uniform(-9, 9), 0.1)] * 127
            for segment in wire.pack_detail(i, rows, i):
                out += wire.encode_frame(Message.DETAIL, segment)
        if i % 11 == 0:
            out += on_line(Message.HEARTBEAT, b"\x05", i & 0xFF)
        if i % 13 == 0:
            broken = bytearray(state)
            broken[rng.randrange(len(broken))] ^= 1 << rng.randrange(8)
            out += broken
        if i % 17 == 0:
            out += rng.randbytes(rng.randrange(700))
        if i % 19 == 0:
            out += state[: rng.randrange(len(state))]
    return bytes(out)


def test_frames_of_a_line_are_found_as_python_finds_them(program: Path) -> None:
    data = line_bytes(Random(2), 400)
    expected = []
    for block in data.split(b"\0"):
        with suppress(LinkError):
            kind, payload = decode_frame(block)
            expected.append([str(kind), payload.hex()])
    rows = run(program, [f"line {data[i : i + 997].hex()}" for i in range(0, len(data), 997)])
    assert rows == expected
    assert len(rows) > 1000


def test_frames_are_packed_as_python_packs_them(program: Path) -> None:
    rng = Random(3)
    bodies = [rng.randbytes(size) for size in range(BODY_MAX + 1)]
    bodies += [bytes(size) for size in (1, 8, BODY_MAX)]
    bodies += [b"\x55" * size for size in range(244, BODY_MAX + 1)]
    expected = [["packed", on_line(Message.REQUEST, body, i & 0xFF).hex()] for i, body in enumerate(bodies)]
    commands = [f"pack 2 {i & 0xFF} {body.hex() or '-'}" for i, body in enumerate(bodies)]
    too_long = f"pack 2 0 {bytes(BODY_MAX + 1).hex()}"
    assert run(program, [*commands, too_long]) == [*expected, ["packed", ""]]


def usable_mm(s: State) -> float:
    return s.displacement_mm if s.displacement_sigma_mm < 0.2 and not s.status & wire.NO_CONTROL else nan


@pytest.mark.parametrize("link", ["fd", "classic", "serial"])
def test_receiver_follows_a_finger_until_it_is_silent(program: Path, link: str) -> None:
    rng, commands, expected, dropped_n = Random(6), [], [nan], 0
    for i in range(500):
        sent = mostly_usable(rng, i)
        frame, parts = wire.pack_state(sent, i), wire.pack_parts(sent, i)
        messages = {
            "fd": [f"can 181 {frame.hex()}"],
            "classic": [f"can {0x81 + 0x100 * tpdo:x} {data.hex()}" for tpdo, data in parts],
            "serial": [f"serial {wire.encode_frame(Message.STATE, frame).hex()}"],
        }[link]
        if i and rng.random() < 0.05:  # the one before is still the newest
            messages.pop(rng.randrange(len(messages)))
            dropped_n += 1
            expected.append(expected[-1])
        else:
            expected.append(usable_mm(wire.unpack_state(frame)))
        messages.append(f"can 182 {wire.pack_state(State(displacement_mm=9.0), i).hex()}")
        commands += [f"{message} {i * 4}" for message in [*messages, "look"]]
    commands += [f"can 181 {wire.pack_state(State(), 244).hex()} 1999"] if link == "fd" else []
    rows = run(program, [*commands, f"look {1996 + 21}"])
    assert [float(row[0]) for row in rows] == pytest.approx([*expected[1:], nan], abs=1e-5, nan_ok=True)
    assert int(rows[-1][1]) == dropped_n


class Controller:
    """The C program as a running controller; the test sets the time."""

    def __init__(self, program: Path, forward: Callable[[str, bytes], None]) -> None:
        self._process = subprocess.Popen(
            [str(program)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
        )
        self._forward = forward
        self.now_ms = 0

    def tell(self, command: str) -> int:
        """Give it a command and transmit what it sends; returns the tare's outcome."""
        stdin, stdout = present(self._process.stdin), present(self._process.stdout)
        stdin.write(f"{command} {self.now_ms}\nlook {self.now_ms}\n")
        stdin.flush()
        while True:
            words = stdout.readline().split()
            assert words, "the program ended"
            if words[0] in ("can", "serial"):
                self._forward(words[0], bytes.fromhex(words[-1]))
            else:
                return int(words[2])

    def close(self) -> None:
        present(self._process.stdin).close()
        assert self._process.wait(SOON_S) == 0
        present(self._process.stdout).close()


OUTCOMES = [
    (RestFrameOutcome(RestFrameState.ACCEPTED), 0),
    (RestFrameOutcome(RestFrameState.ACCEPTED), 5),
    (RestFrameOutcome(RestFrameState.REFUSED, RestFrameReason.TOUCHED, "touched"), 2),
    (RestFrameOutcome(RestFrameState.UNKNOWN), 0),
]


def answers(controller: Controller, receive: Callable[[], str | None]) -> int:
    """Exchange messages until the tare is over. An idle turn is 60 ms on the controller's clock."""
    outcome = controller.tell("tare")
    for _ in range(2000):
        if outcome != BUSY:
            return outcome
        command = receive()
        if command is None:
            controller.now_ms += 60
            command = "serial 00"  # nothing
        outcome = controller.tell(command)
    raise AssertionError("the tare never was over")


@pytest.fixture(params=["serial", "fd", "classic", "lost"])
def tip(
    request: pytest.FixtureRequest, tmp_path: Path, program: Path, serial_program: Path
) -> Iterator[tuple[Application, Callable[[], int]]]:
    """A finger's application, and a tare by a controller on its link.

    lost: two answers to the write are lost, and the tip is touched when it is sent again.
    """
    kind, name = request.param, f"c-{request.node.name}"
    to_lose = [bytes((0x60, 0x10, 0x20, 0))] * (2 if kind == "lost" else 0)
    pty, bus = Ptys(tmp_path), can.Bus(name, interface="virtual")
    line = os.open(pty.paths[1], os.O_RDWR | os.O_NOCTTY)
    own = (
        f"serial:{pty.paths[0]}" if kind == "serial" else f"virtual:{name}?node=1&fd={int(kind != 'classic')}"
    )
    node, application = make_node(own)

    def forward(link: str, data: bytes) -> None:
        if link == "serial":
            os.write(line, data)
        else:
            bus.send(can.Message(arbitration_id=0x601, data=data, is_extended_id=False))

    def receive() -> str | None:
        if kind == "serial":
            ready, _, _ = select.select([line], [], [], 0.05)
            return f"serial {os.read(line, 4096).hex()}" if ready else None
        message = bus.recv(0.05)
        if message is not None and message.data[:4] in to_lose:
            application.touched = bool(to_lose.pop())
            return None
        return None if message is None else f"can {message.arbitration_id:x} {message.data.hex()}"

    with closing(Controller(serial_program if kind == "serial" else program, forward)) as controller:
        yield application, lambda: answers(controller, receive)
        assert not to_lose
    node.close()
    os.close(line)
    pty.close()
    bus.shutdown()


@pytest.mark.parametrize(("outcome", "busy_n"), OUTCOMES)
def test_tare_on_every_link(
    tip: tuple[Application, Callable[[], int]], outcome: RestFrameOutcome, busy_n: int
) -> None:
    application, tare = tip
    application.outcome, application.busy_for_n = outcome, busy_n
    assert tare() == outcome.state
    assert application.tares == [False]
    application.touched = True
    assert tare() == RestFrameState.REFUSED, "refused at once"
    assert application.tares == [False]
