"""Writes a recording while the loop runs.

- A call puts references on a bounded queue, a thread encodes and writes them. What does not fit is dropped
  and counted, and a warning in the file marks the gap. A full disk sets `fault`; nothing raises into the
  loop.
- `log_time` is the capture time plus an offset, taken from the wall clock at the first frame, and again where
  the camera's clock begins anew: intervals stay exact, and all messages of a frame share one time.
"""

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import Literal

from edge.recording import messages
from edge.recording.images import image_message
from edge.recording.mcap_writer import PARAMS, Compression, McapWriter
from edge.recording.message_queue import MessageQueue
from edge.recording.topics import TOPICS, FoxgloveMessages, Topic, contacts_topic, sample_topic
from edge.types import Frame, Result
from hostlink.topics import (
    DIAGNOSIS_S,
    Diagnosis,
    TipPlace,
    contact_scene,
    diagnostics_message,
    finger_name,
    level_of,
    sample_message,
    status_text,
    tip_transforms,
)
from hostlink.web.limits import WebLimits
from hostlink.wire import State, pack_state, unpack_state

#: A topic or its key in TOPICS, and what encodes the message.
_Part = tuple[str | Topic, Callable[[], bytes]]


class _LogClock:
    """Times in the file: capture time plus offset_ns; None: it is set at the first frame."""

    def __init__(self, offset_ns: int | None) -> None:
        self._offset_ns = offset_ns
        self._learns = offset_ns is None
        self._wall_minus_monotonic_ns = time.time_ns() - time.monotonic_ns()
        self._last_ns = 0
        self._overlay_due_ns = 0

    def now_ns(self) -> int:
        """Time for messages that belong to no frame: wall time that does not step while the file is open."""
        return self._wall_minus_monotonic_ns + time.monotonic_ns() if self._learns else self._last_ns

    def of(self, frame: Frame) -> int:
        """Log time of a frame; it grows, though the camera's clock may begin anew."""
        if self._offset_ns is None or frame.capture_ns + self._offset_ns < self._last_ns:
            self._offset_ns = max(self.now_ns(), self._last_ns + 1) - frame.capture_ns
        self._last_ns = frame.capture_ns + self._offset_ns
        return self._last_ns

    def overlay_is_due(self, log_ns: int) -> bool:
        """Whether another one is due: as often as the live page shows one."""
        if 0 <= self._overlay_due_ns - log_ns < 1e9:
            return False
        self._overlay_due_ns = log_ns + int(1e9 / WebLimits().rate_hz)
        return True


class Recorder(AbstractContextManager["Recorder"]):
    """Writes one MCAP file.

    path         must not exist, unless `overwrite`
    image        "raw" for speed, "png" for small files
    compression  of the chunks: "none", "lz4", "zstd"
    buffer_mb    size of the queue to the disk; messages beyond it are dropped
    tip          about the tip, e.g. {"serial": ..., "pins": "331"}; found in the file's metadata
    rate_hz      nominal rate of the camera; 0 where unknown
    offset_ns    log time minus capture time; None: from the wall clock at the first frame
    finger       its number, in the names of what `take` records
    written_n    messages by topic
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
        self.written_n = self._writer.written_n
        self._queue = MessageQueue(int(buffer_mb * 1e6))
        self._clock = _LogClock(offset_ns)
        self._png = image == "png"
        self._serial = about.get("serial", "")
        self._since_ns: int | None = None  # of the samples counted for the next diagnosis
        self._samples_n = self._lost_noted_n = self.refused_n = 0
        self.finger = 1
        self.fault: str | None = None
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    @property
    def dropped_n(self) -> int:
        """Messages that did not fit, or came after a fault."""
        return self._queue.dropped_n

    # -- called by the loop ------------------------------------------------------------------

    def frame(self, frame: Frame) -> bool:
        """Record image, times and truth. False: dropped."""
        log_ns = self._clock.of(frame)
        about = {name: getattr(frame, name) for name in ("sequence", "capture_ns", "clock", "bits")}
        parts: list[_Part] = [("frame", lambda: messages.to_json(about))]
        if frame.truth is not None:
            truth = {"sequence": frame.sequence, "truth": frame.truth}
            parts.append(("truth", lambda: messages.to_json(truth)))
        key = "image_png" if self._png else "image"
        parts.append((key, lambda: image_message(frame.image, log_ns, png=self._png)))
        return self._put(frame, parts, frame.image.nbytes)

    def take(self, frame: Frame, result: Result | None, state: State) -> None:
        """Record one turn of the loop: the image, its results if it has any, the sample sent to the bus."""
        self.frame(frame)
        if result is not None:
            self._result(frame, result)
        # Rounded and saturated as on the wire: a recording holds what the host received.
        self.sample(frame, self.finger, lambda: unpack_state(pack_state(state, state.sample)))
        self._diagnose(frame, state)

    def _result(self, frame: Frame, result: Result) -> None:
        """Numbers of the stages; at a viewer's rate also the pins and the shaded cells, as overlays."""
        log_ns = self._clock.of(frame)
        tracks, cells, features = result.tracks, result.cells, result.features
        parts: list[_Part] = [("pins", lambda: messages.pins_cloud(tracks, features, log_ns))]
        n_bytes = 4 * tracks.xy_img.nbytes
        due = self._clock.overlay_is_due(log_ns)
        if due:
            parts.append(("pins_overlay", lambda: messages.pins_overlay(tracks, log_ns)))
        if cells is not None and features is not None:
            parts.append(("cells", lambda: messages.cells_cloud(cells, log_ns)))
            n_bytes += 3 * cells.xy_img.nbytes
            if due:
                parts.append(("cells_overlay", lambda: messages.cells_overlay(cells, features, log_ns)))
            parts.append(("features", lambda: messages.to_json(messages.features_json(frame, features))))
        parts.append(("reading", lambda: messages.to_json(messages.reading_json(frame, result.reading))))
        self._put(frame, parts, n_bytes)

    def sample(self, frame: Frame, finger: int, state: Callable[[], State]) -> bool:
        """Record a sample, which `state` gives in the recorder's thread: its values, and a scene of it."""
        log_ns = self._clock.of(frame)

        def scene() -> bytes:
            made = contact_scene(FoxgloveMessages(), finger_name(finger), state(), log_ns)
            return bytes(made.SerializeToString())

        values = (sample_topic(finger), lambda: messages.to_json(sample_message(state())))
        return self._put(frame, [values, (contacts_topic(finger), scene)])

    def _diagnose(self, frame: Frame, state: State) -> None:
        """Record the finger's state, and where its tip is, with the first sample, and then once a second."""
        self._samples_n += 1
        passed_s = 0.0 if self._since_ns is None else (frame.capture_ns - self._since_ns) * 1e-9
        if self._since_ns is not None and 0.0 <= passed_s < DIAGNOSIS_S:
            return
        log_ns, name, problem = self._clock.of(frame), finger_name(self.finger), status_text(state.status)
        values = {"dropped": str(self.dropped_n)}
        if passed_s > 0.0:
            values["rate_hz"] = f"{self._samples_n / passed_s:.0f}"
        found = Diagnosis(name, level_of(state.status, problem), problem or "measures", self._serial, values)

        def tips() -> bytes:
            made = tip_transforms(FoxgloveMessages(), [TipPlace(name, "hand")], log_ns)
            return bytes(made.SerializeToString())

        about = ("diagnostics", lambda: messages.to_json(diagnostics_message([found], log_ns)))
        self._put(frame, [about, ("tf", tips)])
        self._since_ns, self._samples_n = frame.capture_ns, 0

    def event(self, level: str, text: str) -> None:
        """Record a line of the log. level: debug, info, warning, error, fatal."""
        log_ns = self._clock.now_ns()
        encode = partial(messages.log_message, level, text, "edge", log_ns)
        write = partial(self._write, TOPICS["events"], log_ns, log_ns, 0, encode)
        self._queue.put([write], PARAMS.item_bytes)

    def count_lost(self, messages_n: int) -> None:
        """Count messages that were lost before the recorder; a warning in the file marks the gap."""
        self._queue.count_lost(messages_n)

    def attach(self, name: str, data: bytes, media_type: str = "application/json") -> None:
        """Store a file in the recording: calibration, configuration."""
        now_ns = self._clock.now_ns()
        self._queue.put([lambda: self._writer.add_attachment(now_ns, name, data, media_type)], 0)

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        pairs = dict(values)
        self._queue.put([lambda: self._writer.add_metadata(name, pairs)], 0)

    def close(self, timeout_s: float = 10.0) -> None:
        """Write the queue and the index, and end; messages not written after `timeout_s` are dropped."""
        self._queue.close()
        self._thread.join(timeout_s)
        if self._thread.is_alive():
            self._queue.close(give_up=True)
            self._thread.join(1.0)

    def __exit__(self, *error: object) -> None:
        self.close()

    def _put(self, frame: Frame, parts: Sequence[_Part], n_bytes: int = 0) -> bool:
        """Queue messages of a frame, all or none; n_bytes: memory that they keep, beside their own."""
        times = (self._clock.of(frame), frame.capture_ns, frame.sequence & 0xFFFFFFFF)
        calls = [
            partial(self._write, TOPICS[topic] if isinstance(topic, str) else topic, *times, encode)
            for topic, encode in parts
        ]
        return self._queue.put(calls, PARAMS.item_bytes * len(calls) + n_bytes)

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
        self._queue.close(give_up=True)

    def _step(self) -> None:
        """Write some messages, or close a chunk that is old enough. Raises OSError."""
        calls, cost_bytes = self._queue.get(self._writer.chunk_due_s)
        for write in calls:
            write()
        self._queue.done(cost_bytes)
        if self._writer.chunk_due_s == 0.0:
            self._writer.end_chunk()

    def _write(
        self, topic: Topic, log_ns: int, publish_ns: int, sequence: int, encode: Callable[[], bytes]
    ) -> None:
        dropped_n = self.dropped_n
        if lost_n := dropped_n - self._lost_noted_n:
            self._lost_noted_n = dropped_n
            self._note("warning", f"{lost_n} messages dropped: the disk is too slow", log_ns)
        try:
            data = encode()
        except Exception as error:  # noqa: BLE001  (a viewer's callback must not end the recording)
            self.refused_n += 1
            why = f"{type(error).__name__}: {error}"
            self._note("error", f"{topic.name} not recorded: {why}", log_ns)
        else:
            self._writer.add(topic, log_ns, publish_ns, sequence, data)

    def _note(self, level: str, text: str, log_ns: int) -> None:
        data = messages.log_message(level, text, "recorder", log_ns)
        self._writer.add(TOPICS["events"], log_ns, log_ns, 0, data)
