"""`python -m calib` as a user types it: every mistake is one line and exit code 2, and nothing is written."""

from __future__ import annotations

from pathlib import Path

import pytest

from calib.__main__ import main


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ("dance", "No such command 'dance'; see python -m calib --help"),
        ("fit -o {out}/tip.json", "TABLE"),
        ("fit {data}/press.mcap -o {out}/tip.json", "press.mcap: a recording, but no capture"),
        ("fit {out}/absent.mcap -o {out}/tip.json", "absent.mcap: no such recording"),
        ("fit {data}/press.mcap --frames {data} -o {out}/tip.json", "leave --frames and --rest away"),
        ("evaluate {out}/absent.json {data}/press.mcap", "absent.json: cannot be read"),
        ("demo --data {out} --out {out}/demo", "no press.mcap in it; give --data"),
        ("demo --data {out}/absent --out {out}/demo", "no such folder of recordings"),
    ],
)
def test_a_mistake_is_one_line(
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    data_dir: Path,
    tmp_path: Path,
    arguments: str,
    expected: str,
) -> None:
    words = [word.format(data=data_dir, out=tmp_path) for word in arguments.split()]
    monkeypatch.setattr("sys.argv", ["calib", *words])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    (error,) = capfd.readouterr().err.splitlines()
    assert error.startswith("error: ")
    assert expected in error
    assert not list(tmp_path.iterdir())
