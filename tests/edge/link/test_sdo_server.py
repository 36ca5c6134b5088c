"""One SDO transfer at a time, with its own state: no frame of another one gets into a value."""

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from edge.link.object_server import Aborted
from edge.link.params import PARAMS
from edge.link.sdo_server import SdoServer
from hostlink.objects import TIMEOUT_S, TRIES
from hostlink.wire import Abort

LONG, OTHER, SHORT = (0x2030, 0), (0x2000, 3), (0x1018, 1)
CONTENT = {LONG: bytes(range(100)), OTHER: b"a serial number", SHORT: b"\1\2"}


class Objects:
    """Records writes, and has three values to read."""

    refusal = ""

    def __init__(self) -> None:
        self.written: list[tuple[tuple[int, int], bytes]] = []
        self.refused = False

    def read(self, index: int, sub: int) -> bytes:
        if (index, sub) not in CONTENT:
            raise Aborted(Abort.NO_OBJECT)
        return CONTENT[index, sub]

    def write(self, index: int, sub: int, data: bytes) -> None:
        if self.refused:
            raise Aborted(Abort.NOT_NOW)
        self.written.append(((index, sub), data))


class Bench:
    def __init__(self) -> None:
        self.objects, self.answers, self.now_s = Objects(), list[bytes](), 0.0
        objects: Any = self.objects
        self.server = SdoServer(objects, self.answers.append, self.answers.extend, lambda: self.now_s)

    def ask(self, data: bytes) -> bytes:
        n = len(self.answers)
        self.server.request(data.ljust(8, b"\0"))
        assert len(self.answers) <= n + 1
        return self.answers[-1] if len(self.answers) > n else b""


@pytest.fixture
def bench() -> Bench:
    return Bench()


def head(command: int, what: tuple[int, int], tail: bytes = b"") -> bytes:
    return bytes((command,)) + what[0].to_bytes(2, "little") + bytes((what[1],)) + tail


def segment(toggle: int, part: bytes, last: bool = False) -> bytes:
    return bytes((toggle << 4 | (7 - len(part)) << 1 | last,)) + part


def code(answer: bytes) -> int:
    """Code of an abort; 0: not an abort."""
    return int.from_bytes(answer[4:], "little") if answer[0] == 0x80 else 0


def test_another_clients_reads_do_not_redirect_a_write(bench: Bench) -> None:
    bench.ask(head(0x21, LONG, (9).to_bytes(4, "little")))
    assert bench.ask(head(0x40, SHORT))[4:6] == b"\1\2"  # needs no state, and is served
    assert code(bench.ask(head(0x40, OTHER))) == Abort.NOT_NOW
    bench.ask(segment(0, b"1234567"))
    assert code(bench.ask(head(0x21, OTHER, (2).to_bytes(4, "little")))) == Abort.NOT_NOW
    assert bench.ask(segment(1, b"89", last=True))[0] == 0x30
    assert bench.objects.written == [(LONG, b"123456789")]


def test_a_vanished_client_blocks_the_server_for_a_second(bench: Bench) -> None:
    bench.ask(head(0x21, LONG))
    bench.ask(segment(0, b"1234567"))
    bench.now_s = PARAMS.idle_s
    assert not code(bench.ask(head(0x40, OTHER)))
    assert code(bench.ask(segment(1, b"89", last=True)))
    assert bench.objects.written == []


def test_a_request_repeated_because_its_answer_was_lost_starts_anew(bench: Bench) -> None:
    for _ in range(2):
        assert bench.ask(head(0x40, OTHER))[0] == 0x41
    assert bench.ask(bytes((0x60,)))[1:] == CONTENT[OTHER][:7]


def test_a_segment_repeated_because_its_answer_was_late_moves_nothing(bench: Bench) -> None:
    bench.ask(head(0x21, LONG, (9).to_bytes(4, "little")))
    for _ in range(2):
        assert bench.ask(segment(0, b"1234567"))[0] == 0x20
    assert bench.ask(head(0x40, SHORT))[4:6] == b"\1\2"  # another client's, between two copies
    assert bench.ask(segment(0, b"1234567"))[0] == 0x20
    for _ in range(2):  # the last one, too: the value is written by then
        assert bench.ask(segment(1, b"89", last=True))[0] == 0x30
    assert bench.objects.written == [(LONG, b"123456789")]
    bench.ask(head(0x40, OTHER))
    answers = [bench.ask(bytes((command,))) for command in (0x60, 0x60, 0x70, 0x70)]
    assert answers[0] == answers[1]
    assert answers[2] == answers[3]
    assert answers[0][1:] + answers[2][1:] == CONTENT[OTHER][:14]


@pytest.mark.parametrize("size", [6, 10])
def test_a_value_of_another_length_than_announced_is_refused(bench: Bench, size: int) -> None:
    bench.ask(head(0x21, LONG, size.to_bytes(4, "little")))
    answers = [bench.ask(segment(0, b"1234567")), bench.ask(segment(1, b"8", last=True))]
    assert Abort.LENGTH in map(code, answers)
    assert bench.objects.written == []


TARE = (0x2010, 0)


@pytest.mark.parametrize(
    ("again", "after_s", "between", "done_n"),
    [
        (b"\1\0\0\7", 0.0, False, 1),  # numbered behind the value, as our hosts do
        (b"\1\0\0\7", TRIES * TIMEOUT_S, True, 1),  # the second time was lost, too
        (b"\1\0\0\7", 2.0, True, 2),  # another program's, whose numbers began anew
        (b"\1\0\0\x08", 0.5, False, 2),
        (b"\1", 0.5, False, 1),  # of a client that does not number them: it waited for an answer
        (b"\1", 0.1, False, 2),  # ... for no answer: it asks for another one
        (b"\1", 0.5, True, 2),
        (b"\1", 1.0, False, 2),
        (b"\2", 0.5, False, 2),
    ],
)
def test_a_short_write_repeated_because_its_answer_was_lost_is_done_once(
    bench: Bench, again: bytes, after_s: float, between: bool, done_n: int
) -> None:
    first = b"\1\0\0\7" if len(again) == 4 else b"\1"
    done = bench.ask(head(0x2F, TARE, first))
    if between:  # another host reads
        bench.ask(head(0x40, SHORT))
    bench.now_s = after_s
    assert bench.ask(head(0x2F, TARE, again)) == done
    assert len(bench.objects.written) == done_n
    bench.objects.refused = True  # a refused write is judged anew
    request = head(0x2F, TARE, b"\1\0\0\x09")
    assert code(bench.ask(request)) == Abort.NOT_NOW
    bench.objects.refused = False
    assert bench.ask(request)[0] == 0x60


@pytest.mark.parametrize(
    ("request_", "answer"),
    [
        (head(0xA0, (0x3000, 0), b"\x7f\0"), head(0x80, (0x3000, 0), b"\0\0\2\6")),
        (b"\xa3", head(0x80, (0, 0), b"\1\0\4\5")),  # frames within a block transfer name no object
        (head(0xE0, SHORT), head(0x80, SHORT, b"\1\0\4\5")),
        (b"\x60", head(0x80, (0, 0), b"\0\0\3\5")),  # segments of no transfer
        (b"\x10", head(0x80, (0, 0), b"\0\0\3\5")),
        (head(0x22, (0x2020, 2), b"\3\0"), head(0x60, (0x2020, 2), bytes(4))),  # no size: the object's
    ],
)  # fmt: skip
def test_the_answer_is_what_cia_301_asks(bench: Bench, request_: bytes, answer: bytes) -> None:
    assert bench.ask(request_) == answer
    assert bench.objects.written in ([], [((0x2020, 2), b"\3\0")])


COMMANDS = [0x21, 0x20, 0x40, 0x80, 0xA0, 0xC0, 0xE0, 0x22]
steps = st.one_of(
    st.tuples(st.sampled_from(COMMANDS), st.sampled_from([LONG, OTHER, SHORT])),
    st.tuples(st.sampled_from([0, 1]), st.binary(max_size=7), st.booleans()),
    st.tuples(st.sampled_from([0x60, 0x70])),
)  # fmt: skip


@pytest.mark.generative
@settings(max_examples=300)
@given(st.lists(steps, max_size=40))
def test_any_frames_write_only_the_data_of_one_transfer(sequence: list[tuple[Any, ...]]) -> None:
    """A long value is written only as the segments since the start of a download of that object."""
    bench, segments = Bench(), b""
    start: tuple[int, int] | None = None
    for step in sequence:
        n = len(bench.objects.written)
        if len(step) == 3:
            toggle, part, last = step
            assert isinstance(part, bytes)
            answer = bench.ask(segment(int(toggle), part, bool(last)))
            segments += part
            for what, data in bench.objects.written[n:]:
                assert start == what
                assert data == segments
            if last or answer[:1] == b"\x80":
                start, segments = None, b""
        elif len(step) == 2:
            command, what = step
            answer = bench.ask(head(command, what))
            if answer[:1] == b"\x60" and command in (0x20, 0x21):
                start, segments = what, b""
            elif command == 0x80 and what == start:
                start, segments = None, b""
            for _, data in bench.objects.written[n:]:
                assert command == 0x22
                assert data == bytes(4)
        else:
            if bench.ask(bytes(step))[:1] == b"\x80":
                start, segments = None, b""
            assert len(bench.objects.written) == n
        transfer = bench.server._transfer
        assert transfer is None or len(transfer.data) <= 1 << 10
