"""Bags of ROS 2, and its images in MCAP files; through rosbags."""

from collections import Counter
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from edge.errors import SourceError
from edge.recording.mcap_file import RawMessage


@cache
def _rosbags(module: str) -> Any:
    """Raises SourceError: it is not installed."""
    try:
        return import_module(f"rosbags.{module}")
    except ImportError as error:
        raise SourceError(f"recording of ROS: {error}; install voronoi-touch[ros] or -e .[ros]") from error


@cache
def _types() -> Any:
    types = _rosbags("typesys")
    return types.get_typestore(types.Stores.ROS2_HUMBLE)  # images are the same in all releases


def ros_message(raw: RawMessage) -> Any:
    """An image message. Raises ValueError: damaged, another encoding; SourceError: no rosbags."""
    if raw.encoding != "cdr":
        raise ValueError(f"messages are encoded as {raw.encoding!r}, not as protobuf, json or cdr")
    types = _types()
    try:
        return types.deserialize_cdr(raw.data, raw.schema)
    except Exception as error:  # of struct, NumPy and its own
        raise ValueError(f"{raw.schema} does not decode: {error}") from error


def bag_messages(path: Path, faults: Counter[str]) -> Iterator[RawMessage]:
    """All messages of a bag in order of time, up to its damage, which is counted.

    path    a folder or a .db3
    Raises  SourceError: does not exist, not a bag, no message can be read
    """
    reader = _rosbags("rosbag2").Reader
    n = -1
    try:
        with reader(path) as bag:
            for n, (connection, log_ns, data) in enumerate(bag.messages()):
                yield RawMessage(connection.topic, connection.msgtype, "cdr", log_ns, n, data)
    except Exception as error:  # of SQLite, YAML, MCAP and its own
        if n < 0:
            raise SourceError(f"recording {path}: {error}; give a bag of ROS 2, or an MCAP file") from error
        faults["truncated"] = 1
