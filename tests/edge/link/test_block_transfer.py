"""Block transfers with `canopen`'s client: values pass whole or not at all, and then others are served."""

from binascii import crc_hqx
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import closing, suppress
from itertools import cycle, islice
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import canopen
import pytest
from canopen.objectdictionary import ObjectDictionary
from canopen.sdo.client import BlockUploadStream, SdoClient
from hypothesis import given, settings
from hypothesis import strategies as st

from edge.link import sdo_server
from edge.link.params import PARAMS
from edge.link.sdo_server import DOWNLOAD_MAX, SdoServer
from hostlink import objects
from hostlink.errors import ObjectAborted
from hostlink.objects import SdoObjects
from hostlink.wire import OBJECTS, Abort, State, object_named, pack_value
from hostlink.wire.process_data import FRAME_DATA, SAMPLE_DATA
from tests.edge.link import test_node
from tests.edge.link.test_sdo_server import CONTENT, LONG, OTHER, SHORT, Bench, code, head
from tests.support.waiting import SOON_S, until

VALUE = bytes(k % 251 for k in range(2000))  # 286 segments
IDENTITY = head(0x40, SHORT, bytes(4))
ABORT = head(0x80, (0, 0), bytes(4))
START, END = b"\xa3", b"\xa1"


class Client:
    """`canopen`'s client beside a server, both in this thread. Frames are counted from 0 each way.

    to_node, from_node  called with the number and the data of each frame; True: it gets lost
    """

    def __init__(
        self,
        bench: Bench,
        to_node: Callable[[int, bytes], bool | None] = lambda n, data: False,
        from_node: Callable[[int, bytes], bool | None] = lambda n, data: False,
    ) -> None:
        self.sdo: Any = SdoClient(0x605, 0x585, ObjectDictionary())
        network: Any = SimpleNamespace(send_message=self._ask)
        self.sdo.network = network
        self.sdo.RESPONSE_TIMEOUT = SOON_S
        self._bench, self._to_node, self._from_node = bench, to_node, from_node
        self._asked_n = self._answered_n = 0

    def _ask(self, can_id: int, data: bytes) -> None:
        self._asked_n += 1
        if self._to_node(self._asked_n - 1, bytes(data)):
            return
        n = len(self._bench.answers)
        self._bench.server.request(data)
        for answer in self._bench.answers[n:]:
            self._answered_n += 1
            if not self._from_node(self._answered_n - 1, answer):
                self.sdo.on_response(can_id, answer, 0.0)

    def read(self, what: tuple[int, int] = LONG, **options: Any) -> bytes:
        with self.sdo.open(*what, "rb", buffering=0, block_transfer=True, **options) as stream:
            value = stream.readall()
        assert isinstance(value, bytes)
        return value

    def write(self, value: bytes, **options: Any) -> None:
        options |= {"buffering": 0, "size": len(value), "block_transfer": True}
        with self.sdo.open(*LONG, "wb", **options) as stream:
            while value:
                value = value[stream.write(value) :]


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    monkeypatch.setitem(CONTENT, LONG, VALUE)
    return Bench()


@pytest.fixture
def bus(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[test_node.Bench]:
    with closing(test_node.Bench(f"block-{request.node.name}", tmp_path)) as bench:
        yield bench


def serves(bench: Bench) -> bool:
    return Client(bench).sdo.upload(*LONG) == VALUE and bench.ask(IDENTITY)[4:6] == CONTENT[SHORT]


def test_a_remote_node_reads_and_writes_every_object(bus: test_node.Bench) -> None:
    silent = set()
    for row in OBJECTS:
        if row.access == "wo" or row.name == "time_us":  # which changes
            continue
        try:
            expected = bus.remote.sdo.upload(row.index, row.sub)
        except canopen.SdoAbortedError as error:
            silent.add((row.name, error.code))
            with test_node.refused(error.code):
                bus.remote.sdo.open(row.index, row.sub, "rb", block_transfer=True)
            continue
        with bus.remote.sdo.open(row.index, row.sub, "rb", block_transfer=True) as stream:
            assert stream.read() == expected, row.name
            assert stream.raw.size == len(expected)
    empty = {"calibration", "camera", "refusal", "rest_frame_message"}
    empty |= {f"error_{i}" for i in range(1, 9)}
    empty |= {datum.name for datum in (*SAMPLE_DATA, *FRAME_DATA)}  # before the first sample
    assert silent == {(name, Abort.NO_DATA) for name in empty}
    file = b"{%s}" % bytes(range(256)) * 10  # three sub-blocks
    written: dict[str, float | bytes] = {"calibration": file, "divider": 3, "rate_hz": 99.5, "tare": 1}
    for name, value in written.items():
        row = object_named(name)
        data = pack_value(row, value)
        with bus.remote.sdo.open(row.index, row.sub, "wb", size=len(data), block_transfer=True) as stream:
            stream.write(data)
    assert (bus.finger.calibration, bus.finger.tares) == (file, [False])
    assert (bus.read("divider"), bus.read("rate_hz")) == (3, 99.5)


def test_samples_pass_the_segments_of_a_sub_block(bus: test_node.Bench) -> None:
    bus.finger.calibration = VALUE
    with closing(bus.remote.sdo.open(0x2030, 0, "rb", block_transfer=True, buffering=0)) as stream:
        until(lambda: bus.remote.sdo.responses.qsize() > 3, "segments have come")
        sent = [bus.node.send(State(sample=k, capture_time_us=k)) for k in range(20)]
        assert all(sent)
        assert bus.node.sink._queue._spaced["block"].spacing_s == pytest.approx(135e-6 / PARAMS.spaced_rel)
        assert bus.samples(20) == list(range(20))
        assert stream.readall() == VALUE


@pytest.mark.parametrize("crc", [True, False])
@pytest.mark.parametrize("n_max", [1, 2, 126, 127])
@pytest.mark.parametrize("size", [1, 4, 7, 8, 7 * 127, 7 * 127 + 1, 40_000])
def test_values_of_all_lengths_pass(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, size: int, n_max: int, crc: bool
) -> None:
    monkeypatch.setattr(BlockUploadStream, "blksize", n_max)
    value = (VALUE * 20)[:size]
    monkeypatch.setitem(CONTENT, LONG, value)
    assert Client(bench).read(request_crc_support=crc) == value
    Client(bench).write(value, request_crc_support=crc)
    assert bench.objects.written == [(LONG, value)]


@pytest.mark.parametrize("writes", [False, True])
@pytest.mark.parametrize("lost", [[1], [5], [29, 30], [126], [1, 2, 3, 40, 150], [3, 130, 131, 260]])
def test_lost_segments_are_sent_again(bench: Bench, writes: bool, lost: Collection[int]) -> None:
    if writes:
        Client(bench, lambda n, data: n in lost).write(VALUE)
        assert bench.objects.written == [(LONG, VALUE)]
    else:
        assert Client(bench, from_node=lambda n, data: n in lost).read() == VALUE
    assert serves(bench)


@pytest.mark.parametrize("received_n", [0, 1, 126, 127])
def test_a_read_goes_on_behind_the_last_segment_received(bench: Bench, received_n: int) -> None:
    """`canopen` loses a segment itself where the last ones of a sub-block are lost."""
    bench.ask(head(0xA0, LONG, b"\x7f"))
    bench.server.request(START + bytes(7))
    bench.server.request(bytes((0xA2, received_n, 2)) + bytes(5))
    at = received_n * 7
    assert bench.answers[-2:] == [b"\1" + VALUE[at : at + 7], b"\2" + VALUE[at + 7 : at + 14]]
    assert len(bench.answers) == 1 + 127 + 2


def test_the_end_of_a_write_is_answered_again(bench: Bench) -> None:
    lost: list[bytes] = []

    def lose_once(n: int, data: bytes) -> bool:
        first = data[:1] == END and not lost
        if first:
            lost.append(data)
        return first

    client = Client(bench, from_node=lose_once)
    client.sdo.MAX_RETRIES, client.sdo.RESPONSE_TIMEOUT = 2, 0.001
    client.write(VALUE)
    assert len(lost) == 1
    assert bench.objects.written == [(LONG, VALUE)]


GIVES_UP = (canopen.SdoCommunicationError, canopen.SdoAbortedError, RuntimeError, AttributeError)  # canopen's
numbers = st.sets(st.integers(0, 330), max_size=6)


@pytest.mark.generative
@settings(max_examples=200, deadline=None)
@given(numbers, numbers, st.booleans())
def test_whatever_gets_lost_no_value_is_wrong(to_node: set[int], from_node: set[int], writes: bool) -> None:
    with pytest.MonkeyPatch.context() as patched:
        patched.setitem(CONTENT, LONG, VALUE)
        bench = Bench()
        client = Client(bench, lambda n, data: n in to_node, lambda n, data: n in from_node)
        client.sdo.RESPONSE_TIMEOUT = 0.001  # what has not come by now never will
        with suppress(*GIVES_UP):
            if writes:
                client.write(VALUE)
            else:
                assert client.read() == VALUE
        assert bench.objects.written in ([], [(LONG, VALUE)])
        bench.now_s = PARAMS.idle_s
        assert serves(bench)


UPLOAD, DOWNLOAD = head(0xA4, LONG, b"\x7f"), head(0xC6, LONG, b"\x08\0\0\0")
SEGMENTS = [b"\x01{123456", b"\x82}"]
CRC = crc_hqx(b"{123456}", 0).to_bytes(2, "little")


@pytest.mark.parametrize(
    ("frames", "abort"),
    [
        ([head(0xA4, LONG)], Abort.BLOCK_SIZE),
        ([head(0xA4, LONG, b"\x80")], Abort.BLOCK_SIZE),
        ([UPLOAD, START, b"\xa2\x7f\0"], Abort.BLOCK_SIZE),
        ([UPLOAD, START, b"\xa2\x7f\x80"], Abort.BLOCK_SIZE),
        ([UPLOAD, START, b"\xa2\x80\x7f"], Abort.SEQUENCE),  # more than were sent
        ([UPLOAD, b"\xa2\x01\x7f"], Abort.SEQUENCE),
        ([DOWNLOAD, SEGMENTS[0], b"\0"], Abort.SEQUENCE),
        ([DOWNLOAD, SEGMENTS[0], b"\xd9" + CRC], Abort.COMMAND),  # the last one is missing
        ([DOWNLOAD, *SEGMENTS, b"\xd9\0\0"], Abort.CRC),
        ([DOWNLOAD, *SEGMENTS, b"\xd5" + CRC], Abort.CRC),  # one byte more
        ([head(0xC2, LONG, b"\x09\0\0\0"), *SEGMENTS, b"\xd9"], Abort.LENGTH),
        ([head(0xC2, LONG, (DOWNLOAD_MAX + 1).to_bytes(4, "little"))], Abort.LENGTH),
        ([DOWNLOAD, ABORT], 0),
        ([UPLOAD, ABORT], 0),
        ([UPLOAD, START, b"\xa2\x7f\x7f", ABORT], 0),
    ],
)
def test_a_wrong_frame_ends_a_transfer_with_the_code_of_cia_301(
    bench: Bench, frames: list[bytes], abort: int
) -> None:
    for frame in frames:
        n = len(bench.answers)
        bench.server.request(frame.ljust(8, b"\0"))
    assert [code(answer) for answer in bench.answers[n:]] == [abort] * (abort > 0)
    assert bench.objects.written == []
    assert serves(bench)


def test_a_last_segment_behind_a_lost_one_is_sent_again(bench: Bench) -> None:
    """`canopen` gives up where the last sub-block of a write needs it."""
    bench.ask(head(0xC6, LONG, b"\x0f\0\0\0"))
    assert bench.ask(b"\1{123456") == b""
    assert bench.ask(b"\x83}") == b"\xa2\1\x1f" + bytes(5)
    assert bench.ask(b"\x01789abcd") == b""
    assert bench.ask(b"\x82}") == b"\xa2\2\x1f" + bytes(5)
    crc = crc_hqx(b"{123456789abcd}", 0).to_bytes(2, "little")
    assert bench.ask(b"\xd9" + crc) == END + bytes(7)
    assert bench.objects.written == [(LONG, b"{123456789abcd}")]


@pytest.mark.parametrize(
    ("first", "firsts_of_segments"), [(0xC0, range(1, 32)), (0x20, (0x00, 0x10))], ids=["blocks", "segments"]
)
def test_an_endless_write_is_refused(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, first: int, firsts_of_segments: Sequence[int]
) -> None:
    """Segments that never end must not fill the board's memory."""
    monkeypatch.setattr(sdo_server, "DOWNLOAD_MAX", 700)
    bench.ask(head(first, LONG))
    commands = islice(cycle(firsts_of_segments), 101)
    answers = [bench.ask(bytes((command,)) + b"segment") for command in commands]
    assert code(answers[-1]) == Abort.LENGTH
    assert bench.server._transfer is None
    assert serves(bench)


def test_after_an_abort_no_segment_is_sent(bench: Bench) -> None:
    groups: list[Sequence[bytes]] = []
    store: Any = bench.objects
    server = SdoServer(store, bench.answers.append, groups.append)
    for frame in (UPLOAD, START, ABORT):
        server.request(frame.ljust(8, b"\0"))
    assert [len(group) for group in groups] == [127, 0]


def test_a_write_that_the_finger_refuses_ends_with_its_code(bench: Bench) -> None:
    bench.objects.refused = True
    with test_node.refused(Abort.NOT_NOW):
        Client(bench).write(VALUE)
    assert serves(bench)


@pytest.mark.parametrize(
    "request_", [IDENTITY, head(0x40, OTHER), UPLOAD, DOWNLOAD, head(0x2F, SHORT, b"\1")]
)
def test_others_get_no_answer_while_blocks_move(bench: Bench, request_: bytes) -> None:
    def also_ask(n: int, data: bytes) -> None:
        if n > 2:
            assert bench.ask(request_) == b""

    assert Client(bench, to_node=also_ask).read() == VALUE
    Client(bench, to_node=also_ask).write(VALUE)
    assert bench.objects.written == [(LONG, VALUE)]
    assert serves(bench)


@pytest.mark.parametrize(
    ("first", "next_", "answer"), [(UPLOAD, START, b"\xc6"), (DOWNLOAD, SEGMENTS[0], b"\xa4")]
)
def test_two_transfers_at_once_are_refused_and_a_vanished_client_blocks_for_a_second(
    bench: Bench, first: bytes, next_: bytes, answer: bytes
) -> None:
    bench.ask(head(0x40, OTHER))
    bench.ask(b"\x60")
    assert code(bench.ask(first)) == Abort.NOT_NOW  # segments are under way
    bench.server.reset()
    for _ in range(2):  # its answer was lost
        assert bench.ask(first)[:4] == answer + first[1:4]
    assert bench.ask(IDENTITY)[4:6] == CONTENT[SHORT]  # nothing has moved so far
    assert code(bench.ask(head(0x40, OTHER))) == Abort.NOT_NOW
    bench.server.request(next_.ljust(8, b"\0"))
    assert bench.ask(IDENTITY) == b""
    bench.now_s = PARAMS.idle_s
    assert serves(bench)


@pytest.mark.parametrize("writes", [False, True])
def test_our_host_waits_for_the_end_of_anothers_blocks(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, writes: bool
) -> None:
    sent: list[bytes] = []

    def send(can_id: int, data: bytes) -> None:
        sent.append(data)
        host.answer(bench.ask(data))

    monkeypatch.setattr(objects, "TIMEOUT_S", SOON_S)
    host = SdoObjects(5, 0x605, 0x585, send)

    def overhear(n: int, data: bytes) -> None:
        host.overhear(data)
        if n == 3:
            for index, sub in (SHORT, OTHER):
                with monkeypatch.context() as patched:
                    patched.setattr(objects, "TIMEOUT_S", 0.001)
                    with pytest.raises(ObjectAborted, match="another host keeps the finger busy"):
                        host.read(index, sub)

    client = Client(bench, overhear, lambda n, data: host.answer(data))
    if writes:
        client.write(VALUE)
    else:
        assert client.read() == VALUE
    assert sent == []
    assert host.read(*SHORT) == CONTENT[SHORT]
    assert host.read(*OTHER) == CONTENT[OTHER]
    assert len(sent) == 1 + 4
