"""The messages of a recording, decoded."""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec

from edge.errors import SourceError
from edge.recording.mcap_file import damage, raw_messages
from edge.recording.topics import proto


def read_messages(path: str | Path, topics: Sequence[str] | None = None) -> Iterator[tuple[str, int, Any]]:
    """(topic, log time ns, message) in order of time: JSON as dict, Foxglove as protobuf object.

    A damaged message is skipped.
    Raises SourceError: does not exist, not MCAP
    """
    broken = damage(msgspec.DecodeError, SourceError)  # SourceError: unknown schema
    for raw in raw_messages(Path(path), Counter()):
        if topics is not None and raw.topic not in topics:
            continue
        try:
            if raw.encoding == "json":
                message = msgspec.json.decode(raw.data)
            elif raw.encoding == "protobuf" and raw.schema.startswith("foxglove."):
                message = proto(raw.schema.removeprefix("foxglove.")).FromString(raw.data)
            else:
                continue
        except broken:
            continue
        yield raw.topic, raw.log_ns, message
