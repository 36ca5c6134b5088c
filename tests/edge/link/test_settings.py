"""Settings survive a restart, or report that they do not; no file stops the finger."""

import errno
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import settings as limits
from hypothesis import strategies as st

from edge.limits import FILE_BYTES
from edge.link.settings import NodeSettings, SettingsFile
from hostlink.output_file import OutputError
from hostlink.wire import OBJECTS
from tests.support.nasty import NASTY

STORED = [o for o in OBJECTS if o.stored and o.type != "domain"]


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        '{"divider": 0}',
        '{"speed": 1}',
        '{"rate_hz": "fast"}',
        pytest.param('{"divider": ' + "9" * 4000 + "}", id="a number without end"),
        '{"rate_hz": NaN}',
        '{"rate_hz": 1e400}',
        "[" * 100_000,
        '{"divider": 2' + " " * FILE_BYTES + "}",
        "\xff",
    ],
)
def test_an_unusable_settings_file_gives_defaults(
    tmp_path: Path, text: str, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "settings.json"
    path.write_text(text, encoding="latin-1")
    assert SettingsFile(path).values == NodeSettings()
    assert "starting with defaults" in caplog.text


@pytest.mark.generative
@limits(max_examples=200)
@given(
    raw=st.one_of(
        st.binary(max_size=200),
        st.text('{}[]":,0123456789eE-.truefalsnidvr_hz', max_size=120).map(str.encode),
        st.dictionaries(st.sampled_from([row.name for row in STORED]), st.sampled_from(NASTY))
        .map(lambda table: "{" + ",".join(f'"{name}":{value}' for name, value in table.items()) + "}")
        .map(str.encode),
    )
)
def test_any_bytes_give_values_within_limits(tmp_path_factory: pytest.TempPathFactory, raw: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "fuzzed.json"
    path.write_bytes(raw)
    values = SettingsFile(path).values
    for row in STORED:
        assert row.low is not None
        assert row.high is not None
        assert row.low <= getattr(values, row.name) <= row.high


@pytest.mark.parametrize("step", ["write", "fsync", "replace"])
def test_a_full_disk_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    file = SettingsFile(tmp_path / "settings.json")
    file.change(divider=3)
    kept = (tmp_path / "settings.json").read_bytes()

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    target = {"write": (Path, "write_bytes"), "fsync": (os, "fsync"), "replace": (Path, "replace")}[step]
    with monkeypatch.context() as patched:
        patched.setattr(*target, full)
        with pytest.raises(OutputError, match="No space left"):
            file.change(divider=7)
        with pytest.raises(OutputError, match="No space left"):
            file.restore_defaults()
    assert file.values.divider == 3
    assert "No space left" in file.trouble()
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"settings.json": kept}
    file.change(divider=8)
    assert file.trouble() == ""
