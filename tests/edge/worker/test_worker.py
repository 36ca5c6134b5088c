"""The second process: no message to it is lost, it may die or hang, and it ends with the loop."""

import os
import re
import signal
import subprocess
import sys
import threading
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import pairwise
from multiprocessing.connection import Pipe
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from edge.recording.reader import RecordingSource
from edge.sources import open_source
from edge.sources.shared_memory import Inbox, Outbox
from edge.worker.client import WorkerClient
from edge.worker.params import WorkerConfig, WorkerParams
from hostlink.interrupt import ENDING
from hostlink.wire import FaultCode
from tests.support.finger import Finger
from tests.support.messages import read_messages
from tests.support.processes import python
from tests.support.viewing import Live
from tests.support.waiting import SOON_S, size_of, until


@contextmanager
def both_ends(size_bytes: int = 4096) -> Iterator[tuple[Outbox, Inbox]]:
    """Both ends of a channel, in one process."""
    outbox = Outbox(size_bytes)
    inbox = Inbox(outbox.far_end.dup(), os.dup(outbox.fd))
    outbox.far_end.close()
    yield outbox, inbox
    with suppress(OSError):  # a test may have closed it
        outbox.close()


@settings(max_examples=60)
@given(st.data())
def test_messages_arrive_in_order_and_complete(data: st.DataObject) -> None:
    """For any sizes and any lag of the reader."""
    sizes = st.lists(st.integers(0, 1500), max_size=3)
    with both_ends() as (outbox, inbox):
        under_way: list[tuple[int, list[np.ndarray]]] = []
        for n in range(data.draw(st.integers(1, 60))):
            arrays = [np.full(size, (n + k) % 251, np.uint8) for k, size in enumerate(data.draw(sizes))]
            if outbox.put((n, arrays)):
                under_way.append((n, arrays))
            else:
                assert under_way or sum(a.nbytes for a in arrays) > 3000, "there was room"
            for _ in range(data.draw(st.integers(0, 2))):
                if under_way:
                    compare(inbox.get(), under_way.pop(0))
        while under_way:
            compare(inbox.get(), under_way.pop(0))


def compare(got: Any, put: tuple[int, list[np.ndarray]]) -> None:
    assert got[0] == put[0]
    for one, other in zip(got[1], put[1], strict=True):
        np.testing.assert_array_equal(one, other)


def test_messages_sent_before_the_end_are_received() -> None:
    with both_ends() as (outbox, inbox):
        messages = [(n, [np.full(100, n, np.uint8)]) for n in range(3)]
        for message in messages:
            assert outbox.put(message)
        outbox.close()
        for message in messages:
            compare(inbox.get(), message)
        assert inbox.get() is None


def test_a_reader_that_is_gone_is_no_error() -> None:
    with both_ends() as (outbox, inbox):
        inbox._socket.close()
        assert not outbox.put(np.zeros(10))
        assert not outbox.put("words")


@pytest.fixture
def live(data_dir: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Live]:
    monkeypatch.setattr("edge.worker.client.PARAMS", WorkerParams(lived_s=0.0, end_s=SOON_S))
    with Live(data_dir / "press.mcap", recordings=tmp_path, record=tmp_path / "all.mcap") as running:
        yield running


def get(url: str) -> bytes:
    with urllib.request.urlopen(url.partition("#")[0], timeout=SOON_S) as answer:
        return bytes(answer.read())


def test_after_the_worker_s_death_the_page_is_served_again(live: Live) -> None:
    path = live.recordings / "all.mcap"
    live.until(lambda: size_of(path) > 3_000_000, "some chunks")
    page, process = get(live.url), live.worker.process
    assert process is not None
    mine = os.getpriority(os.PRIO_PROCESS, 0)  # the worker's priority is lower than the loop's
    assert os.getpriority(os.PRIO_PROCESS, process.pid) >= max(5, mine)
    process.kill()
    live.until(lambda: live.worker.recording.fault, "it is noticed")
    assert "process ended" in live.loop.session.trouble()
    frames_n = live.loop.statistics().frames_n
    live.until(lambda: live.loop.statistics().frames_n > frames_n + 20, "the loop goes on")
    live.until(lambda: live.worker.process is not process, "there is another one")
    live.until(lambda: live.worker._outbox is not None, "it is ready")
    assert get(live.url) == page
    frames = list(RecordingSource(path))
    assert len(frames) > 20, "what was written reads back"


def test_a_blocked_recorder_is_a_slow_disk_and_the_gap_is_recorded(live: Live) -> None:
    process = live.worker.process
    assert process is not None
    live.loop.faults.report(FaultCode.OVER_TEMPERATURE, True, "too warm for a test")
    process.send_signal(signal.SIGSTOP)
    try:
        live.until(lambda: live.worker.recording.dropped_n, "the memory is full")
        assert "too slow" in live.loop.session.trouble()
    finally:
        process.send_signal(signal.SIGCONT)
    live.until(lambda: live.worker.recording.lost_n == 0, "it goes on")
    live.loop.post(lambda: setattr(live.loop.session, "recorder", None)).result(SOON_S)
    live.worker.close()
    lost_n = live.worker.recording.dropped_n
    assert lost_n
    path = live.recordings / "all.mcap"
    events = [m.message for _, _, m in read_messages(path, ["/events"])]
    assert any("OVER_TEMPERATURE on: too warm for a test" in text for text in events)
    assert sum(int(text.split()[0]) for text in events if "dropped" in text) == lost_n
    sequences = [frame.sequence for frame in RecordingSource(path)]
    gaps = [b - a - 1 for a, b in pairwise(sequences) if b > a + 1]
    assert sum(gaps) >= lost_n


@pytest.mark.parametrize("number", [signal.SIGKILL, *ENDING])
def test_the_worker_ends_with_the_loop_and_completes_its_file(
    data_dir: Path, tmp_path: Path, number: signal.Signals
) -> None:
    """Killed or ended: the second process writes the file to its end, and ends."""
    path = tmp_path / "a.mcap"
    command = [sys.executable, "-m", "edge", "replay", str(data_dir / "press.mcap"), "--loop", "--speed", "1"]
    options = ["--sink", "memory:", "--record", str(path), "--view-at", "127.0.0.1:0", "--samples"]
    reading, writing = os.pipe()  # closed by the kernel when the last process that has it ends
    with subprocess.Popen([*command, *options], stdout=subprocess.PIPE, stderr=writing, text=True) as running:
        os.close(writing)
        assert running.stdout is not None
        for _ in range(60):
            assert running.stdout.readline()
        url = re.search(r"http://127.0.0.1:\d+/", os.read(reading, 65536).decode())
        assert url is not None
        running.send_signal(number)
        running.stdout.close()
        running.wait(SOON_S)
    while os.read(reading, 65536):  # without end, if the second process outlives the first
        pass
    os.close(reading)
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None, "the file has its index: it was closed"
    assert len(list(RecordingSource(path))) >= 50
    with pytest.raises(OSError, match="refused"):
        get(url[0])


def test_the_worker_leaves_real_time_and_the_loop_s_core_to_the_loop() -> None:
    """As under deploy/realtime.conf; skipped if that is not permitted."""
    code = (
        "import os, sys\n"
        "mine = min(os.sched_getaffinity(0))\n"
        "try: os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))\n"
        "except PermissionError: sys.exit(77)\n"
        "if len(os.sched_getaffinity(0)) < os.cpu_count() or os.cpu_count() < 2: sys.exit(77)\n"
        "os.sched_setaffinity(0, {mine})\n"
        "from edge.worker.__main__ import step_back\n"
        "step_back()\n"
        "assert os.sched_getscheduler(0) == os.SCHED_OTHER\n"
        "assert mine not in os.sched_getaffinity(0)\n"
        "assert os.getpriority(os.PRIO_PROCESS, 0) >= 5\n"
    )
    done = python("-c", code)
    if done.returncode == 77:
        pytest.skip("needs the right to real-time scheduling, and two processors")
    assert done.returncode == 0, done.stderr


def test_a_tare_that_a_viewer_waits_for_keeps_nobody_else_waiting(data_dir: Path) -> None:
    """No image comes, so the tare has no outcome; what comes meanwhile is handled all the same."""
    frames = list(open_source(str(data_dir / "two_contacts.mcap")))
    finger = Finger(frames, None)
    client = WorkerClient(finger.loop, WorkerConfig())
    ours, theirs = Pipe()
    thread = threading.Thread(target=client._receive_loop, args=(ours,))
    thread.start()
    theirs.send(("tare", False))
    theirs.send(("recorded", 0, "no space left"))
    until(lambda: client.recording.fault == "no space left", "the report")
    until(lambda: finger.loop.measurement.tare.request is not None, "the request")
    assert not theirs.poll()
    for frame in frames[:8]:
        finger.see(frame.image)
    assert theirs.poll(SOON_S)
    assert theirs.recv()[0].name == "ACCEPTED"
    client._closing = True
    theirs.close()
    thread.join()
