"""The running program as its bus nodes see it: identity, tare, calibration, features, reboot.

Called from the links' threads. Nothing here waits for the loop: what changes the pipeline is posted to it.
"""

import time
from collections.abc import Mapping
from functools import cache

from edge.calibration import Calibration
from edge.errors import CalibrationError
from edge.runtime.calibration_store import CalibrationStore
from edge.runtime.loop import Loop
from edge.types import Clock, Feature
from hostlink.wire import FaultCode


class LoopDevice:
    """`edge.link.object_server.Device`, which says what each method does, on a `Loop`; store: of uploads."""

    def __init__(self, loop: Loop, serial_number: str, store: CalibrationStore | None = None) -> None:
        self._loop, self._serial_number, self._store = loop, serial_number, store
        self._started_s = time.monotonic()
        self._extra = loop.measurement.demand & {Feature.SURFACE}  # No node can switch it.

    def describe(self) -> Mapping[str, int | float | str | bytes]:
        statistics, calibration = self._loop.statistics(), self._loop.measurement.calibration
        return {
            "serial_number": self._serial_number,
            "software_version": _version(),
            "calibration_id": f"{calibration.content_id:08x}" if calibration else "",
            "pin_n": statistics.pins_n,
            "camera": self._loop.source.name,
            "camera_rate_hz": statistics.rate_hz,
            "uptime_s": int(time.monotonic() - self._started_s),
            "samples_n": statistics.frames_n,
            "dropped_n": statistics.dropped_n + statistics.lost_by_camera_n,
            "latency_p50_us": round(statistics.latency_us[0]),
            "latency_p99_us": round(statistics.latency_us[1]),
        }

    def clock_us(self) -> int | None:
        """The clock that stamps the images, now; None if that is the camera's or a recording's own."""
        last = self._loop.measurement.last
        if last is None or last.frame.clock not in (Clock.HOST, Clock.DRIVER):
            return None
        return time.monotonic_ns() // 1000

    def tare(self, force: bool) -> None:
        self._loop.measurement.ask_tare(force)

    def rest_frame(self) -> Mapping[str, int | float | str | bytes]:
        outcome = self._loop.measurement.tare.outcome
        return {
            "rest_frame_request_n": outcome.number,
            "rest_frame_state": outcome.state,
            "rest_frame_reason": outcome.reason,
            "rest_frame_message": outcome.message,
        }

    def calibration_bytes(self) -> bytes:
        calibration = self._loop.measurement.calibration
        return calibration.encoded if calibration else b""

    def upload_calibration(self, data: bytes) -> None:
        calibration = Calibration.parse(data, "upload")
        frame, made_at = self._loop.frame, calibration.rest.pattern.size_px
        if frame is not None and made_at != (size := frame.image.shape[1::-1]):
            raise CalibrationError(
                f"upload: made at {made_at[0]}x{made_at[1]}, the camera gives {size[0]}x{size[1]}; "
                "give one of this tip and camera"
            )
        store = self._store
        self._loop.measurement.tare.ask(
            calibration=calibration, store=None if store is None else lambda: store.replace(calibration)
        )

    def set_features(self, names: frozenset[str]) -> None:
        demand = frozenset(Feature(name) for name in names) | self._extra
        self._loop.post(lambda: self._loop.measurement.set_demand(demand))

    def reboot(self) -> None:
        self._loop.post(self._loop.stop)

    def report(self, code: FaultCode, active: bool, message: str = "") -> None:
        self._loop.faults.report(code, active, message)


@cache
def _version() -> str:
    from importlib.metadata import version  # reads mail headers: 10 ms that the start need not wait for

    return version("voronoi-touch")
