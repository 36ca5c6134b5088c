"""A finger's camera in Foxglove: its image, and over it pins and cells.

/finger_1/camera/image    foxglove.CompressedImage     as the finger's page shows it: JPEG, 30 a second
/finger_1/pins/overlay    foxglove.ImageAnnotations    pins seen
/finger_1/cells/overlay   foxglove.ImageAnnotations    cells, shaded by the change of their area
"""

from __future__ import annotations

import time
from typing import Any

from hostlink.bridge.page_camera import PageAddress, PageCamera, Picture, Place, Rgba
from hostlink.topics import finger_name

__all__ = ["CameraChannels"]

_PIN_COLOUR: Rgba = (1.0, 0.8, 0.0, 1.0)
_CELL_COLOUR: Rgba = (0.35, 0.35, 0.35, 0.8)  # of its outline
_PIN_PX, _OUTLINE_PX = 3.0, 1.0
_WRAP_US = 1 << 32  # of a sample's capture time


class CameraChannels:
    """The topics of a finger's camera.

    channels, messages  modules of the SDK
    Raises              UsageError: the extra is not installed
    """

    def __init__(self, address: PageAddress, context: Any, channels: Any, messages: Any) -> None:
        self.finger = address.finger
        self._messages = messages
        name = finger_name(address.finger)
        self._image = channels.CompressedImageChannel(f"/{name}/camera/image", context=context)
        self._pins = channels.ImageAnnotationsChannel(f"/{name}/pins/overlay", context=context)
        self._cells = channels.ImageAnnotationsChannel(f"/{name}/cells/overlay", context=context)
        self._frame = f"{name}/camera"
        self._stamped: tuple[int, int] | None = None
        self._page = PageCamera(address, self._publish)
        self.update()

    def update(self) -> None:
        """Watch the page while somebody watches these topics, or records them."""
        watched = any(channel.has_sinks() for channel in (self._image, self._pins, self._cells))
        wants = {"image"} if watched else set()
        self._page.want(frozenset(wants | ({"cells"} if self._cells.has_sinks() else set())))

    def note(self, capture_us: int, at_ns: int) -> None:
        """A sample's capture time on the finger's clock and on the host's: pictures are stamped by it."""
        self._stamped = capture_us, at_ns

    def close(self) -> None:
        """End the connection to the page."""
        self._page.close()

    def _stamp_ns(self, capture_us: int) -> int:
        """On the host's clock; the present if no sample has come yet."""
        if self._stamped is None:
            return time.time_ns()
        sample_us, at_ns = self._stamped
        later_us = (capture_us - sample_us + _WRAP_US // 2) % _WRAP_US - _WRAP_US // 2
        return at_ns + later_us * 1000

    def _publish(self, picture: Picture) -> None:
        """In the thread of the page's connection."""
        m, at_ns = self._messages, self._stamp_ns(picture.capture_us)
        stamp = m.Timestamp(*divmod(at_ns, 1_000_000_000))
        if self._image.has_sinks():
            image = m.CompressedImage(timestamp=stamp, frame_id=self._frame, data=picture.jpeg, format="jpeg")
            self._image.log(image, log_time=at_ns)
        if self._pins.has_sinks():
            pins = self._points(stamp, m.PointsAnnotationType.Points, picture.pins(), _PIN_COLOUR, _PIN_PX)
            self._pins.log(m.ImageAnnotations(timestamp=stamp, points=[pins]), log_time=at_ns)
        if self._cells.has_sinks():
            outline = m.PointsAnnotationType.LineLoop
            cells = [
                self._points(stamp, outline, corners, _CELL_COLOUR, _OUTLINE_PX, fill)
                for corners, fill in picture.cells()
            ]
            self._cells.log(m.ImageAnnotations(timestamp=stamp, points=cells), log_time=at_ns)

    def _points(
        self, stamp: Any, kind: Any, places: list[Place], colour: Rgba, px: float, fill: Rgba | None = None
    ) -> Any:
        m = self._messages
        return m.PointsAnnotation(
            timestamp=stamp,
            type=kind,
            points=[m.Point2(x=x, y=y) for x, y in places],
            outline_color=_colour(m, colour),
            fill_color=None if fill is None else _colour(m, fill),
            thickness=px,
        )


def _colour(m: Any, rgba: Rgba) -> Any:
    return m.Color(r=rgba[0], g=rgba[1], b=rgba[2], a=rgba[3])
