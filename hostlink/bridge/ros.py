"""Fingers in ROS 2, without a ROS installation: topics over the Zenoh middleware (`rmw_zenoh_cpp`).

    /finger_1/wrench            geometry_msgs/WrenchStamped         force and torque on the tip
    /finger_1/contacts          sensor_msgs/PointCloud2             x, y, z, depth, in metres
    /finger_1/markers           visualization_msgs/MarkerArray      contacts, shear, depth
    /finger_1/pins              sensor_msgs/PointCloud2             every pin, with object detail_divider
    /finger_1/image/compressed  sensor_msgs/CompressedImage         its camera, where its page is given
    /finger_1/sample            voronoi_touch_msgs/TactileSample    everything, with standard deviations
    /finger_1/tare              service, std_srvs/Trigger
    /robot_description          std_msgs/String                     the hand as URDF, if it stands alone
    /tf_static                  tf2_msgs/TFMessage                  where the tips are mounted
    /diagnostics                diagnostic_msgs/DiagnosticArray
    finger_1.rate_hz ..         parameters of the node

A namespace goes before the names of frames, and before all others but `/tf_static` and `/diagnostics`, which
have one place in ROS. Fingers have the names of the hand's file. What nobody subscribes to is not made.
"""

from __future__ import annotations

import json
import logging
import threading
import time
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import replace
from typing import Any, Final

from hostlink.bridge.page_camera import CaptureClock, PageAddress, PageCamera, Picture
from hostlink.bridge.robot_model import stands_alone, urdf
from hostlink.bridge.ros_messages import KINDS, RosMessages
from hostlink.bridge.ros_node import RosNode, RosTopic
from hostlink.bridge.ros_parameters import RosParameters
from hostlink.bridge.ros_types import TRIGGER, Types
from hostlink.bridge.values import ParameterDesk, TareDesk, stamp_ns
from hostlink.errors import LinkError
from hostlink.events import DetailFrame, Sample
from hostlink.finger import Finger
from hostlink.hand_file import HandFile, frame_in
from hostlink.topics import Diagnosis
from hostlink.window import SampleTimes

__all__ = ["RosOutlet"]

log = logging.getLogger(__name__)

_OF_SAMPLES: Final = ("wrench", "contacts", "markers", "sample")
_PLACES_S: Final = 10.0  # until a finger is asked again where its pins are

Place = tuple[float, float, float]


class RosOutlet:
    """A ROS 2 node that publishes what comes.

    distribution  one of DISTRIBUTIONS
    router        Zenoh endpoint, e.g. tcp/127.0.0.1:7447; waits until it is there
    domain        ROS_DOMAIN_ID
    namespace     before all names, e.g. /left_hand; "": none
    wait_s        longest wait for the router; None: for ever
    hand          fingers that are known before they are heard
    pages         live pages of fingers, for their cameras
    Raises        UsageError: extra not installed, or an argument makes no sense; LinkTimeout: no router
    """

    def __init__(
        self,
        distribution: str,
        router: str,
        domain: int = 0,
        namespace: str = "",
        wait_s: float | None = None,
        hand: HandFile | None = None,
        pages: Sequence[PageAddress] = (),
    ) -> None:
        self._types = Types(distribution)
        self._messages = RosMessages(self._types)
        self.node = node = RosNode(self._types, router, domain, namespace, wait_s)
        self._fingers: dict[int, _RosFinger] = {}
        self._named: dict[str, Finger] = {}
        hand = hand or HandFile()
        self._mounts = {mount.node: mount for mount in hand.mounts}
        self._diagnostics = node.publisher(KINDS["diagnostics"], "/diagnostics")
        self._tf = node.publish_latched(KINDS["tf_static"], "/tf_static")
        self._description = node.publish_latched(KINDS["robot_description"], f"{namespace}/robot_description")
        RosParameters(node, self._types, ParameterDesk(self._named))
        self._cameras = {page.finger: _RosCamera(self, hand.mount(page.finger).name, page) for page in pages}
        self._show_hand()

    def topic(self, finger: str, kind: str) -> RosTopic:
        """A finger's, declared."""
        return self.node.publisher(KINDS[kind], f"{self.node.namespace}/{finger}/{kind}")

    def put(self, topic: RosTopic, kind: str, *what: Any) -> None:
        """Make a message of this, if somebody wants it, and send it."""
        if topic.wanted:
            make = getattr(self._messages, kind.partition("/")[0])
            topic.put(self._types.pack(make(*what)))

    def _show_hand(self) -> None:
        mounts, namespace = [*self._mounts.values()], self.node.namespace
        if not mounts:
            return
        places = [mount.tip_place(namespace) for mount in mounts]
        self._tf.put(self._types.pack(self._messages.transforms(places)))
        if stands_alone(mounts):
            self._description.put(self._types.pack(self._messages.text(urdf(mounts, namespace))))

    def add_finger(self, finger: Finger) -> None:
        """Its topics, and its service."""
        self._fingers[finger.node] = _RosFinger(self, finger)
        self._named[finger.name] = finger
        if finger.node not in self._mounts:
            self._mounts[finger.node] = finger.mount
            self._show_hand()

    def publish(self, sample: Sample | DetailFrame) -> None:
        """Stamped with when the image was taken."""
        finger = self._fingers[sample.node]
        if isinstance(sample, DetailFrame):
            finger.publish_pins(sample)
            return
        at_ns = finger.publish(sample)
        if sample.node in self._cameras:
            self._cameras[sample.node].clock.note(sample.state.capture_time_us, at_ns)

    def report(self, diagnoses: Sequence[Diagnosis]) -> None:
        """All fingers' diagnoses, on the topic that those of all hands have."""
        hand = [replace(d, name=frame_in(self.node.namespace, d.name)) for d in diagnoses]
        self._diagnostics.put(self._types.pack(self._messages.diagnostics(hand)))

    def close(self) -> None:
        """Take the node from the graph."""
        for finger in self._fingers.values():
            finger.close()
        for camera in self._cameras.values():
            camera.close()
        self.node.close()

    def trigger(self, desk: TareDesk) -> Future[bytes]:
        """Ask for a rest frame; the response of the service."""
        answer: Future[bytes] = Future()

        def done(outcome: Future[tuple[bool, str]]) -> None:
            if outcome.cancelled():
                answer.cancel()
                return
            success, message = outcome.result()
            answer.set_result(self._types.pack_response(TRIGGER, success=success, message=message))

        desk.ask().add_done_callback(done)
        return answer


class _RosFinger:
    """One finger's topics."""

    def __init__(self, outlet: RosOutlet, finger: Finger) -> None:
        self._outlet, self._finger = outlet, finger
        namespace = outlet.node.namespace
        self._frame = finger.mount.frame(namespace)
        self._topics = {kind: outlet.topic(finger.name, kind) for kind in (*_OF_SAMPLES, "pins")}
        self._desk = TareDesk(finger)
        outlet.node.serve(TRIGGER, f"{namespace}/{finger.name}/tare", lambda _: outlet.trigger(self._desk))
        self._times = SampleTimes[int]()
        self._places: list[Place] = []
        self._asked_s = -_PLACES_S

    def publish(self, sample: Sample) -> int:
        """The stamp that it got."""
        at_ns = stamp_ns(sample)
        self._times.note(sample.state.sample, at_ns)
        for kind in _OF_SAMPLES:
            self._outlet.put(self._topics[kind], kind, at_ns, self._frame, sample)
        return at_ns

    def publish_pins(self, frame: DetailFrame) -> None:
        """The calibration says where pins are at rest; until it was read there are none."""
        topic, detail = self._topics["pins"], frame.detail
        at_ns = self._times.of(detail.sample)
        if not topic.wanted or at_ns is None:
            return
        if len(self._places) != len(detail.rows):
            if time.monotonic() - self._asked_s >= _PLACES_S:
                self._asked_s = time.monotonic()
                threading.Thread(target=self._read_places, daemon=True).start()
            return
        self._outlet.put(topic, "pins", at_ns, self._frame, detail, self._places)

    def _read_places(self) -> None:
        """A calibration takes seconds to come up the bus: in a thread of its own."""
        try:
            self._places = _places_in(self._finger.calibration())
        except (LinkError, ValueError, LookupError, TypeError) as error:
            log.warning("%s: the places of its pins are not known: %s", self._finger.name, error)

    def close(self) -> None:
        self._desk.close()


def _places_in(calibration: bytes) -> list[Place]:
    """x, y of each pin at rest in the tip's frame, m, and m in a pixel.

    Raises  ValueError, LookupError, TypeError: no calibration, or one without a scale
    """
    if not calibration:
        raise ValueError("it has no calibration")
    content = json.loads(calibration)
    sensor, px_m = content["sensor"], float(content["mm_per_px"]) * 1e-3
    x0, y0 = sensor["centre_px"]
    return [((x - x0) * px_m, (y - y0) * px_m, px_m) for x, y in sensor["rest_xy_px"]]


class _RosCamera:
    """A finger's camera: its page is read while somebody subscribes to the image."""

    def __init__(self, outlet: RosOutlet, name: str, page: PageAddress) -> None:
        self._outlet, self.clock = outlet, CaptureClock()
        self._frame = frame_in(outlet.node.namespace, name)
        self._topic = outlet.topic(name, "image/compressed")
        self._page = PageCamera(page, self._show)
        self._topic.on_wanted(self._update)
        self._update()

    def _update(self) -> None:
        self._page.want(frozenset({"image"} if self._topic.wanted else ()))

    def _show(self, picture: Picture) -> None:
        at_ns = self.clock.at_ns(picture.capture_us)
        self._outlet.put(self._topic, "image/compressed", at_ns, self._frame, picture.jpeg)

    def close(self) -> None:
        self._page.close()
