"""Writes a recording while the loop runs.

- A call puts references on a bounded queue, a thread encodes and writes them. What does not fit is dropped
  and counted, and a warning in the file marks the gap. A full disk sets `fault`; nothing raises into the
  loop.
- `log_time` is the capture time plus one offset for the whole file, taken from the wall clock at the first
  frame: intervals stay exact, and all messages of a frame share one time.
"""

import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Literal, Self

from edge.recording import messages
from edge.recording.images import image_message
from edge.recording.mcap_writer import Compression, McapWriter
from edge.recording.message_queue import Item, MessageQueue
from edge.recording.params import PARAMS
from edge.recording.topics import TOPICS, FoxgloveMessages, Topic, contacts_topic, sample_topic
from edge.types import Array, Cells, Features, Frame, Reading, Tracks
from hostlink.topics import Diagnosis, contact_scene, diagnostics_message, sample_message, tip_transforms
from hostlink.web.limits import WebLimits
from hostlink.wire import State

#: A topic or its key in TOPICS, and what encodes the message.
_Part = tuple[str | Topic, Callable[[], bytes]]


class _LogClock:
    """Times in the file.

    offset_ns  log time minus capture time; None: set at the first frame
    """

    def __init__(self, offset_ns: int | None) -> None:
        self._offset_ns = offset_ns
        self._learns = offset_ns is None
        self._wall_minus_monotonic_ns = time.time_ns() - time.monotonic_ns()
        self._last_ns = 0
        self._overlay_due_ns = {"pins_overlay": 0, "cells_overlay": 0}

    def _wall_ns(self) -> int:
        """Wall time that does not step while the file is open."""
        return self._wall_minus_monotonic_ns + time.monotonic_ns()

    def now_ns(self) -> int:
        """Time for messages that belong to no frame."""
        return self._wall_ns() if self._learns else self._last_ns

    def of(self, frame: Frame) -> int:
        if self._offset_ns is None:
            self._offset_ns = self._wall_ns() - frame.capture_ns
        self._last_ns = frame.capture_ns + self._offset_ns
        return self._last_ns

    def overlay_is_due(self, topic: str, log_ns: int) -> bool:
        """Whether another one is due: as often as the live page shows one."""
        if 0 <= self._overlay_due_ns[topic] - log_ns < 1e9:
            return False
        self._overlay_due_ns[topic] = log_ns + int(1e9 / WebLimits().rate_hz)
        return True


class Recorder:
    """Writes one MCAP file.

    path         must not exist, unless `overwrite`
    image        "raw" for speed, "png" for small files
    compression  of the chunks: "none", "lz4", "zstd"
    buffer_mb    size of the queue to the disk; messages beyond it are dropped
    tip          about the tip, e.g. {"serial": ..., "pins": "331"}; found in the file's metadata
    rate_hz      nominal rate of the camera; 0 where unknown
    offset_ns    log time minus capture time; None: from the wall clock at the first frame. A
                 simulator gives 0, so that the same frames make the same file.
    fault        why writing has stopped
    refused_n    messages that could not be encoded; the reasons are in /events
    Raises       SinkError: the file exists or cannot be created
    """

    def __init__(
        self,
        path: str | Path,
        *,
        image: Literal["raw", "png"] = "raw",
        compression: Compression = "none",
        buffer_mb: float = 64.0,
        tip: Mapping[str, str] | None = None,
        rate_hz: float = 0.0,
        offset_ns: int | None = None,
        overwrite: bool = False,
    ) -> None:
        self.path = Path(path)
        about = {"format": "1", "rate_hz": repr(float(rate_hz)), "image": image, **dict(tip or {})}
        self._writer = McapWriter(self.path, compression, about, overwrite)
        self._queue = MessageQueue(int(buffer_mb * 1e6))
        self._clock = _LogClock(offset_ns)
        self._png = image == "png"
        self.refused_n = 0
        self.fault: str | None = None
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    @property
    def written_n(self) -> Counter[str]:
        """Messages by topic, in chunks that are closed or open."""
        return self._writer.written_n

    @property
    def dropped_n(self) -> int:
        """Messages that did not fit, or came after a fault."""
        return self._queue.dropped_n

    # -- called by the loop ------------------------------------------------------------------

    def frame(self, frame: Frame) -> bool:
        """Record image, times and truth. False: dropped."""
        log_ns = self._clock.of(frame)
        about = {
            "sequence": frame.sequence,
            "capture_ns": frame.capture_ns,
            "clock": str(frame.clock),
            "bits": frame.bits,
        }
        parts: list[_Part] = [("frame", lambda: messages.to_json(about))]
        if frame.truth is not None:
            truth = {"sequence": frame.sequence, "truth": frame.truth}
            parts.append(("truth", lambda: messages.to_json(truth)))
        key = "image_png" if self._png else "image"
        parts.append((key, lambda: image_message(frame.image, log_ns, png=self._png)))
        return self._put(frame, parts, frame.image.nbytes)

    def pins(self, frame: Frame, tracks: Tracks, features: Features | None = None) -> bool:
        """Record where each pin is; with features also its motion and its cell's area change."""
        log_ns = self._clock.of(frame)
        parts: list[_Part] = [("pins", lambda: messages.pins_cloud(tracks, features, log_ns))]
        if self._clock.overlay_is_due("pins_overlay", log_ns):
            parts.append(("pins_overlay", lambda: messages.annotations_of(log_ns, points=tracks.xy_img)))
        return self._put(frame, parts, tracks.xy_img.nbytes * 4)

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
        log_ns = self._clock.of(frame)
        parts: list[_Part] = [("cells", lambda: messages.cells_cloud(cells, log_ns))]
        if polygons and colours and self._clock.overlay_is_due("cells_overlay", log_ns):
            parts.append(
                (
                    "cells_overlay",
                    lambda: messages.annotations_of(log_ns, polygons=polygons(), colours=colours()),
                )
            )
        return self._put(frame, parts, cells.xy_img.nbytes * 3)

    def features(self, frame: Frame, features: Features) -> bool:
        """Record the scalars and the contacts, image units."""
        return self._put(
            frame, [("features", lambda: messages.to_json(messages.features_json(frame, features)))]
        )

    def reading(self, frame: Frame, reading: Reading) -> bool:
        return self._put(
            frame, [("reading", lambda: messages.to_json(messages.reading_json(frame, reading)))]
        )

    def sample(self, frame: Frame, finger: int, state: Callable[[], State]) -> bool:
        """Record the sample sent to the bus: its values, and its contacts as a scene.

        state  gives it as the host receives it; called in the recorder's thread
        """
        log_ns = self._clock.of(frame)

        def scene() -> bytes:
            return bytes(contact_scene(FoxgloveMessages(), finger, state(), log_ns).SerializeToString())

        values = (sample_topic(finger), lambda: messages.to_json(sample_message(state())))
        return self._put(frame, [values, (contacts_topic(finger), scene)])

    def diagnosis(self, frame: Frame, diagnosis: Diagnosis) -> bool:
        """Record the state of the finger, and where its tip is."""
        log_ns = self._clock.of(frame)

        def tips() -> bytes:
            return bytes(tip_transforms(FoxgloveMessages(), [diagnosis.name], log_ns).SerializeToString())

        state = ("diagnostics", lambda: messages.to_json(diagnostics_message([diagnosis], log_ns)))
        return self._put(frame, [state, ("tf", tips)])

    def event(self, level: str, text: str, name: str = "edge") -> bool:
        """Record a line of the log. level: debug, info, warning, error, fatal."""
        log_ns = self._clock.now_ns()

        def encode() -> bytes:
            return messages.log_message(level, text, name, log_ns)

        return self._queue.put([Item(PARAMS.item_bytes, TOPICS["events"], log_ns, log_ns, 0, encode)])

    def count_lost(self, messages_n: int) -> None:
        """Count messages that were lost before the recorder; a warning in the file marks the gap."""
        self._queue.count_lost(messages_n)

    def attach(self, name: str, data: bytes, media_type: str = "application/json") -> None:
        """Store a file in the recording: calibration, configuration."""
        now_ns = self._clock.now_ns()
        self._queue.put_call(lambda: self._writer.add_attachment(now_ns, name, data, media_type))

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        pairs = dict(values)
        self._queue.put_call(lambda: self._writer.add_metadata(name, pairs))

    def close(self, timeout_s: float = 10.0) -> None:
        """Write the queue and the index, and end; messages not written after `timeout_s` are dropped."""
        self._queue.close()
        self._thread.join(timeout_s)
        if self._thread.is_alive():
            self._queue.give_up()
            self._thread.join(1.0)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _put(self, frame: Frame, parts: Sequence[_Part], n_bytes: int = 0) -> bool:
        """Queue messages of a frame, all or none.

        n_bytes  memory that they keep, beside their own
        """
        log_ns, sequence = self._clock.of(frame), frame.sequence & 0xFFFFFFFF
        items = []
        for topic, encode in parts:
            topic = TOPICS[topic] if isinstance(topic, str) else topic
            cost = PARAMS.item_bytes + (n_bytes if encode is parts[-1][1] else 0)
            items.append(Item(cost, topic, log_ns, frame.capture_ns, sequence, encode))
        return self._queue.put(items)

    # -- the thread ---------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            while not self._queue.ended:
                self._step()
            self._writer.finish()
        except OSError as error:
            self._fail(error)
        finally:
            try:
                self._writer.close()
            except OSError as error:
                self._fail(error)

    def _fail(self, error: OSError) -> None:
        self.fault = self.fault or f"{self.path}: {error.strerror or error}"
        self._queue.give_up()

    def _step(self) -> None:
        """Write one message, or close a chunk that is old enough. Raises OSError."""
        item = self._queue.get(self._writer.chunk_due_s)
        if isinstance(item, Item):
            self._write(item)
            self._queue.done(item)
        elif item is not None:
            item()
        if self._writer.chunk_due_s == 0.0:
            self._writer.end_chunk()

    def _write(self, item: Item) -> None:
        if lost_n := self._queue.newly_dropped():
            self._note("warning", f"{lost_n} messages dropped: the disk is too slow", item.log_ns)
        try:
            data = item.encode()
        except Exception as error:  # noqa: BLE001  (a viewer's callback must not end the recording)
            self.refused_n += 1
            why = f"{type(error).__name__}: {error}"
            self._note("error", f"{item.topic.name} not recorded: {why}", item.log_ns)
        else:
            self._writer.add(item.topic, item.log_ns, item.publish_ns, item.sequence, data)

    def _note(self, level: str, text: str, log_ns: int) -> None:
        """Write a line of the recorder's own log."""
        data = messages.log_message(level, text, "recorder", log_ns)
        self._writer.add(TOPICS["events"], log_ns, log_ns, 0, data)
