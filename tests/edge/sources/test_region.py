"""A region of the images is the skin: what is outside makes no pins, and places stay as they are."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from calib.sim import Camera, Simulator, Tip
from edge.cli.assembly import expect_sensor
from edge.config import Config, SensorTable, SourceTable
from edge.errors import SourceError
from edge.pins import take_rest
from edge.recording.writer import Recorder
from edge.sensors import load_sensor
from edge.sources import open_source
from edge.sources.paced import Paced
from edge.types import Array, Image
from tests.edge.sources.test_sources import video_of
from tests.support.refusals import one_line
from tests.support.waiting import present

SIZE = (640, 320)


@pytest.fixture(scope="module")
def two_views(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two views of one tip of 127 pins side by side, as a picture."""
    view = Simulator(Camera(tip=Tip(n_pins=127, kind="hex"), size_px=(320, 320))).frame().image
    path = tmp_path_factory.mktemp("views") / "two.png"
    cv2.imwrite(str(path), np.hstack([view, view]))
    white = np.zeros(SIZE[::-1], np.uint8)
    white[:, :320] = 255
    cv2.imwrite(str(path.parent / "left.png"), white)
    return path


def _pins(image: Image) -> Array:
    return take_rest([image]).xy_img


@pytest.mark.parametrize(
    ("keys", "left"),
    [("roi=0,0,320,320", True), ("roi=320,0,320,320", False), ("circle=160,160,158", True),
     ("roi=0,0,170,320&roi=150,0,170,320", True), ("roi=320,0,170,320;470,0,170,320", False),
     ("mask={folder}/left.png", True), ("roi=0,0,500,320&mask={folder}/left.png", True)],
)  # fmt: skip
def test_pins_are_those_of_the_region_at_their_own_places(two_views: Path, keys: str, left: bool) -> None:
    whole = _pins(next(iter(open_source(str(two_views)))).image)
    expected = whole[(whole[:, 0] < 320) == left]
    source = open_source(f"{two_views}?{keys.format(folder=two_views.parent)}")
    frame = next(iter(source))
    assert frame.image.shape == SIZE[::-1]
    rest = take_rest([frame.image], region=source.region)
    assert rest.part is None  # parts that touch each other are one
    found = rest.xy_img
    assert len(found) == len(expected) == 127
    assert float(np.abs(found - expected).max()) < 0.05


def test_every_kind_of_source_takes_a_region(two_views: Path, tmp_path: Path) -> None:
    frame = next(iter(open_source(str(two_views))))
    with Recorder(tmp_path / "a.mcap") as recorder:
        recorder.frame(frame)
    video_of(tmp_path / "a.avi", frame.image)
    for where in (tmp_path / "a.mcap", tmp_path / "a.avi", two_views, "sim:press"):
        source = open_source(f"{where}?roi=0,0,320,320&width=640&height=320")
        live = source if isinstance(source, Paced) else Paced(source)
        shown = present(live.read(10.0))
        live.close()
        assert (shown.image[:, 320:] == shown.image[:, 319:320]).all(), where
        assert float(shown.image[:, :320].std()) > 10


def test_a_sensor_s_mask_lies_beside_its_file(two_views: Path) -> None:
    path = two_views.parent / "mine.toml"
    path.write_text('title = "mine"\n[camera]\nmask = "left.png"\n')
    assert load_sensor(str(path)).camera.mask == str(two_views.parent / "left.png")
    for config in (
        Config(sensor=SensorTable(model=str(path))),
        Config(source=SourceTable(circle="160,160,158")),
    ):
        source = open_source(str(two_views))
        expect_sensor(source, config)
        assert len(_pins(next(iter(source)).image)) == 127


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ("roi=1,2,3", "roi=1,2,3: give roi=x,y,w,h in pixels"),
        ("roi=0,0,9,9&roi=1,2,3", "roi=1,2,3: give roi=x,y,w,h in pixels"),
        ("roi=0,0,nan,9", "give roi=x,y,w,h in pixels"),
        ("circle=a,b,c", "give circle=x,y,r in pixels"),
        ("roi=700,0,20,20", "the region holds no skin in images of 640x320"),
        ("mask=absent.png", "image absent.png: no such file"),
        ("mask={folder}/small.png", "small.png is 32x32, the images are 640x320; make it as large"),
    ],
)
def test_a_region_that_is_none_is_one_line(two_views: Path, keys: str, expected: str) -> None:
    cv2.imwrite(str(two_views.parent / "small.png"), np.zeros((32, 32), np.uint8))
    assert expected in one_line(
        SourceError, open_source, f"{two_views}?{keys.format(folder=two_views.parent)}"
    )
