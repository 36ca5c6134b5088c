"""A hand's file: read, refused in one line, and made use of by name."""

import json
import re
from math import pi
from pathlib import Path
from xml.etree import ElementTree

import pytest

import hostlink
from hostlink.commands.bridge import bridge
from hostlink.commands.monitor import Board, line
from hostlink.hand_file import HandFile, Mount, read_hand
from hostlink.view import HandView
from hostlink.web import parse_listen
from tests.support.commands import run_host
from tests.support.fingers import Fingers
from tests.support.waiting import until

HAND = """
name = "left_hand"
left = true
[[finger]]
name = "thumb"
node = 3
place_mm = [-40, 20.5, 0]
turn_deg = [0.0, 90.0, 30.0]
calibration = "3f9a"
[[finger]]
name = "index"
node = 1
parent = "index_distal"
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "hand.toml"
    path.write_text(HAND)
    return path


def test_a_hand_is_read(file: Path) -> None:
    hand = read_hand(file)
    thumb = Mount("thumb", 3, (-0.04, 0.0205, 0.0), (0.0, pi / 2, pi / 6), calibration="3f9a")
    index = Mount("index", 1, (0.03, 0.0, 0.0), parent="index_distal")
    assert hand == HandFile("left_hand", True, (thumb, index))
    assert hand.mount(3) == thumb
    assert hand.mount(7) == Mount("finger_7", 7, (6 * 0.03, 0.0, 0.0))
    assert hand.node("index") == 1
    with pytest.raises(hostlink.UsageError, match="no finger 'ring'; known by name: thumb, index"):
        hand.node("ring")


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("left = true", "left = 1", "left = 1: give true or false"),
        ("left = true", "right = true", "no key 'right'; known: name, left, finger"),
        ("left_hand", "left hand", "name = 'left hand': give a name of at most 20 letters"),
        ('"thumb"', '"th__umb"', "finger 1: name = 'th__umb': give a name"),
        ('"index"', '"thumb"', "name thumb is given twice"),
        ("node = 1", "node = 3", "node 3 is given twice"),
        ("node = 3", "node = 0", "finger 1: node = 0: give a number from 1 to 127"),
        ("node = 3", "", "finger 1: node is missing: give a number"),
        ("20.5, 0]", "20.5]", "place_mm = [-40, 20.5]: give three numbers"),
        ("index_distal", " ", "finger 2: parent = ' ': give the name of a frame"),
        (HAND, "", "finger is missing: give [[finger]] tables"),
        (HAND, "finger = 3", "finger = 3: give [[finger]] tables"),
        (HAND, "name = ", "not TOML: "),
    ],
)
def test_a_mistake_is_one_line(file: Path, old: str, new: str, expected: str) -> None:
    file.write_text(HAND.replace(old, new))
    assert f"{file}: " in (refusal := run_host("hand", file).refusal)
    assert expected in refusal


def test_ros_gets_a_description_and_a_view(file: Path, tmp_path: Path) -> None:
    urdf, rviz = tmp_path / "hand.urdf", tmp_path / "hand.rviz"
    shown = run_host("hand", file, "--urdf", urdf, "--rviz", rviz).printed
    assert "at -40, 20.5, 0 mm, turned by 0, 90, 30 deg, on left_hand/hand" in shown
    robot = ElementTree.parse(urdf).getroot()
    assert [link.get("name") for link in robot.iter("link")] == [
        f"left_hand/{n}" for n in ("hand", "thumb", "index")
    ]
    joints = [(j.find("parent"), j.find("child"), j.find("origin")) for j in robot.iter("joint")]
    named = [(p.get("link"), c.get("link")) for p, c, _ in joints if p is not None and c is not None]
    assert named == [("left_hand/hand", "left_hand/thumb"), ("index_distal", "left_hand/index")]
    assert joints[0][2] is not None
    assert joints[0][2].attrib == {"xyz": "-0.04 0.0205 0", "rpy": "0 1.57079633 0.523598776"}
    view = json.loads(rviz.read_text())["Visualization Manager"]
    assert view["Global Options"]["Fixed Frame"] == "index_distal"
    assert len(view["Displays"]) == 3 + 2 * 3


def test_fingers_are_called_by_their_names(file: Path) -> None:
    with Fingers("virtual:named", (1, 3)), hostlink.connect("virtual:named", hand=file) as hand:
        assert hand.finger("thumb").node == 3
        until(lambda: hand.latest("index"), "a sample")
        assert hand.finger("index").name == "index"
        named = [" ".join(line(row).split()[:2]) for row in Board(hand).rows()]
        assert named == ["finger=1 name=index", "finger=3 name=thumb"]
        hello = HandView(hand, parse_listen("127.0.0.1:0")).server._hello
        assert (hello["hand"], hello["names"], hello["left"]) == ([3, 1], {3: "thumb", 1: "index"}, True)


def test_the_documented_hand_is_one(tmp_path: Path) -> None:
    text = (Path(hostlink.__file__).parents[1] / "docs" / "robot.md").read_text(encoding="utf-8")
    path = tmp_path / "hand.toml"
    path.write_text(text.split("```toml\n", 1)[1].split("```", 1)[0])
    assert [mount.name for mount in read_hand(path).mounts] == ["thumb", "index"]


def test_the_launch_file_gives_the_bridge_options_that_it_has() -> None:
    folder = Path(hostlink.__file__).parent / "bridge" / "voronoi_touch_msgs"
    launch = ElementTree.parse(folder / "launch" / "hand.launch.xml").getroot()
    arguments = {arg.get("name") for arg in launch.iter("arg")}
    commands = [str(one.get("cmd")) for one in launch.iter("executable")]
    assert {*re.findall(r"\$\(var (\w+)\)", " ".join(commands))} <= arguments
    (ours,) = [command.split() for command in commands if command.startswith("voronoi-touch-host")]
    options = {option for one in bridge.params for option in one.opts}
    assert (ours[1], {word for word in ours if word.startswith("--")} - options) == ("bridge", set())
