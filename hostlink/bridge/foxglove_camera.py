"""A finger's camera in Foxglove: its image, and over it pins and cells.

/finger_1/camera/image    foxglove.CompressedImage     as the finger's page shows it: JPEG, 30 a second
/finger_1/pins/overlay    foxglove.ImageAnnotations    pins seen
/finger_1/cells/overlay   foxglove.ImageAnnotations    cells, shaded by the change of their area
"""

from __future__ import annotations

from typing import Any

from hostlink.bridge.page_camera import CaptureClock, PageAddress, PageCamera, Picture, Place, Rgba

__all__ = ["CameraChannels"]

_PIN_COLOUR: Rgba = (1.0, 0.8, 0.0, 1.0)
_CELL_COLOUR: Rgba = (0.35, 0.35, 0.35, 0.8)  # of its outline
_PIN_PX, _OUTLINE_PX = 3.0, 1.0


class CameraChannels:
    """The topics of a finger's camera.

    name                of the finger
    channels, messages  modules of the SDK
    Raises              UsageError: the extra is not installed
    """

    def __init__(self, name: str, address: PageAddress, context: Any, channels: Any, messages: Any) -> None:
        self.finger = address.finger
        self._messages = messages
        self._image = channels.CompressedImageChannel(f"/{name}/camera/image", context=context)
        self._pins = channels.ImageAnnotationsChannel(f"/{name}/pins/overlay", context=context)
        self._cells = channels.ImageAnnotationsChannel(f"/{name}/cells/overlay", context=context)
        self._frame = f"{name}/camera"
        self.clock = CaptureClock()
        self._page = PageCamera(address, self._publish)
        self.update()

    def update(self) -> None:
        """Watch the page while somebody watches these topics, or records them."""
        watched = any(channel.has_sinks() for channel in (self._image, self._pins, self._cells))
        wants = {"image"} if watched else set()
        self._page.want(frozenset(wants | ({"cells"} if self._cells.has_sinks() else set())))

    def close(self) -> None:
        """End the connection to the page."""
        self._page.close()

    def _publish(self, picture: Picture) -> None:
        """Called in the thread of the page's connection."""
        m, at_ns = self._messages, self.clock.at_ns(picture.capture_us)
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
