"""The configuration: every key checked, every mistake one line that names it."""

from __future__ import annotations

from pathlib import Path

import pytest

from edge.config import Config, load_config
from edge.errors import ConfigError
from edge.types import Feature


def test_an_empty_file_is_the_defaults(tmp_path: Path) -> None:
    path = tmp_path / "edge.toml"
    path.write_text("")
    assert load_config(path) == Config() == load_config(None)


def test_keys_are_read(tmp_path: Path) -> None:
    path = tmp_path / "edge.toml"
    path.write_text('[link]\nsinks = ["memory:"]\ndivider = 2\n[features]\ndemand = ["shear"]\n')
    config = load_config(path)
    assert config.link.sinks == ("memory:",)
    assert config.link.divider == 2
    assert config.features.demand == (Feature.SHEAR,)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[source]\nspeck = 'v4l2:0'\n", "unknown key 'speck' in [source]; known keys: spec, "),
        ("[sauce]\n", "unknown key 'sauce' in the top level; known keys: sensor, "),
        ("[sensor]\nnode_id = 128\n", "<= 127 - at `$.sensor.node_id`"),
        ("[sensor]\nnode_id = 'one'\n", "Expected `int`, got `str` - at `$.sensor.node_id`"),
        ("[features]\ndemand = ['taste']\n", "'taste' - at `$.features.demand[0]`"),
        ("[sensor\n", "not TOML"),
        ("\x00", "not TOML"),
    ],
)
def test_a_mistake_is_one_line_with_file_and_key(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "edge.toml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_config(path)
    message = str(caught.value)
    assert str(path) in message
    assert expected in message
    assert "\n" not in message


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"absent\.toml: cannot be read: No such file"):
        load_config(tmp_path / "absent.toml")
