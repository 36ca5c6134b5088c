"""Reads recordings back: ours, and any MCAP file with a Foxglove image topic.

Damage is counted in `faults`, and reading goes on; only a file without any image is an error. Frames have
`Clock.RECORDED`: their times may be compared with one another, not with the present.
"""

from collections import Counter
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Annotated, Any

import cv2
import msgspec

from edge.errors import SourceError
from edge.examples import SCHEME, example_file
from edge.limits import RATE_MAX_HZ
from edge.recording.images import IMAGE_SCHEMAS, OtherSize, decode_image
from edge.recording.mcap_file import RawMessage, damage, image_count, raw_messages, read_metadata
from edge.recording.ros import bag_messages
from edge.recording.topics import TOPICS
from edge.sources.files import FileSource
from edge.sources.live import PARAMS as LIVE
from edge.sources.live import rate_of
from edge.sources.options import Options
from edge.types import Clock, Frame

_TIME_MAX_NS = 1 << 62  # 146 years
_SEQUENCE_MAX = 1 << 53


class _About(msgspec.Struct):
    """A frame's data beside its image (`topics.py`)."""

    sequence: Annotated[int, msgspec.Meta(ge=0, le=_SEQUENCE_MAX)]
    capture_ns: Annotated[int, msgspec.Meta(ge=0, le=_TIME_MAX_NS)]
    clock: Clock = Clock.RECORDED
    bits: Annotated[int, msgspec.Meta(ge=1, le=16)] | None = None


class _Truth(msgspec.Struct):
    """The truth of a frame, from a rig or simulator."""

    truth: dict[str, Any] | None = None


class RecordingSource(FileSource):
    """FrameSource over an MCAP file, or a bag of ROS 2: a folder, or a .db3 of it.

    topic   image topic; None: the first one with images that can be read
    Raises  SourceError: does not exist, no recording, no images; those of another size are counted
    """

    def __init__(self, path: str | Path, topic: str | None = None) -> None:
        super().__init__("recording", path)
        self._is_bag = self.path.is_dir() or self.path.suffix.lower() == ".db3"
        self.metadata = {} if self._is_bag else read_metadata(self.path)
        self._topic = topic
        self._refused = ""  # why the first image that could not be read was not
        faults: Counter[str] = Counter()
        first = next(self._frames(faults), None)
        if first is None and (faults["truncated"] or faults["damaged chunk"]):
            how = "cut off" if faults["truncated"] else "damaged"
            raise SourceError(f"{self.name}: {how} before its first whole image; copy or record it again")
        if first is None:
            wanted = f"on topic {topic}" if topic else "on any topic"
            raise SourceError(f"{self.name}: no complete image {wanted}: {self._refused or self._listed()}")
        self.size_px = (first.image.shape[1], first.image.shape[0])
        self.rate_hz = self._rate_hz()
        self.frames_n = 0 if self._is_bag else image_count(self.path, self._topic)

    def _messages(self, faults: Counter[str]) -> Iterator[RawMessage]:
        return (bag_messages if self._is_bag else raw_messages)(self.path, faults)

    def _listed(self) -> str:
        """The topics, for one who expected an image."""
        found = sorted({f"{raw.topic} ({raw.schema})" for raw in self._messages(Counter())})
        return f"its topics are {', '.join(found[:9])}" if found else "it has no messages"

    def _rate_hz(self) -> float:
        """The rate stated by the recorder, else from the median of the first intervals."""
        try:
            rate_hz = float(self.metadata.get("voronoi_touch", {}).get("rate_hz", "0"))
        except ValueError:
            rate_hz = 0.0
        if 0 < rate_hz < RATE_MAX_HZ:
            return rate_hz
        images = (raw.log_ns for raw in self._messages(Counter()) if self._is_image(raw))
        return rate_of(list(islice(images, LIVE.rate_frames_n + 1)), 1e9)

    def _is_image(self, raw: RawMessage) -> bool:
        return raw.schema in IMAGE_SCHEMAS and self._topic in (None, raw.topic)

    def _frames(self, faults: Counter[str]) -> Iterator[Frame]:
        about_ns = truth_ns = -1  # log times of the data beside an image
        about, truth = _About(0, 0), None
        n = 0
        broken = damage(TypeError, msgspec.DecodeError, cv2.error)  # YUV of an odd width has no colour
        for raw in self._messages(faults):
            try:
                if raw.topic == TOPICS["frame"].name:
                    about, about_ns = msgspec.json.decode(raw.data, type=_About), raw.log_ns
                elif raw.topic == TOPICS["truth"].name:
                    truth, truth_ns = msgspec.json.decode(raw.data, type=_Truth).truth, raw.log_ns
                elif self._is_image(raw):
                    image, colour = decode_image(raw, self.size_px, self.keeps_colour)
                    self._topic = raw.topic
                    if about_ns != raw.log_ns:  # another tool's file
                        about = _About(raw.sequence or n, raw.log_ns)
                    bits, bits_max = about.bits or self._bits_of(image), 8 * image.itemsize
                    if bits > bits_max or about.capture_ns > _TIME_MAX_NS:
                        raise ValueError(f"{bits} bits of {bits_max}, at {about.capture_ns} ns")
                    known = truth if truth_ns == raw.log_ns else None
                    yield Frame(image, about.capture_ns, about.sequence, Clock.RECORDED, bits, known, colour)
                    n += 1
            except OtherSize:
                faults["other image size"] += 1
            except broken as error:
                faults["damaged message"] += 1
                self._refused = self._refused or f"{raw.topic}: {error}"


class RecordingKeys(msgspec.Struct):
    topic: str | None = None  # image topic


def open_recording(where: str, options: Options) -> RecordingSource:
    """The scheme `mcap:FILE?topic=...`, and files that end in .mcap. Raises SourceError."""
    return RecordingSource(where, options.own(where, RecordingKeys).topic)


def open_example(where: str, options: Options) -> RecordingSource:
    """The scheme `example:NAME`. Raises SourceError."""
    return open_recording(str(example_file(SCHEME + where, ".mcap")), options)
