"""The known sensors' files: each figure with its source, each mistake one line."""

from pathlib import Path

import msgspec
import pytest

from edge.errors import ConfigError
from edge.sensors import KnownSensor, known_sensors, load_sensor, sensor_names
from tests.support.refusals import one_line


def figures(sensor: KnownSensor) -> set[str]:
    """Keys of all that the file states."""
    tables = {"pins": sensor.pins, "tip": sensor.tip, "camera": sensor.camera}
    return {
        f"{table}.{key}"
        for table, content in tables.items()
        for key, value in msgspec.structs.asdict(content).items()
        if value is not None
    }


def test_the_sensors_asked_for_are_there() -> None:
    assert sensor_names() == ["digitac", "gelsight-mini", "square-grid", "tactip-127", "tactip-331"]


@pytest.mark.parametrize("sensor", known_sensors(), ids=lambda s: s.name)
def test_each_figure_has_its_source_and_each_source_a_figure(sensor: KnownSensor) -> None:
    assert figures(sensor) == sensor.sources.keys()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[pins]\n", "lacks title"),
        ('title = "a"\n[pins]\npitch_mm = -1.0\n', "pitch_mm: must be a number from above 0 to 1000 or "),
        ('title = "a"\n[pins]\nlayout = "spiral"\n', "pins.layout: unknown value 'spiral'; known: hex, "),
        ('title = "a"\n[pins]\ncount = 3\n', "pins.count: must be a whole number from 12 to "),
        ('title = "a"\npin = 3\n', "unknown key 'pin'"),
        ('title = "a"\nname = "b"\n', "unknown key 'name'; it follows from the file's name"),
    ],
)
def test_a_mistake_is_one_line_with_the_file(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    message = one_line(ConfigError, load_sensor, str(path))
    assert str(path) in message
    assert expected in message
