"""Fingers in Foxglove, Lichtblick and PlotJuggler: a websocket server, and the same topics in an MCAP file.

    /finger_1/sample ..        samples, contacts, tips, diagnoses: `hostlink.topics`
    /finger_1/camera/image ..  its camera, pins and cells, where its page is given: `foxglove_camera.py`
    /finger_1/tare             service, std_srvs/Trigger, JSON
    finger_1.rate_hz ..        parameters: what can be set, by the names of WIRE.md

Rules
- The protocol has no passwords: everybody who can reach the server may watch, also any page in a browser.
- Viewers may tare and set only where the user allows it, on a loopback address; pages in a browser only if
  the user named them (`front_door.py`).
- A message is made only while somebody watches its topic, or a file is written.
"""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Collection, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

from hostlink.bridge.foxglove_camera import CameraChannels
from hostlink.bridge.front_door import FrontDoor, hidden_address
from hostlink.bridge.page_camera import PageAddress
from hostlink.bridge.values import ParameterDesk, TareDesk, stamp_ns
from hostlink.errors import UsageError
from hostlink.events import DetailFrame, Sample
from hostlink.extras import require
from hostlink.finger import Finger
from hostlink.hand_file import HandFile
from hostlink.topics import (
    DIAGNOSTICS,
    SAMPLE,
    Diagnosis,
    contact_scene,
    diagnostics_message,
    sample_message,
    tip_transforms,
)
from hostlink.web import Listen
from hostlink.web.limits import SparseLog, WebLimits

__all__ = ["LAYOUT", "FoxgloveOutlet"]

log = logging.getLogger(__name__)

EXTRA = "foxglove"
LAYOUT = Path(__file__).with_name("foxglove_layout.json")  # a view of five fingers to import

_TEXT = {"type": "string"}
_TRIGGER = {"type": "object", "properties": {}}
_TRIGGERED = {"type": "object", "properties": {"success": {"type": "boolean"}, "message": _TEXT}}


class FoxgloveOutlet:
    """A server for viewers, and a recording where `record` names a file (which must not exist).

    listen   address
    pages    live pages of fingers, for their cameras
    hand     names of the fingers that have a page
    control  origins of the pages that may tare and set, as this machine's programs then may; None: nobody
    Raises   UsageError: extra not installed, the address is taken, or others could reach it with `control`
    """

    def __init__(
        self,
        listen: Listen,
        record: Path | None = None,
        pages: Sequence[PageAddress] = (),
        control: Collection[str] | None = None,
        hand: HandFile | None = None,
    ) -> None:
        hand = hand or HandFile()
        self._sdk = require("foxglove", EXTRA)
        self._channels = require("foxglove.channels", EXTRA)
        self._messages = require("foxglove.messages", EXTRA)
        websocket = require("foxglove.websocket", EXTRA)
        require("aiohttp", EXTRA)
        self._context = self._sdk.Context()
        self._fingers: dict[str, Finger] = {}
        self._samples: dict[int, Any] = {}
        self._scenes: dict[int, Any] = {}
        self._frames: dict[int, str] = {}
        self._cameras: list[CameraChannels] = []
        self._desks: list[TareDesk] = []
        _quiet_sdk()
        inner = hidden_address()
        self._control = control is not None
        if self._control and not (listen.loopback and inner != "127.0.0.1"):
            raise UsageError(
                f"--allow-control: {listen} is no place for it; give --listen 127.0.0.1, on Linux"
            )
        listener = _Parameters(self._sdk, ParameterDesk(self._fingers)) if self._control else _Listener()
        listener.cameras = self._cameras
        capabilities = [websocket.Capability.Parameters, websocket.Capability.Services]
        self._behind = self._sdk.start_server(
            name="voronoi-touch",
            host=inner,
            port=0,
            capabilities=capabilities if self._control else [],
            server_listener=listener,
            supported_encodings=["json"],
            context=self._context,
        )
        try:
            self.server = FrontDoor(listen, (inner, self._behind.port), control)
        except OSError as error:
            self._behind.stop()
            why = error.strerror or error
            raise UsageError(f"--listen {listen}: {why}; give another address or port") from None
        self._file = None if record is None else self._sdk.open_mcap(record, context=self._context)
        self._tf = self._channels.FrameTransformsChannel("/tf", context=self._context)
        self._diagnostics = self._json_channel("/diagnostics", DIAGNOSTICS)
        for page in pages:
            name = hand.mount(page.finger).name
            self._cameras.append(CameraChannels(name, page, self._context, self._channels, self._messages))

    @property
    def url(self) -> str:
        """The server that viewers connect to."""
        return f"ws://127.0.0.1:{self.server.port}"

    def _json_channel(self, topic: str, schema: dict[str, Any]) -> Any:
        return self._sdk.Channel(topic, schema=schema, context=self._context)

    def add_finger(self, finger: Finger) -> None:
        """Its topics, and its service."""
        name = finger.name
        self._fingers[name] = finger
        self._frames[finger.node] = finger.mount.frame()
        self._samples[finger.node] = self._json_channel(f"/{name}/sample", SAMPLE)
        self._scenes[finger.node] = self._channels.SceneUpdateChannel(
            f"/{name}/contacts", context=self._context
        )
        if self._control:
            self._desks.append(TareDesk(finger))
            self._behind.add_services([_tare_service(self._sdk, name, self._desks[-1])])

    def publish(self, sample: Sample | DetailFrame) -> None:
        """Publish it with the capture time of the image. Pins are shown over the camera's image instead."""
        if isinstance(sample, DetailFrame):
            return
        at_ns = stamp_ns(sample)
        for camera in self._cameras:
            if camera.finger == sample.finger:
                camera.clock.note(sample.state.capture_time_us, at_ns)
        channel, scene = self._samples[sample.finger], self._scenes[sample.finger]
        if channel.has_sinks():
            error_s = sample.host_error_s if isfinite(sample.host_error_s) else None
            known = {"host_error_s": error_s, "lost_n": sample.lost_n}
            channel.log(sample_message(sample.state) | known, log_time=at_ns)
        if scene.has_sinks():
            scene.log(
                contact_scene(self._messages, self._frames[sample.finger], sample.state, at_ns),
                log_time=at_ns,
            )

    def report(self, diagnoses: Sequence[Diagnosis]) -> None:
        """Publish diagnoses, and the places of the tips."""
        now_ns = time.time_ns()
        self._diagnostics.log(diagnostics_message(diagnoses, now_ns), log_time=now_ns)
        tips = [finger.mount.tip_place() for finger in self._fingers.values()]
        transforms = tip_transforms(self._messages, tips, now_ns)
        self._tf.log(transforms, log_time=now_ns)

    def close(self) -> None:
        """End the server, and complete the file."""
        self.server.close()
        for desk in self._desks:
            desk.close()
        self._behind.stop()
        cameras, self._cameras[:] = list(self._cameras), []
        for camera in cameras:
            camera.close()
        if self._file is not None:
            self._file.close()


def _tare_service(sdk: Any, name: str, desk: TareDesk) -> Any:
    def answer(_: Any) -> bytes:
        success, message = desk.ask().result()
        return json.dumps({"success": success, "message": message}).encode()

    def schema(title: str, content: dict[str, Any]) -> Any:
        form = sdk.Schema(name=title, encoding="jsonschema", data=json.dumps(content).encode())
        return sdk.MessageSchema(encoding="json", schema=form)

    kind = sdk.ServiceSchema(
        "std_srvs/Trigger",
        request=schema("std_srvs/Trigger_Request", _TRIGGER),
        response=schema("std_srvs/Trigger_Response", _TRIGGERED),
    )
    return sdk.Service(f"/{name}/tare", schema=kind, handler=answer)


class _SparseHandler(logging.Handler):
    """The SDK logs a line for each message of a viewer that it does not understand; one in ten seconds is
    logged here.
    """

    def __init__(self) -> None:
        super().__init__()
        self._logs: dict[str, SparseLog] = {}

    def emit(self, record: logging.LogRecord) -> None:
        sparse = self._logs.setdefault(record.name, SparseLog(log, WebLimits().log_s))
        sparse.write(f"{record.name}: {record.getMessage()[:200]!a}", level=record.levelno)


def _quiet_sdk() -> None:
    """Limit the lines of the SDK's own log."""
    sdk = logging.getLogger("foxglove")
    sdk.propagate = False
    sdk.handlers[:] = [_SparseHandler()]


class _Listener:
    """The server calls this from its threads: cameras are read only while somebody watches."""

    def __init__(self) -> None:
        self.cameras: Sequence[CameraChannels] = ()

    def on_subscribe(self, _client: Any, _channel: Any) -> None:
        for camera in self.cameras:
            camera.update()

    on_unsubscribe = on_subscribe  # also called when a viewer leaves


class _Parameters(_Listener):
    """The values that viewers read and set. Called from the server's threads."""

    def __init__(self, sdk: Any, desk: ParameterDesk) -> None:
        super().__init__()
        self._sdk, self._desk = sdk, desk
        self._failures = SparseLog(log, WebLimits().log_s)

    def on_get_parameters(self, _client: Any, names: Sequence[str], _request_id: Any = None) -> list[Any]:
        values = self._desk.read(names or self._desk.names())
        return [self._sdk.Parameter(name, value=value) for name, value in values.items()]

    def on_set_parameters(
        self, _client: Any, parameters: Sequence[Any], _request_id: Any = None
    ) -> list[Any]:
        """The values afterwards; a refused one is unchanged."""
        wanted = {parameter.name: parameter.get_value() for parameter in parameters}
        for name, value in wanted.items():
            if refused := self._desk.write(name, value):
                self._failures.write(refused)
        return self.on_get_parameters(None, [*wanted]) if wanted else []
