"""Recordings of other tools: bags of ROS 2, and MCAP files in the encodings of ROS and Foxglove."""

import base64
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from edge.errors import SourceError
from edge.recording import ros
from edge.sources import open_source
from tests.edge.sources.test_pixels import CHROMA, GREY, H, W, encoded, interleaved, mcap_of, only, picture
from tests.support.refusals import one_line

STORE = get_typestore(Stores.ROS2_JAZZY)
IMAGE = "sensor_msgs/msg/Image"
COMPRESSED = "sensor_msgs/msg/CompressedImage"


def image_message(encoding: str, data: bytes, step: int, kind: str = IMAGE) -> tuple[str, bytes, str]:
    """A message's type, its bytes, and their encoding."""
    time = STORE.types["builtin_interfaces/msg/Time"](1, 2)
    about: Any = STORE.types["std_msgs/msg/Header"](time, "camera")
    values = np.frombuffer(data, np.uint8)
    fields = (encoding, values) if kind == COMPRESSED else (H, W, encoding, 0, step, values)
    return kind, bytes(STORE.serialize_cdr(STORE.types[kind](about, *fields), kind)), "cdr"


def in_json() -> tuple[str, bytes, str]:
    raw = {"width": W, "height": H, "encoding": "uyvy", "step": 2 * W}
    raw["data"] = base64.b64encode(interleaved(GREY, None, 0)).decode()
    return "foxglove.RawImage", json.dumps(raw).encode(), "json"


#: A message each, and the picture in it.
MESSAGES: dict[str, tuple[tuple[str, bytes, str], Any]] = {
    "mono8": (image_message("mono8", GREY.tobytes(), W), GREY),
    "mono16": (image_message("mono16", picture(16).tobytes(), 2 * W), picture(16)),
    "yuyv": (image_message("yuv422_yuy2", interleaved(GREY, 0, None), 2 * W), GREY),
    "nv12": (image_message("nv12", GREY.tobytes() + CHROMA, W), GREY),
    "PNG": (image_message("png", encoded(".png", GREY), 0, COMPRESSED), GREY),
    "JSON": (in_json(), GREY),
}


@pytest.mark.parametrize("kind", MESSAGES)
def test_an_image_of_ros_or_in_json_in_an_mcap_file(tmp_path: Path, kind: str) -> None:
    message, expected = MESSAGES[kind]
    assert np.array_equal(only(mcap_of(tmp_path / "a.mcap", *message)), expected)


@pytest.mark.parametrize("storage", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
def test_a_bag_of_ros(tmp_path: Path, storage: StoragePlugin) -> None:
    with Writer(tmp_path / "bag", version=9, storage_plugin=storage) as writer:
        text = writer.add_connection("/text", "std_msgs/msg/String", typestore=STORE)
        image = writer.add_connection("/image", IMAGE, typestore=STORE)
        writer.write(text, 0, STORE.serialize_cdr(STORE.types["std_msgs/msg/String"]("x"), text.msgtype))
        for ns in (3000, 1000, 2000):
            writer.write(image, ns, image_message("mono8", bytes([ns // 1000]) * (W * H), W)[1])
    (file,) = [path for path in (tmp_path / "bag").iterdir() if path.suffix in (".db3", ".mcap")]
    for path in (tmp_path / "bag", file):
        source = open_source(str(path))
        assert source.size_px == (W, H)
        assert [(f.capture_ns, f.image[0, 0]) for f in source] == [(1000, 1), (2000, 2), (3000, 3)]


@pytest.mark.parametrize(
    ("schema", "data", "encoding", "reason"),
    [
        (*image_message("32FC1", GREY.tobytes() * 4, 4 * W), "image encoding '32FC1' is not one of"),
        (*image_message("mono8", GREY.tobytes()[:9], W), "/i: image of 64x48 has 9 bytes, rows of 64"),
        (*image_message("png", b"no", 0, COMPRESSED), "/i: not an image"),
        (IMAGE, b"\0\1\0\0", "cdr", "/i: sensor_msgs/msg/Image does not decode: "),
        ("foxglove.RawImage", b"", "flatbuffer", "messages are encoded as 'flatbuffer', not as"),
        ("foxglove.CompressedVideo", b"", "protobuf", "its topics are /i (foxglove.CompressedVideo)"),
    ],
)  # fmt: skip
def test_why_no_image_is_read(tmp_path: Path, schema: str, data: bytes, encoding: str, reason: str) -> None:
    path = mcap_of(tmp_path / "a.mcap", schema, data, encoding)
    message = one_line(SourceError, open_source, str(path))
    assert f"{path}: no complete image on any topic: " in message
    assert reason in message


def test_without_rosbags_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ros._rosbags.cache_clear()
    ros._types.cache_clear()
    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    path = mcap_of(tmp_path / "a.mcap", *MESSAGES["mono8"][0])
    assert "install voronoi-touch[ros]" in one_line(SourceError, open_source, str(path))


def test_other_files_are_refused_as_bags(tmp_path: Path) -> None:
    (tmp_path / "metadata.yaml").write_text("x: 1\n")
    (tmp_path / "a.db3").write_bytes(b"not of SQLite")
    for path in (tmp_path, tmp_path / "a.db3"):
        assert "give a bag of ROS 2, or an MCAP file" in one_line(SourceError, open_source, str(path))
