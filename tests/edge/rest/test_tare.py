"""A rest frame is taken only of an untouched tip, and each request gets its outcome."""

import contextlib
import json
import threading
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from calib.sim import Camera, Simulator, Tip, ToolPose
from edge.calibration import Calibration
from edge.errors import CalibrationError, RequestRefused
from edge.frame import Pipeline
from edge.pins import take_rest
from edge.rest.tare import RestFrame, TareRefused, take_rest_frame
from edge.runtime import measurement
from edge.runtime.calibration_store import CalibrationStore
from edge.runtime.device import LoopDevice
from edge.sources import open_source
from edge.sources.paced import Paced
from edge.types import Frame, Image, Result
from hostlink.wire import FaultCode, RestFrameReason, RestFrameState, State, Status
from tests.support.finger import Finger
from tests.support.waiting import SOON_S

ACCEPTED, REFUSED, FORCED = RestFrameState.ACCEPTED, RestFrameState.REFUSED, RestFrameState.FORCED


def changed(calibration: Calibration, **sensor: object) -> Calibration:
    """The same calibration with other values in its table [sensor]."""
    table = json.loads(calibration.encoded)
    table["sensor"].update(sensor)
    return Calibration.parse(json.dumps(table).encode(), "test")


def images(frames: list[Frame], k: int) -> list[Image]:
    """Eight images that all show frame k, with a sensor's noise."""
    random = np.random.default_rng(k)
    noisy = [frames[k].image + random.normal(0.0, 2.0, frames[k].image.shape) for _ in range(8)]
    return [np.clip(np.rint(image), 0, 255).astype(np.uint8) for image in noisy]


@pytest.mark.parametrize(("k", "untouched"), [(10, 3), (25, 7)])
def test_an_untouched_tip_is_a_rest_frame_and_a_steady_touch_is_none(
    frames: list[Frame], calibration: Calibration, k: int, untouched: int
) -> None:
    knowns: tuple[dict[str, Any], ...] = (
        {"calibration": calibration}, {"reference": take_rest(images(frames, 0))},
    )  # fmt: skip
    for known in knowns:
        assert take_rest_frame(images(frames, untouched), **known).reason is RestFrameReason.NONE
        with pytest.raises(TareRefused, match="something touches the tip") as refused:
            take_rest_frame(images(frames, k), **known)
        assert refused.value.reason is RestFrameReason.TOUCHED
        forced = take_rest_frame(images(frames, k), force=True, **known)
        assert forced.reason is RestFrameReason.TOUCHED
        assert "touches" in forced.message


def test_pins_unlike_the_calibrations_are_found_too(frames: list[Frame], calibration: Calibration) -> None:
    inverted = [255 - image for image in images(frames, 3)]
    with pytest.raises(TareRefused) as refused:
        take_rest_frame(inverted, calibration=changed(calibration, size_px=[640, 480]))
    assert refused.value.reason is RestFrameReason.OTHER_TIP  # and not: no pins
    assert take_rest_frame(inverted, calibration=calibration).rest.pattern.dark


@pytest.mark.parametrize(
    ("turn_deg", "zoom", "tilt"), [(1.0, 1.0, 0.0), (0.0, 1.02, 0.0), (0.5, 0.99, 4e-5), (0.0, 1.0, 8e-5)]
)
def test_a_slightly_moved_camera_is_no_touch(
    frames: list[Frame], calibration: Calibration, turn_deg: float, zoom: float, tilt: float
) -> None:
    turn = np.vstack([cv2.getRotationMatrix2D((160, 160), turn_deg, zoom), [0.0, 0.0, 1.0]])
    there, leaning, back = np.eye(3), np.eye(3), np.eye(3)
    there[:2, 2], leaning[2, 0], back[:2, 2] = -160, tilt, 160
    way = back @ leaning @ there @ turn
    moved, touched = (
        [np.asarray(cv2.warpPerspective(image, way, (320, 320)), np.uint8) for image in images(frames, k)]
        for k in (0, 12)
    )
    assert take_rest_frame(moved, calibration=calibration).reason is RestFrameReason.NONE
    with pytest.raises(TareRefused, match="something touches"):
        take_rest_frame(touched, calibration=calibration)


@pytest.mark.parametrize("k", [10, 14])
def test_a_touch_that_begins_meanwhile_is_unsteady(frames: list[Frame], k: int) -> None:
    """Detected without a reference, though few pins move so far."""
    with pytest.raises(TareRefused) as refused:
        take_rest_frame([frame.image for frame in frames[k - 6 : k + 2]])
    assert refused.value.reason is RestFrameReason.UNSTEADY


def test_half_of_the_pins_covered_are_too_few_and_none_are_no_pattern(
    frames: list[Frame], calibration: Calibration
) -> None:
    reference = take_rest(images(frames, 0))
    covered = images(frames, 0)
    for image in covered:
        image[:, :150] = 0
    with pytest.raises(TareRefused) as refused:
        take_rest_frame(covered, reference=reference)
    assert refused.value.reason is RestFrameReason.TOO_FEW_PINS
    with pytest.raises(TareRefused) as refused:
        take_rest_frame([np.zeros((320, 320), np.uint8)] * 8, calibration=calibration, force=True)
    assert refused.value.reason is RestFrameReason.NO_PIN_PATTERN


def test_an_accepted_rest_frame_is_used(finger: Finger) -> None:
    before = finger.loop.measurement.pipeline
    request = finger.loop.measurement.tare.ask()
    assert finger.loop.measurement.tare.outcome.state is RestFrameState.BUSY
    with pytest.raises(RequestRefused):  # one at a time
        finger.loop.measurement.tare.ask()
    finger.show(*range(8))
    outcome = request.done.result(0)
    assert (outcome.number, outcome.state, outcome.message) == (1, ACCEPTED, "")
    assert finger.loop.measurement.tare.outcome is outcome
    assert finger.loop.measurement.pipeline is not before
    assert not finger.faults
    assert finger.loop.measurement.tare.ask().number == 2


@pytest.mark.parametrize("ended", [False, True], ids=["no images", "the loop has ended"])
def test_a_request_that_gets_no_images_is_refused(finger: Finger, ended: bool) -> None:
    request = finger.loop.measurement.tare.ask()
    if ended:
        finger.loop.stop()
        finger.loop.run()
    else:
        finger.camera.condition = "lost"
        finger.now_ns += 500_000_000
        finger.loop._keep_alive()
        assert not request.done.done()  # a short interruption
        finger.now_ns += 600_000_000
        finger.loop._keep_alive()
        assert request.done.result(0).reason is RestFrameReason.NO_IMAGES
    assert request.done.result(0).state is REFUSED


def test_a_refused_rest_frame_changes_nothing_and_is_reported(finger: Finger) -> None:
    true = finger.show(25).displacement_mm
    before = finger.loop.measurement.pipeline
    request = finger.loop.measurement.tare.ask()
    for k in [25] * 8:
        assert finger.show(k).displacement_mm == pytest.approx(true, abs=0.05)  # also while it is being taken
    outcome = request.done.result(0)
    assert (outcome.state, outcome.reason) == (REFUSED, RestFrameReason.TOUCHED)
    assert "something touches the tip" in outcome.message
    assert finger.loop.measurement.pipeline is before
    assert finger.faults == {FaultCode.TARE_IMPLAUSIBLE}
    assert Status.TARE_FAULT in finger.show(25).status
    finger.loop.measurement.tare.ask()
    assert finger.show(*[7] * 8, 7).status == Status(0)
    assert not finger.faults


@pytest.mark.parametrize(("calibrated", "k"), [(True, 20), (False, 25)])
def test_a_forced_rest_frame_is_flagged_and_no_reference_for_an_untouched_tip(
    frames: list[Frame], calibration: Calibration, calibrated: bool, k: int
) -> None:
    finger = Finger(frames, calibration if calibrated else None)
    request = finger.loop.measurement.tare.ask(force=True)
    assert Status.TARE_FAULT in finger.show(*[k] * 8).status
    outcome = request.done.result(0)
    assert (outcome.state, outcome.reason) == (FORCED, RestFrameReason.TOUCHED)
    assert FaultCode.TARE_IMPLAUSIBLE in finger.faults
    assert Status.TOUCHED in finger.show(7).status  # as it seems now
    again = finger.loop.measurement.ask_tare(force=False)
    finger.show(*[7] * 8)
    assert (again.done.result(0).state, finger.faults - {FaultCode.CALIBRATION_MISSING}) == (ACCEPTED, set())


def test_a_frozen_image_is_no_evidence(finger: Finger) -> None:
    request = finger.loop.measurement.tare.ask()
    finger.camera.frame_condition = "frozen"
    finger.show(*[0] * 20)
    assert not request.done.done()
    finger.camera.frame_condition = ""
    finger.show(*[0] * 8)
    assert request.done.result(0).state is ACCEPTED


def test_a_finger_that_starts_touched_waits_until_it_is_released(
    frames: list[Frame], calibration: Calibration
) -> None:
    finger = Finger([], calibration)
    finger.loop.measurement.fallbacks = (changed(calibration, serial="before"),)  # no reason to fall back
    finger.frames = frames
    finger.show(*[20] * 8)
    assert finger.faults == {FaultCode.TARE_IMPLAUSIBLE}
    assert finger.loop.measurement.pipeline is None
    finger.show(*range(8))
    assert not finger.faults
    assert finger.loop.measurement.pipeline is not None
    assert finger.loop.measurement.calibration is calibration


def test_a_first_rest_frame_under_load_is_refused_without_knowing_the_tip() -> None:
    tip = Simulator(Camera(tip=Tip(n_pins=127, kind="hex"), size_px=(320, 320)))
    touch = tip.frame((ToolPose(depth_mm=3.0, tilt_x_deg=15.0),)).image
    finger = Finger([Frame(touch, k, k) for k in range(8)], None)
    assert finger.loop.measurement.pipeline is None
    assert "something touches the tip" in finger.registry.active[FaultCode.TARE_IMPLAUSIBLE]
    for _ in range(8):
        finger.see(tip.frame().image)
    assert finger.loop.measurement.pipeline is not None
    assert FaultCode.TARE_IMPLAUSIBLE not in finger.faults


def test_an_upload_while_something_touches_changes_nothing(
    finger: Finger, calibration: Calibration, tmp_path: Path
) -> None:
    store = CalibrationStore(tmp_path)
    device = LoopDevice(finger.loop, "T-1", store)
    other = changed(calibration, serial="another")
    true = finger.show(25).displacement_mm
    device.upload_calibration(other.encoded)
    state = finger.show(*[25] * 8)
    assert device.rest_frame()["rest_frame_state"] == REFUSED
    assert device.rest_frame()["rest_frame_reason"] == RestFrameReason.TOUCHED
    assert device.describe()["calibration_id"] == f"{calibration.content_id:08x}"
    assert state.displacement_mm == pytest.approx(true, abs=0.05)
    assert not list(tmp_path.iterdir())
    device.upload_calibration(other.encoded)
    with pytest.raises(RequestRefused, match="already"):
        device.upload_calibration(other.encoded)
    finger.show(*range(8))
    assert device.rest_frame()["rest_frame_state"] == ACCEPTED
    assert device.describe()["calibration_id"] == f"{other.content_id:08x}"
    assert store.path.read_bytes() == other.encoded


def test_another_tips_calibration_or_one_that_cannot_be_stored_leaves_the_one_in_use(
    finger: Finger, data_dir: Path, calibration: Calibration, tmp_path: Path
) -> None:
    foreign = Calibration.load(data_dir / "hex127_flat.json")
    there, gone = (LoopDevice(finger.loop, "T-1", CalibrationStore(tmp_path / name)) for name in ("", "gone"))
    with pytest.raises(CalibrationError, match="made at 280x210, the camera gives 320x320"):
        there.upload_calibration(foreign.encoded)
    for device, upload, reason in (
        (there, changed(foreign, size_px=[320, 320]), RestFrameReason.OTHER_TIP),
        (gone, changed(calibration, serial="another"), RestFrameReason.NOT_STORED),
    ):
        device.upload_calibration(upload.encoded)
        finger.show(*range(8))
        assert device.rest_frame()["rest_frame_reason"] == reason
        assert not list(tmp_path.iterdir())
        assert device.describe()["calibration_id"] == f"{calibration.content_id:08x}"
    state = finger.show(25)
    assert state.displacement_mm == pytest.approx(3.0, abs=0.3)
    assert Status.UNCALIBRATED not in state.status


def test_start_up_falls_back_to_the_last_good_file(calibration: Calibration, tmp_path: Path) -> None:
    store = CalibrationStore(tmp_path)
    assert not store.load()
    second = changed(calibration, serial="second")
    store.replace(calibration)
    store.replace(second)
    ids = [stored.content_id for stored in CalibrationStore(tmp_path).load()]
    assert ids == [second.content_id, calibration.content_id]
    store.path.write_bytes(second.encoded[: len(second.encoded) // 2])
    assert [stored.content_id for stored in store.load()] == [calibration.content_id]
    third = changed(calibration, serial="third")
    store.replace(third)  # an unreadable file does not replace the good one
    store.path.write_bytes(b"{")
    assert [stored.content_id for stored in store.load()] == [calibration.content_id]
    store.previous.write_bytes(b"{")
    assert not store.load()


def test_a_start_with_another_tips_file_falls_back_to_the_one_before(
    frames: list[Frame], calibration: Calibration, caplog: pytest.LogCaptureFixture
) -> None:
    """The tip was exchanged back: the newest file fits it no more, the one before does."""
    foreign = changed(calibration, rest_xy_px=calibration.content.sensor.rest_xy_px[:280])
    finger = Finger([], foreign)
    finger.loop.measurement.fallbacks = (foreign, calibration)
    finger.frames = frames
    finger.show(*range(8))
    assert finger.loop.measurement.calibration is calibration
    assert finger.loop.measurement.tare.outcome.state is RestFrameState.UNKNOWN  # nobody asked
    assert not finger.faults
    assert f"using the calibration stored before, {calibration.content_id:08x}" in caplog.text
    assert finger.show(25).displacement_mm == pytest.approx(3.0, abs=0.3)


def test_a_calibration_with_few_of_the_pins_is_another_tips_and_reported_once(
    frames: list[Frame], calibration: Calibration
) -> None:
    """Whatever else the images show, until a rest frame is accepted."""
    foreign = changed(calibration, rest_xy_px=calibration.content.sensor.rest_xy_px[:280])
    with pytest.raises(TareRefused, match=r"has 280 pins, the camera sees 331|another tip") as refused:
        take_rest_frame(images(frames, 0), calibration=foreign)
    assert refused.value.reason is RestFrameReason.OTHER_TIP
    finger = Finger(frames, foreign)
    for shown in ([frames[20].image] * 8, [np.zeros((320, 320), np.uint8)] * 8, images(frames, 0)) * 2:
        states = [finger.see(image) for image in shown]
        assert FaultCode.CALIBRATION_FOREIGN in finger.faults
        assert Status.UNCALIBRATED in states[-1].status
    assert finger.registry.appeared[FaultCode.CALIBRATION_FOREIGN] == 1


def test_on_a_mostly_touched_recording_no_wrong_tare_is_accepted(finger: Finger) -> None:
    """Requested at any time: an accepted rest frame gives the same depth, all others are refused."""

    def depth_mm() -> float:
        assert finger.loop.measurement.pipeline is not None
        finger.loop.measurement.pipeline.forget()
        return finger.show(25).displacement_mm

    true = depth_mm()
    outcomes = set()
    for start in range(0, len(finger.frames), 4):
        request = finger.loop.measurement.tare.ask()
        for k in count(start):
            if request.done.done():
                break
            finger.show(k % len(finger.frames))
        outcomes.add(request.done.result(0).state)
        assert depth_mm() == pytest.approx(true, abs=0.03)
    assert outcomes == {ACCEPTED, REFUSED}


@pytest.fixture
def pressed_for_ever(data_dir: Path) -> Iterator[Paced]:
    """A touch that is played again and again; its thread ends with the test."""
    with contextlib.closing(Paced(open_source(str(data_dir / "press.mcap")), loop=True)) as source:
        yield source


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[threading.Event, threading.Event]]:
    """A check of a rest frame has begun; it may go on."""
    begun, go_on = threading.Event(), threading.Event()

    def checked(*arguments: Any, **options: Any) -> RestFrame:
        begun.set()
        assert go_on.wait(SOON_S)
        return take_rest_frame(*arguments, **options)

    monkeypatch.setattr(measurement, "take_rest_frame", checked)
    yield begun, go_on
    go_on.set()


def test_samples_go_on_while_a_rest_frame_is_checked(
    pressed_for_ever: Paced, calibration: Calibration, held: tuple[threading.Event, threading.Event]
) -> None:
    finger, (begun, go_on) = Finger([], calibration, source=pressed_for_ever), held
    measured = threading.Semaphore(0)
    finger.loop.result_callbacks.append(lambda *_: measured.release())
    thread = threading.Thread(target=finger.loop.run)
    go_on.set()
    thread.start()
    assert measured.acquire(timeout=SOON_S)
    go_on.clear()
    begun.clear()
    request = finger.loop.measurement.tare.ask(force=True)
    assert begun.wait(SOON_S)
    while measured.acquire(blocking=False):
        pass
    for _ in range(3):  # results, although the new rest frame is not ready
        assert measured.acquire(timeout=SOON_S)
    assert finger.loop.measurement.tare.outcome.state is RestFrameState.BUSY
    go_on.set()
    assert request.done.result(SOON_S).state in (ACCEPTED, FORCED)
    finger.loop.stop()
    thread.join(SOON_S)


@pytest.mark.parametrize("fails", [False, True])
def test_values_come_before_the_tables_and_without_them(
    fails: bool, pressed_for_ever: Paced, calibration: Calibration, monkeypatch: pytest.MonkeyPatch
) -> None:
    measured, begun = threading.Event(), threading.Event()

    def prepare(*_: object) -> None:
        begun.set()
        if fails:
            raise MemoryError
        assert measured.wait(SOON_S)

    monkeypatch.setattr(Pipeline, "prepare", prepare)
    finger = Finger([], calibration, source=pressed_for_ever)

    def stop(result: Result, _: State) -> None:
        if begun.is_set() and result.features is not None:
            measured.set()
            finger.loop.stop()

    finger.loop.result_callbacks.append(stop)
    finger.loop.run()
    assert measured.is_set()


def test_a_loop_ends_at_once_while_its_first_rest_frame_is_checked(
    pressed_for_ever: Paced, held: tuple[threading.Event, threading.Event]
) -> None:
    finger = Finger([], None, source=pressed_for_ever)
    thread = threading.Thread(target=finger.loop.run)
    thread.start()
    assert held[0].wait(SOON_S)
    finger.loop.stop()
    thread.join(SOON_S)
    assert not thread.is_alive()
    assert finger.loop.measurement.pipeline is None
