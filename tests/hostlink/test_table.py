"""Samples as a table: every format holds the same values, each under its name."""

from pathlib import Path
from random import Random

import numpy as np
import pandas as pd
import pyarrow.parquet
import pytest

import hostlink
from hostlink import Sample, decode_recording
from hostlink.recording import LogWriter, read_log
from hostlink.table import COLUMNS, ROWS_PER_PIECE, write_parquet
from hostlink.wire import State, pack_state
from tests.support.bus import message
from tests.support.commands import Done
from tests.support.commands import run_host as run
from tests.support.states import random_state

SAMPLES = 200


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path, rng = tmp_path / "hand.log", Random(7)
    with LogWriter(path) as writer:
        for i in range(SAMPLES):
            data = pack_state(random_state(rng, i // 2), i // 2)
            writer.write(message(0x181 + i % 2, data, 1e9 + i * 0.004))
    return path


def samples_of(path: Path) -> list[Sample]:
    return [event for event in decode_recording(path) if isinstance(event, Sample)]


def value_of(sample: Sample, name: str) -> float:
    """Independent of the table: the attribute of the column's name."""
    if name.startswith("contact") and name[7].isdigit():
        i = int(name[7])
        there = i < len(sample.state.contacts)
        return getattr(sample.state.contacts[i], name[9:]) if there else float("nan")
    return float(getattr(sample if hasattr(sample, name) else sample.state, name))


def test_arrays_hold_each_sample_under_its_names(log: Path) -> None:
    arrays = hostlink.to_arrays(log)
    assert list(arrays) == [c.name for c in COLUMNS]
    for i, sample in enumerate(samples_of(log)):
        for name, column in arrays.items():
            assert len(column) == SAMPLES
            np.testing.assert_equal(float(column[i]), value_of(sample, name), err_msg=name)
    assert arrays["status"].dtype == np.int64
    np.testing.assert_equal(hostlink.to_arrays(samples_of(log)), arrays)


def test_csv_and_parquet_hold_what_pandas_does(log: Path) -> None:
    expected = hostlink.to_pandas(log)
    assert expected.attrs["units"]["force_n"] == "N"
    assert sorted(expected.finger.unique()) == [1, 2]
    usable = expected[expected.status & int(hostlink.NO_CONTROL) == 0]
    assert len(usable) == sum(not s.state.status & hostlink.NO_CONTROL for s in samples_of(log))
    table, parquet = log.with_suffix(".csv"), log.with_suffix(".parquet")
    for kind, path in (("--csv", table), ("--parquet", parquet)):
        assert run("decode", log, kind, path) == Done(0, err=f"{path}: {SAMPLES} samples\n")
    pd.testing.assert_frame_equal(pd.read_parquet(parquet), expected)
    read = pd.read_csv(table, converters={"status_names": str})
    pd.testing.assert_frame_equal(read, expected, rtol=0, atol=0.6e-6)
    names = [sum(hostlink.Status[name] for name in row.split()) for row in expected.status_names]
    assert names == list(expected.status)
    field = pyarrow.parquet.read_schema(parquet).field("force_n")
    assert field.metadata[b"unit"] == b"N"


def test_parquet_goes_on_beyond_one_piece(tmp_path: Path) -> None:
    n = ROWS_PER_PIECE + 3
    samples = (Sample(1, State(sample=k & 0xFFFF), k * 1.0, 0.0, k * 1.0) for k in range(n))
    assert write_parquet(samples, tmp_path / "a.parquet") == n
    file = pyarrow.parquet.ParquetFile(tmp_path / "a.parquet")
    assert file.num_row_groups == 2
    assert file.read(["arrival_s"])["arrival_s"].to_pylist() == [float(k) for k in range(n)]


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_a_damaged_recording_is_read_up_to_the_damage(log: Path, kind: str) -> None:
    damaged, out = log.with_suffix(".blf"), log.with_suffix(f".{kind}")
    with LogWriter(damaged) as writer:
        for message in read_log(log):
            writer.write(message)
    damaged.write_bytes(damaged.read_bytes() + b"nonsense" * 2)
    done = run("decode", damaged, f"--{kind}", out)
    assert done.code == 2
    assert f"damaged after {SAMPLES} messages" in done.err
    assert len(pd.read_csv(out) if kind == "csv" else pd.read_parquet(out)) == SAMPLES
