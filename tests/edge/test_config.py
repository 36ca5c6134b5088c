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
        ("[sensor]\nnode_id = 128\n", ": sensor.node_id: must be a whole number from 1 to 127, is 128"),
        ("[source]\nrate_hz = nan\n", "source.rate_hz: must be a number from 0 to 1000000, is NaN"),
        ("[features]\nsmooth_ms = -1\n", "features.smooth_ms: must be a number from 0 to 1000, is -1"),
        ("#" * (FILE_BYTES + 1), "larger than 2048 KiB"),
        ("[link]\nsinks = 'can:can0'\n", 'link.sinks: must be a list, each of it text, is "can:can0"'),
        ("[features]\ndemand = ['taste']\n", "demand[0]: unknown value 'taste'; known: displacement, "),
        ("[sensor\n", "not TOML"),
    ],
)
def test_a_mistake_is_one_line_with_file_and_key(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "edge.toml"
    path.write_text(text)
    message = one_line(ConfigError, load_config, path)
    assert str(path) in message
    assert expected in message


def test_every_key_names_its_values(tmp_path: Path) -> None:
    """No key accepts a datetime; every number has a whole range."""
    path = tmp_path / "edge.toml"
    wanted = r"(text|one of .+|true or false|a (whole )?number from \S+ to \S+|a list, each of it .+)"
    for section in Config.__struct_fields__:
        for key in getattr(Config(), section).__struct_fields__:
            path.write_text(f"[{section}]\n{key} = 2020-01-01\n")
            refusal = rf"{section}\.{key}: must be {wanted}( of at most \d+ characters)?, is \"2020-01-01\"$"
            with pytest.raises(ConfigError, match=refusal):
                load_config(path)
    message = one_line(ConfigError, load_config, tmp_path / "absent.toml")
    assert "absent.toml: cannot be read: No such file" in message
