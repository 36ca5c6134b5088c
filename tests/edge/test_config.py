"""The configuration: every key checked, every mistake one line that names it."""

from pathlib import Path

import pytest

from edge.config import Config, load_config
from edge.errors import ConfigError
from edge.limits import FILE_BYTES
from edge.types import Feature
from tests.support.refusals import one_line


def test_keys_are_read_and_an_empty_file_is_the_defaults(tmp_path: Path) -> None:
    path = tmp_path / "edge.toml"
    path.write_text('[link]\nsinks = ["memory:"]\ndivider = 2\n[features]\ndemand = ["shear"]\n')
    config = load_config(path)
    assert (config.link.sinks, config.link.divider) == (("memory:",), 2)
    assert config.features.demand == (Feature.SHEAR,)
    path.write_text("")
    assert load_config(path) == Config() == load_config(None)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[source]\nspeck = 'v4l2:0'\n", "source: unknown key 'speck'; known: spec, "),
        ("[sauce]\n", "unknown key 'sauce'; known: sensor, "),
        ("[sensor]\nnode_id = 128\n", ": sensor.node_id: must be at most 127"),
        ("[sensor]\nnode_id = 'one'\n", "sensor.node_id: must be a whole number, is text"),
        ("[sensor]\nserial = 42\n", "sensor.serial: must be text, is a whole number"),
        ("sensor = 3\n", "sensor: must be a table {...}, is a whole number"),
        ("[source]\nrate_hz = nan\n", "source.rate_hz = nan: give a finite number"),
        ("[tare]\nsteady_px = 0\n", "tare.steady_px: must be at least 0.01"),
        ("[tare]\nsteady_px = inf\n", "tare.steady_px = inf: give a finite number"),
        ("[source]\nspec = " + "[" * 20_000, "nested too deeply"),
        ("#" * (FILE_BYTES + 1), "larger than 2048 KiB"),
        ('"a\\nb" = 1\n', r"unknown key 'a\nb'; known: "),
        ("[link]\nsinks = 'can:can0'\n", "link.sinks: must be a list, is text"),
        ("[link]\nsinks = ['memory:', 2]\n", "link.sinks[1]: must be text, is a whole number"),
        (
            "[features]\ndemand = ['taste']\n",
            "features.demand[0]: unknown value 'taste'; known: displacement, ",
        ),
        ("[sensor\n", "not TOML"),
        ("\x00", "not TOML"),
    ],
)
def test_a_mistake_is_one_line_with_file_and_key(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "edge.toml"
    path.write_text(text)
    message = one_line(ConfigError, load_config, path)
    assert str(path) in message
    assert expected in message


def test_every_key_is_checked_and_named(tmp_path: Path) -> None:
    """No key accepts a datetime."""
    path = tmp_path / "edge.toml"
    for section in Config.__struct_fields__:
        for key in getattr(Config(), section).__struct_fields__:
            path.write_text(f"[{section}]\n{key} = 2020-01-01\n")
            with pytest.raises(ConfigError, match=rf"{section}\.{key}: must be (a|text|true)"):
                load_config(path)
    message = one_line(ConfigError, load_config, tmp_path / "absent.toml")
    assert "absent.toml: cannot be read: No such file" in message
