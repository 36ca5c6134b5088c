"""Plots of recordings: the samples read are those sent, and the picture has units."""

import json
import os
from math import isnan, nan
from pathlib import Path
from random import Random

import cv2
import pytest
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Header, Message

from hostlink.commands.plot import Series, draw, read_series
from hostlink.errors import LogError
from hostlink.mcap_samples import read_mcap
from hostlink.recording import LogWriter
from hostlink.wire import CanIds, Kind, State, pack_state
from tests.hostlink.test_recording import write_edge
from tests.support.bus import message
from tests.support.commands import Done
from tests.support.commands import run_host as run
from tests.support.states import random_state

RATE_HZ = 100
START_US = (1 << 32) - 250_000  # the wire's microseconds wrap in the middle


def states(n: int = 100) -> list[State]:
    return [
        State(
            sample=k,
            capture_time_us=START_US + k * 1_000_000 // RATE_HZ,
            latency_us=900.0,
            displacement_mm=k / 50 if not 20 <= k < 30 else nan,
            displacement_sigma_mm=0.05,
            shear_x_mm=-k / 100,
            shear_y_mm=k / 200,
            contact_n=k // 50,
        )
        for k in range(n)
    ]


def write_bus(path: Path, nodes: tuple[int, ...] = (1,), sent: list[State] | None = None) -> None:
    with LogWriter(path) as log:
        for k, state in enumerate(sent if sent is not None else states()):
            for node in nodes:
                can_id = CanIds().of(Kind.TPDO1, node)
                log.write(message(can_id, pack_state(state, k), 1.7e9 + k / RATE_HZ))


@pytest.mark.parametrize("suffix", [".log", ".blf"])
def test_series_are_what_was_sent(tmp_path: Path, suffix: str) -> None:
    write_bus(tmp_path / f"a{suffix}", (1, 4))
    series = read_series(tmp_path / f"a{suffix}")
    assert sorted(series) == [1, 4]
    one = series[4]
    assert one.samples_n == 100
    assert one.time_s == pytest.approx([k / RATE_HZ for k in range(100)], abs=1e-5)
    for k, value in enumerate(one.values["displacement_mm"]):
        assert isnan(value) if 20 <= k < 30 else value == pytest.approx(k / 50, abs=0.002)
    assert not one.known("force_n")


def test_silence_is_a_gap(tmp_path: Path) -> None:
    sent = states()
    write_bus(tmp_path / "a.log", sent=sent[:20] + sent[60:])
    one = read_series(tmp_path / "a.log")[1]
    assert one.samples_n == 60
    assert len(one.time_s) == 61
    assert isnan(one.values["shear_x_mm"][20])
    assert one.time_s[19] < one.time_s[20] < one.time_s[21]


def test_the_readable_part_of_a_damaged_recording_is_drawn(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    log, cut = tmp_path / "a.blf", tmp_path / "b.mcap"
    write_bus(log, sent=states(5))
    log.write_bytes(log.read_bytes() + b"nonsense" * 2)
    write_edge(cut, states(8000), finger=2)  # some chunks
    os.truncate(cut, cut.stat().st_size * 2 // 3)
    drawn = [json.loads(run("plot", path, "--json").out)["samples"] for path in (log, cut)]
    assert drawn[0] == {"1": 5}
    assert 1000 < drawn[1]["2"] < 8000
    damaged, cut_off = caplog.messages
    assert damaged.startswith(f"{log}: damaged after 5 messages: no object at byte ")
    assert damaged.endswith("; only the samples before that are drawn")
    assert cut_off == f"{cut}: cut off or damaged; only the samples before that are drawn"


@pytest.mark.parametrize(
    "text",
    [
        '{"values": {"capture_time_us": 1, "force_n": "strong"}}',
        '{"values": {"capture_time_us": 1, "force_n": 1' + "0" * 400 + "}}",
        '{"values": {"capture_time_us": 1e400}}',
        '{"values": [1]}',
        "[" * 100_000,
    ],
    ids=["text", "huge", "infinite", "row", "deep"],
)
def test_a_sample_that_is_no_sample_counts_as_damaged(tmp_path: Path, text: str) -> None:
    builder = RecordBuilder()
    Header("", "").write(builder)
    Channel(id=1, topic="/finger_1/sample", message_encoding="json", metadata={}, schema_id=0).write(builder)
    Message(channel_id=1, sequence=0, log_time=0, publish_time=0, data=text.encode()).write(builder)
    path = tmp_path / "a.mcap"
    path.write_bytes(b"\x89MCAP0\r\n" + builder.end())
    with pytest.raises(LogError, match="damaged before its first sample"):
        read_series(path)


def test_a_value_between_two_gaps_is_a_dot(tmp_path: Path) -> None:
    def ink(values: list[float]) -> int:
        """Pixels in the line's colour."""
        columns = dict.fromkeys(Series().values, [nan] * len(values)) | {"force_n": values}
        draw({1: Series(len(values), [k / 100 for k in range(len(values))], columns)}, tmp_path / "a.png")
        red, green, blue = (int("0060a8"[i : i + 2], 16) for i in (0, 2, 4))
        image = cv2.imread(str(tmp_path / "a.png"))
        assert image is not None
        return int((image == (blue, green, red)).all(axis=2).sum())

    assert ink([nan, 1.0, nan, nan]) > 10
    assert ink([1.0, nan, nan, 2.0]) > 20  # at both ends


def test_an_edge_recording_holds_what_was_sent(tmp_path: Path) -> None:
    sent = [random_state(Random(k), k) for k in range(20)]
    write_edge(tmp_path / "a.mcap", sent)
    decoded = [pack_state(sample.state, 0) for sample in read_mcap(tmp_path / "a.mcap")]
    assert decoded == [pack_state(state, 0) for state in sent]


def test_the_picture_has_units_and_only_what_is_known(tmp_path: Path) -> None:
    write_bus(tmp_path / "a.log", (1, 4))
    series = read_series(tmp_path / "a.log")
    assert draw(series, tmp_path / "a.svg", "a.log") == ("depth", "shear", "contacts", "latency")
    assert draw(series, tmp_path / "a.png") == ("depth", "shear", "contacts", "latency")
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    assert (tmp_path / "a.png").stat().st_size > 20_000
    write_bus(tmp_path / "b.log", sent=[State(sample=k, capture_time_us=k * 10_000) for k in range(20)])
    assert draw(read_series(tmp_path / "b.log"), tmp_path / "b.png") == ("contacts",)


def test_the_command(tmp_path: Path) -> None:
    log = tmp_path / "a.log"
    write_bus(log, (1, 4))
    output = json.loads(run("plot", log, "--json", "--finger", "4").out)
    assert output["samples"] == {"4": 100}
    assert Path(output["out"]) == tmp_path / "a.png"
    assert (tmp_path / "a.png").is_file()
    assert run("plot", log, "-o", tmp_path / "b.pdf", "-q") == Done(0)
    assert run("plot", log, "--overwrite").code == 0
