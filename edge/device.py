"""The running app as its bus nodes see it: identity, tare, calibration, features, reboot.

Called from the links' threads. Nothing here waits for the loop: what changes the pipeline is posted to it
and done between two frames; what can be refused is refused at once.
"""

from __future__ import annotations

import logging
import re
import time
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path

from edge.app import App
from edge.calibration import Calibration
from edge.errors import CalibrationError
from edge.node import Refused
from edge.types import Clock, Feature
from hostlink.wire import FaultCode

__all__ = ["AppDevice", "clear_leftovers", "stored_calibration"]

log = logging.getLogger(__name__)

#: What `edge.calibration.write_atomically` calls a file until it is whole.
_UNFINISHED = re.compile(r"\.calibration\.json\.[a-z0-9_]{8}")


def stored_calibration(state_dir: Path | None) -> Path | None:
    """The calibration that a host has uploaded, where there is one."""
    if state_dir is None:
        return None
    path = state_dir / "calibration.json"
    return path if path.is_file() else None


def clear_leftovers(state_dir: Path) -> None:
    """Remove what uploads left that were cut off by a loss of power; at the start, before another one."""
    for path in state_dir.iterdir():
        if _UNFINISHED.fullmatch(path.name) and path.is_file() and not path.is_symlink():
            try:
                path.unlink()
            except OSError as error:  # it takes room, and does no other harm
                log.warning("%s: %s", path, error.strerror)


class AppDevice:
    """`edge.node.Device` on an `App`.

    serial_number  of the fingertip
    state_dir      where an uploaded calibration is kept; None: it is lost at the end
    """

    def __init__(self, app: App, serial_number: str, state_dir: Path | None = None) -> None:
        self._app = app
        self._serial_number = serial_number
        self._state_dir = state_dir
        self._started_s = time.monotonic()
        self._extra = app.demand - set(_NAMED)  # what no node can switch, such as the surface for a viewer
        self.reboot_wanted = False

    def describe(self) -> Mapping[str, int | float | str | bytes]:
        """Read-only objects by name."""
        statistics, calibration = self._app.statistics(), self._app.calibration
        return {
            "serial_number": self._serial_number,
            "software_version": version("voronoi-touch"),
            "calibration_id": f"{calibration.content_id:08x}" if calibration else "",
            "pin_n": statistics.pins_n,
            "camera": self._app.source.name,
            "camera_rate_hz": statistics.rate_hz,
            "uptime_s": int(time.monotonic() - self._started_s),
            "samples_n": statistics.frames_n,
            "dropped_n": statistics.dropped_n + statistics.lost_by_camera_n,
            "latency_p50_us": round(statistics.latency_us[0]),
            "latency_p99_us": round(statistics.latency_us[1]),
        }

    def clock_us(self) -> int | None:
        """The clock that stamps the images, now; None where it is the camera's or a recording's own."""
        last = self._app.last
        if last is None or last.frame.clock not in (Clock.HOST, Clock.DRIVER):
            return None
        return time.monotonic_ns() // 1000

    def tare(self, force: bool) -> None:
        """Take a new rest frame from the next images. Raises Refused: something touches the tip."""
        if self._app.touched and not force:
            raise Refused("something touches the tip; let go, or force the tare")
        self._app.post(self._app.begin_tare)

    def calibration_bytes(self) -> bytes:
        """The calibration file in use; empty: none."""
        calibration = self._app.calibration
        return calibration.encoded if calibration else b""

    def upload_calibration(self, data: bytes) -> None:
        """Check, store and use another calibration; the rest frame is taken anew with it.

        Raises  CalibrationError: not usable; OSError: cannot be stored. Either way nothing has changed.
        """
        calibration = Calibration.parse(data, "upload")
        pipeline, made_at = self._app.pipeline, calibration.rest.pattern.size_px
        if pipeline is not None and made_at != (size := pipeline.rest.pattern.size_px):
            raise CalibrationError(
                f"upload: made at {made_at[0]}x{made_at[1]}, the camera gives {size[0]}x{size[1]}; "
                "give one of this tip and camera"
            )
        if self._state_dir is not None:
            calibration.save(self._state_dir / "calibration.json")
        self._app.post(lambda: self._app.set_calibration(calibration))

    def set_features(self, names: frozenset[str]) -> None:
        """Compute these features from the next frame on."""
        demand = frozenset(Feature(name) for name in names) | self._extra
        self._app.post(lambda: self._app.set_demand(demand))

    def reboot(self) -> None:
        """End the loop; the program that runs it starts anew."""
        self.reboot_wanted = True
        self._app.post(self._app.stop)

    def report(self, code: FaultCode, active: bool, words: str = "") -> None:
        """A link's fault appeared or went."""
        self._app.health.report(code, active, words)


_NAMED = frozenset(Feature) - {Feature.SURFACE}
