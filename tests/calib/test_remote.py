"""A simulated finger that another program presses."""

import socket
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from calib.rig.remote import RemoteSource, open_remote
from edge.errors import SourceError
from edge.sources.options import Options, parse_spec
from tests.support.fingers import free_port
from tests.support.waiting import SOON_S, until

TIP = '[tip]\nn_pins = 61\nkind = "hex"\n[camera]\nsize_px = [120, 100]\n'


@pytest.fixture
def finger(tmp_path: Path) -> Iterator[RemoteSource]:
    (tmp_path / "tip.toml").write_text(TIP)
    spec = parse_spec(f"sim-remote:{free_port()}?simulation={tmp_path / 'tip.toml'}", Options())
    with closing(open_remote(spec.where, spec.options)) as source:
        source.start()
        yield source


def press(finger: RemoteSource, message: bytes) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(message, ("127.0.0.1", int(finger.name.partition(":")[2])))


def test_each_pose_is_an_image_of_that_moment(finger: RemoteSource) -> None:
    press(finger, b"[]")
    before = finger.read(SOON_S)
    press(finger, b'[{"depth_mm": 1.5, "tool": {"kind": "sphere", "radius_mm": 3}}]')
    pressed = finger.read(SOON_S)
    assert before is not None
    assert pressed is not None
    assert before.image.shape == pressed.image.shape == (100, 120)
    assert before.capture_ns < pressed.capture_ns
    assert [frame.truth["depth_mm"] for frame in (before, pressed) if frame.truth] == [0.0, 1.5]


BAD = (b"", b"{", b'[{"depth_mm": "deep"}]', b'[{"depth_mm": 1, "x_mm": 99, "tool": {"kind": "sphere"}}]')


@pytest.mark.parametrize("message", BAD)
def test_a_bad_pose_costs_no_image(finger: RemoteSource, message: bytes) -> None:
    press(finger, message)
    until(lambda: finger.faults["bad pose"] == 1)
    press(finger, b"[]")
    frame = finger.read(SOON_S)
    assert frame is not None
    assert frame.sequence == 0


@pytest.mark.parametrize("where", ["", "0", "65536", "x", "-1", "4.5"])
def test_a_port_that_is_none_is_refused(where: str) -> None:
    with pytest.raises(SourceError, match="give 1 to 65535"):
        open_remote(where, Options())


def test_a_port_that_is_taken_and_a_file_that_is_missing_are_refused(tmp_path: Path) -> None:
    port = str(free_port())
    with closing(open_remote(port, Options())), pytest.raises(SourceError, match="in use"):
        open_remote(port, Options())
    with pytest.raises(SourceError, match=r"none\.toml"):
        open_remote(str(free_port()), Options(extra={"simulation": str(tmp_path / "none.toml")}))
