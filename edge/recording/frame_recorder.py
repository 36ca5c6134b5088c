"""What is recorded in each turn of the loop: the image, its results, the sample sent to the bus."""

from edge.cells import cell_polygons
from edge.recording.writer import Recorder
from edge.types import Frame, Result
from edge.view.palette import cell_rgba
from hostlink.topics import DIAGNOSIS_S, Diagnosis, finger_name, level_of, status_text
from hostlink.wire import State, pack_state, unpack_state


class FrameRecorder:
    """A recorder in the loop's own process; implements `session.Recording`.

    finger, serial  the finger's number and serial number
    """

    def __init__(self, recorder: Recorder, finger: int = 1, serial: str = "") -> None:
        self.recorder = recorder
        self._finger, self._serial = finger, serial
        self._since_ns: int | None = None  # of the samples counted for the next diagnosis
        self._samples_n = 0

    @property
    def fault(self) -> str | None:
        return self.recorder.fault

    @property
    def dropped_n(self) -> int:
        return self.recorder.dropped_n

    def take(self, frame: Frame, result: Result | None, state: State) -> None:
        """Record a frame, with or without a result. Queues references; the recorder's thread encodes them."""
        recorder = self.recorder
        recorder.frame(frame)
        if result is not None:
            cells, features = result.cells, result.features
            recorder.pins(frame, result.tracks, features)
            if cells is not None and features is not None:
                recorder.cells(
                    frame, cells, lambda: cell_polygons(cells), lambda: cell_rgba(features.area_change)
                )
                recorder.features(frame, features)
            recorder.reading(frame, result.reading)
        # Rounded and saturated as on the wire: a recording holds what the host received.
        recorder.sample(frame, self._finger, lambda: unpack_state(pack_state(state, state.sample)))
        self._diagnose(frame, state)

    def _diagnose(self, frame: Frame, state: State) -> None:
        """Record a diagnosis with the first sample, and then once a second."""
        self._samples_n += 1
        passed_s = 0.0 if self._since_ns is None else (frame.capture_ns - self._since_ns) * 1e-9
        if self._since_ns is not None and 0.0 <= passed_s < DIAGNOSIS_S:
            return
        problem = status_text(state.status)
        values = {"dropped": str(self.recorder.dropped_n)}
        if passed_s > 0.0:
            values["rate_hz"] = f"{self._samples_n / passed_s:.0f}"
        self.recorder.diagnosis(
            frame,
            Diagnosis(
                finger_name(self._finger),
                level_of(state.status, problem),
                problem or "measures",
                self._serial,
                values,
            ),
        )
        self._since_ns, self._samples_n = frame.capture_ns, 0

    def event(self, level: str, text: str) -> None:
        self.recorder.event(level, text)
