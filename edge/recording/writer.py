"""Writes a recording while the loop runs.

- Nothing here waits for the disk: a call puts references on a bounded queue, a thread encodes and
  writes them. What does not fit is dropped, counted, and the gap is written into the file as a warning.
- Nothing here raises into the loop once the file is open: a full disk stops the recording, says so in
  `fault`, and counts what comes after as dropped.
- A chunk is closed after `CHUNK_BYTES` or `CHUNK_AGE_S`, whichever comes first, and handed to the
  kernel whole: a killed process loses at most that much. (Power loss may cost more: fsync a chunk
  would stall an SD card; the file is synced when it is closed.)
- One time axis: `log_time` = capture time + one offset for the whole file, learnt from the wall clock
  at the first frame. Intervals stay exact, and all messages of a frame share one time.
"""

from __future__ import annotations

import os
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

from edge.errors import SinkError
from edge.recording import messages
from edge.recording.images import image_message
from edge.recording.topics import TOPICS, proto, schema_of
from edge.types import Array, Cells, Features, Frame, Reading, Tracks

__all__ = ["CHUNK_AGE_S", "CHUNK_BYTES", "Recorder"]

CHUNK_BYTES = 1 << 20  # the mcap library's own default; three raw 640x480 frames
CHUNK_AGE_S = 0.5  # a kill costs at most this much of a recording that has no images
OVERLAY_HZ = 15.0  # annotations are for the eye; 331 cells as protobuf cost about 2 ms of Python
_ITEM_BYTES = 512  # what a queued message weighs beside its arrays, roughly

_Item = tuple[
    int, str, int, int, int, Callable[[], bytes]
]  # cost, topic, log_ns, publish_ns, sequence, encode


class Recorder:
    """Writes one MCAP file.

    path         must not exist, unless `overwrite`
    image        "raw" for speed, "png" for small files
    compression  of the chunks: "none", "lz4", "zstd"
    buffer_mb    how much may wait for the disk before messages are dropped
    tip          about the tip, e.g. {"serial": ..., "pins": "331"}; found in the file's metadata
    rate_hz      nominal rate of the camera; 0 where unknown
    offset_ns    log time minus capture time; None: learnt from the wall clock at the first frame. A
                 simulator gives 0, so that the same frames make the same file.
    Raises       SinkError: the file exists or cannot be made
    """

    def __init__(
        self,
        path: str | Path,
        *,
        image: Literal["raw", "png"] = "raw",
        compression: Literal["none", "lz4", "zstd"] = "none",
        buffer_mb: float = 64.0,
        tip: Mapping[str, str] | None = None,
        rate_hz: float = 0.0,
        offset_ns: int | None = None,
        overwrite: bool = False,
    ) -> None:
        try:
            from mcap.writer import CompressionType, Writer
        except ImportError as error:
            raise SinkError(f"recording: {error}; install voronoi-touch[edge]") from error
        proto("RawImage")
        self.path = Path(path)
        try:
            self._file = open(self.path, "wb" if overwrite else "xb")  # noqa: SIM115  (closed by the thread)
        except FileExistsError as error:
            raise SinkError(f"recording: {self.path} exists; give another name") from error
        except OSError as error:
            raise SinkError(
                f"recording: cannot write {self.path}: {error.strerror}; give a folder that can be written"
            ) from error
        self._writer: Any = Writer(
            self._file,
            chunk_size=1 << 62,  # chunks are closed by `_end_chunk`, by size and age
            compression={
                "none": CompressionType.NONE,
                "lz4": CompressionType.LZ4,
                "zstd": CompressionType.ZSTD,
            }[compression],
        )
        self._writer.start(profile="", library="voronoi-touch")
        self._writer.add_metadata(
            "voronoi_touch",
            {"format": "1", "rate_hz": repr(float(rate_hz)), "image": image, **dict(tip or {})},
        )
        try:
            self._file.flush()
        except OSError as error:
            with suppress(OSError):  # closing tries the same bytes again
                self._file.close()
            raise SinkError(f"recording: cannot write {self.path}: {error.strerror}; make room") from error
        self._png = image == "png"
        self._offset_ns = offset_ns
        self._wall_ns, self._mono_ns = time.time_ns(), time.monotonic_ns()
        self._learn = offset_ns is None
        self._last_log_ns = 0
        self._next_overlay_ns = {"pins_overlay": 0, "cells_overlay": 0}

        self._limit = int(buffer_mb * 1e6)
        self._queue: deque[_Item | Callable[[], None]] = deque()
        self._queued_bytes = 0
        self._closing = False
        self._abandon = False
        self._wake = threading.Condition()
        self._channels: dict[str, int] = {}
        self._chunk_bytes = 0
        self._chunk_since = 0.0
        self._told_n = 0

        self.written_n: Counter[str] = Counter()  # messages by topic, in chunks that are closed or open
        self.dropped_n = 0  # messages that did not fit, or came after a fault
        self.refused_n = 0  # messages that could not be encoded; why stands in /events
        self.fault: str | None = None  # why nothing is written any more
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    # -- what the loop calls ------------------------------------------------------------------

    def frame(self, frame: Frame) -> bool:
        """Record image, times and truth. False: dropped."""
        log_ns = self._log_ns(frame)
        key = "image_png" if self._png else "image"
        about = {
            "sequence": frame.sequence,
            "capture_ns": frame.capture_ns,
            "clock": str(frame.clock),
            "bits": frame.bits,
        }
        items = [self._item("frame", frame, lambda: messages.to_json(about))]
        if frame.truth is not None:
            truth = {"sequence": frame.sequence, "truth": frame.truth}
            items.append(self._item("truth", frame, lambda: messages.to_json(truth)))
        items.append(
            self._item(
                key,
                frame,
                lambda: image_message(frame.image, log_ns, png=self._png),
                frame.image.nbytes,
            )
        )
        return self._put(items)

    def pins(self, frame: Frame, tracks: Tracks, features: Features | None = None) -> bool:
        """Record where each pin is; with features also its motion and its cell's area change."""
        log_ns = self._log_ns(frame)
        items = [
            self._item(
                "pins", frame, lambda: messages.pins_cloud(tracks, features, log_ns), tracks.xy_img.nbytes * 4
            )
        ]
        if self._overlay_due("pins_overlay", log_ns):
            items.append(
                self._item(
                    "pins_overlay", frame, lambda: messages.annotations_of(log_ns, points=tracks.xy_img)
                )
            )
        return self._put(items)

    def cells(
        self,
        frame: Frame,
        cells: Cells,
        polygons: Callable[[], Sequence[Array]] | None = None,
        colours: Callable[[], Sequence[tuple[float, float, float, float]]] | None = None,
    ) -> bool:
        """Record the cells' areas; with polygons and colours also the shaded cells, at a viewer's rate.

        polygons, colours  called in the recorder's thread, one entry a cell
        """
        log_ns = self._log_ns(frame)
        items = [
            self._item("cells", frame, lambda: messages.cells_cloud(cells, log_ns), cells.xy_img.nbytes * 3)
        ]
        if polygons is not None and colours is not None and self._overlay_due("cells_overlay", log_ns):
            items.append(
                self._item(
                    "cells_overlay",
                    frame,
                    lambda: messages.annotations_of(log_ns, polygons=polygons(), colours=colours()),
                )
            )
        return self._put(items)

    def features(self, frame: Frame, features: Features) -> bool:
        """Record the scalars and the contacts, image units."""
        return self._put(
            [self._item("features", frame, lambda: messages.to_json(messages.features_json(frame, features)))]
        )

    def reading(self, frame: Frame, reading: Reading) -> bool:
        """Record the calibrated values."""
        return self._put(
            [self._item("reading", frame, lambda: messages.to_json(messages.reading_json(frame, reading)))]
        )

    def sample(
        self,
        frame: Frame,
        values: Mapping[str, Any] | Callable[[], Mapping[str, Any]],
        payload: bytes | Callable[[], bytes] = b"",
    ) -> bool:
        """Record what the bus carried: decoded fields, and the bytes themselves.

        values, payload  or functions that give them, called in the recorder's thread
        """

        def encode() -> bytes:
            fields = values() if callable(values) else values
            data = payload() if callable(payload) else payload
            return messages.to_json(
                {"sequence": frame.sequence, "values": dict(fields), "payload": data.hex()}
            )

        return self._put([self._item("sample", frame, encode)])

    def event(self, level: str, text: str, name: str = "edge") -> bool:
        """Record a line of the log. level: debug, info, warning, error, fatal."""
        log_ns = self._now_ns() if self._learn else self._last_log_ns
        return self._put(
            [
                (
                    _ITEM_BYTES,
                    "events",
                    log_ns,
                    log_ns,
                    0,
                    lambda: messages.log_message(level, text, name, log_ns),
                )
            ]
        )

    def lose(self, messages_n: int) -> None:
        """Messages were lost on their way here: they count, and the gap is written into the file."""
        with self._wake:
            self.dropped_n += messages_n

    def attach(self, name: str, data: bytes, media_type: str = "application/json") -> None:
        """Store a file inside of the recording: calibration, configuration."""
        now = self._now_ns() if self._learn else self._last_log_ns

        def write() -> None:
            self._end_chunk()
            self._writer.add_attachment(now, now, name, media_type, data)

        with self._wake:
            self._queue.append(write)
            self._wake.notify()

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Store key-value pairs."""
        pairs = dict(values)

        def write() -> None:
            self._end_chunk()
            self._writer.add_metadata(name, pairs)

        with self._wake:
            self._queue.append(write)
            self._wake.notify()

    def close(self, timeout_s: float = 10.0) -> None:
        """Write what waits, the index, and end; what is not written after `timeout_s` is dropped."""
        with self._wake:
            self._closing = True
            self._wake.notify()
        self._thread.join(timeout_s)
        if self._thread.is_alive():
            self._abandon = True
            self._thread.join(1.0)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # -- times --------------------------------------------------------------------------------

    def _now_ns(self) -> int:
        """Wall time that does not step while the file is open."""
        return self._wall_ns + time.monotonic_ns() - self._mono_ns

    def _log_ns(self, frame: Frame) -> int:
        if self._offset_ns is None:
            self._offset_ns = self._now_ns() - frame.capture_ns
        self._last_log_ns = frame.capture_ns + self._offset_ns
        return self._last_log_ns

    def _overlay_due(self, topic: str, log_ns: int) -> bool:
        if 0 <= self._next_overlay_ns[topic] - log_ns < 1e9:
            return False
        self._next_overlay_ns[topic] = log_ns + int(1e9 / OVERLAY_HZ)
        return True

    # -- queue --------------------------------------------------------------------------------

    def _item(self, topic: str, frame: Frame, encode: Callable[[], bytes], n_bytes: int = 0) -> _Item:
        log_ns = frame.capture_ns + (self._offset_ns or 0)
        return (_ITEM_BYTES + n_bytes, topic, log_ns, frame.capture_ns, frame.sequence & 0xFFFFFFFF, encode)

    def _put(self, items: Sequence[_Item]) -> bool:
        cost = sum(item[0] for item in items)
        with self._wake:
            if self.fault is not None or self._closing or self._queued_bytes + cost > self._limit:
                self.dropped_n += len(items)
                return False
            self._queue.extend(items)
            self._queued_bytes += cost
            self._wake.notify()
        return True

    # -- the thread ---------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            while self._step():
                pass
            self._end_chunk()
            self._writer.finish()
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as error:
            self._fail(f"{self.path}: {error.strerror or error}")
        finally:
            try:
                self._file.close()
            except OSError as error:  # the buffered tail did not fit either
                self._fail(f"{self.path}: {error.strerror or error}")

    def _fail(self, why: str) -> None:
        with self._wake:
            self.fault = self.fault or why
            self.dropped_n += len(self._queue)
            self._queue.clear()
            self._queued_bytes = 0

    def _step(self) -> bool:
        """Write one message, or close a chunk that is old enough. False: nothing more will come."""
        with self._wake:
            while not self._queue:
                if self._closing:
                    return False
                left_s = self._chunk_since + CHUNK_AGE_S - time.monotonic() if self._chunk_bytes else None
                if left_s is not None and left_s <= 0:
                    break
                self._wake.wait(left_s)
            if self._abandon:
                self.dropped_n += len(self._queue)
                self._queue.clear()
                self._queued_bytes = 0
                return False
            item = self._queue.popleft() if self._queue else None
            lost_n = self.dropped_n - self._told_n
            self._told_n = self.dropped_n
        if item is None:
            self._end_chunk()
        elif not isinstance(item, tuple):
            item()
            self._file.flush()
        else:
            if lost_n:
                text = f"{lost_n} messages dropped: the disk is too slow"
                data = messages.log_message("warning", text, "recorder", item[2])
                self._add("events", item[2], item[2], 0, data)
            try:
                data = item[5]()
            except Exception as error:  # noqa: BLE001  (a viewer's callback must not end the recording)
                self.refused_n += 1
                text = f"{TOPICS[item[1]].name} not recorded: {type(error).__name__}: {error}"
                self._add(
                    "events", item[2], item[2], 0, messages.log_message("error", text, "recorder", item[2])
                )
            else:
                self._add(item[1], *item[2:5], data)
            with self._wake:
                self._queued_bytes -= item[0]
            if self._chunk_bytes >= CHUNK_BYTES or time.monotonic() - self._chunk_since >= CHUNK_AGE_S:
                self._end_chunk()
        return True

    def _add(self, key: str, log_ns: int, publish_ns: int, sequence: int, data: bytes) -> None:
        if key not in self._channels:
            topic = TOPICS[key]
            message_encoding, schema_encoding, schema = schema_of(topic)
            schema_id = self._writer.register_schema(topic.schema, schema_encoding, schema)
            self._channels[key] = self._writer.register_channel(topic.name, message_encoding, schema_id)
        if not self._chunk_bytes:
            self._chunk_since = time.monotonic()
        self._writer.add_message(self._channels[key], log_ns, data, publish_ns, sequence)
        self._chunk_bytes += len(data) + 1
        self.written_n[TOPICS[key].name] += 1

    def _end_chunk(self) -> None:
        """Close the chunk and hand it to the kernel: from here on a kill does not touch it."""
        self._writer.flush()
        self._chunk_bytes = 0
