"""A hand for ROS's own tools: its description as URDF, and what RViz shows of it.

Frames carry the hand's namespace (`left_hand/thumb`), as in the messages.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, Final
from xml.etree import ElementTree

from hostlink.hand_file import HandFile, Mount, frame_in

__all__ = ["rviz_config", "stands_alone", "urdf"]

_TIP_RADIUS_M: Final = 0.01  # of the cylinder that stands for a tip
_FORCE_SCALE: Final = 0.01  # m of arrow for a newton
_TORQUE_SCALE: Final = 1.0  # m of arrow for a newton metre


def stands_alone(mounts: Sequence[Mount]) -> bool:
    """Whether the description is whole without the robot's own."""
    return not any(mount.parent for mount in mounts)


def urdf(mounts: Sequence[Mount], namespace: str) -> str:
    """Tips as cylinders on fixed joints. Links that a file names as parents are the robot's own."""
    root = ElementTree.Element("robot", name=namespace.strip("/") or "hand")
    if any(not mount.parent for mount in mounts):
        ElementTree.SubElement(root, "link", name=frame_in(namespace, "hand"))
    for mount in mounts:
        child = mount.frame(namespace)
        visual = ElementTree.SubElement(ElementTree.SubElement(root, "link", name=child), "visual")
        # z points out of the skin: the tip is behind it.
        ElementTree.SubElement(visual, "origin", xyz=f"0 0 {-_TIP_RADIUS_M / 2:g}")
        shape, size = ElementTree.SubElement(visual, "geometry"), f"{_TIP_RADIUS_M:g}"
        ElementTree.SubElement(shape, "cylinder", radius=size, length=size)
        joint = ElementTree.SubElement(root, "joint", name=f"{child}_mount", type="fixed")
        ElementTree.SubElement(joint, "parent", link=mount.parent_frame(namespace))
        ElementTree.SubElement(joint, "child", link=child)
        place, turn = (" ".join(f"{v:.9g}" for v in triple) for triple in (mount.place_m, mount.turn_rad))
        ElementTree.SubElement(joint, "origin", xyz=place, rpy=turn)
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _topic(name: str, durability: str = "Volatile") -> dict[str, Any]:
    return {
        "Value": name,
        "Depth": 5,
        "Durability Policy": durability,
        "History Policy": "Keep Last",
        "Reliability Policy": "Reliable",
    }


def _display(kind: str, name: str, options: dict[str, Any]) -> dict[str, Any]:
    return {"Class": f"rviz_default_plugins/{kind}", "Name": name, "Enabled": True, "Value": True} | options


def _finger(namespace: str, name: str) -> list[dict[str, Any]]:
    head = f"{namespace}/{name}"
    colours = {"Color Transformer": "Intensity", "Channel Name": "da", "Style": "Spheres", "Size (m)": 5e-4}
    arrows = {"Force Arrow Scale": _FORCE_SCALE, "Torque Arrow Scale": _TORQUE_SCALE, "Arrow Width": 0.2}
    return [
        _display("PointCloud2", f"{name} pins", {"Topic": _topic(f"{head}/pins")} | colours),
        _display("MarkerArray", f"{name} contacts", {"Topic": _topic(f"{head}/markers")}),
        _display("Wrench", f"{name} wrench", {"Topic": _topic(f"{head}/wrench")} | arrows),
    ]


def rviz_config(hand: HandFile, namespace: str) -> str:
    """A configuration of RViz: YAML, in JSON's subset of it."""
    topic = _topic(f"{namespace}/robot_description", "Transient Local")
    displays = [
        _display("Grid", "Grid", {"Cell Size": 0.01, "Plane Cell Count": 20}),
        _display("TF", "Frames", {"Marker Scale": 0.05, "Show Names": True}),
        _display("RobotModel", "Hand", {"Description Source": "Topic", "Description Topic": topic}),
    ]
    for mount in hand.mounts:
        displays += _finger(namespace, mount.name)
    fixed = {*(mount.parent_frame(namespace) for mount in hand.mounts)}
    orbit = {"Class": "rviz_default_plugins/Orbit", "Name": "Current View", "Distance": 0.3}
    config = {
        "Panels": [{"Class": "rviz_common/Displays", "Name": "Displays"}],
        "Visualization Manager": {
            "Class": "",
            "Displays": displays,
            "Global Options": {"Fixed Frame": min(fixed), "Frame Rate": 30},
            "Tools": [{"Class": "rviz_default_plugins/MoveCamera"}],
            "Views": {"Current": orbit},
        },
    }
    return json.dumps(config, indent=1) + "\n"
