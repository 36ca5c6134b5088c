"""The bundled recording of a press on 331 pins, its calibration, and a finger that has its rest frame."""

from pathlib import Path

import pytest

from edge.calibration import Calibration
from edge.sources import open_source
from edge.types import Frame
from tests.support.finger import Finger


@pytest.fixture(scope="session")
def frames(data_dir: Path) -> list[Frame]:
    """8 untouched, then a ball pressed in."""
    return list(open_source(str(data_dir / "press.mcap")))


@pytest.fixture(scope="session")
def calibration(data_dir: Path) -> Calibration:
    return Calibration.load(data_dir / "rings331_ball.json")


@pytest.fixture
def finger(frames: list[Frame], calibration: Calibration) -> Finger:
    return Finger(frames, calibration)
