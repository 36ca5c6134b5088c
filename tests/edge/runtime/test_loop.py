"""The loop and its faults: each row of the table seen, announced, cleared; values only while valid."""

import json
import math
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from edge.calibration import Calibration
from edge.config import FeaturesTable, LimitsTable
from edge.faults.registry import FaultRegistry
from edge.link.sinks import MemorySink
from edge.params import PARAMS
from edge.runtime.board_monitor import BoardMonitor
from edge.runtime.loop import Loop
from edge.types import Clock, Frame, Image, Result
from hostlink.wire import FAULTS, FaultCode, RestFrameState, State, Status
from tests.support.fault_injection import _PICTURES, EXPECTED
from tests.support.finger import PERIOD_NS, Camera, Finger
from tests.support.waiting import SOON_S, until

STATUS = {fault.code: fault.status for fault in FAULTS}


def measured(state: State) -> bool:
    """Whether there is any value that a controller could use."""
    return not math.isnan(state.displacement_mm) or state.contact_n > 0


@pytest.mark.parametrize("seed", [23, 34, 42, 49, 57, 69, 77, 81, 94, 147, 148])  # once wrong by 0.4 mm
def test_noise_over_a_contact_gives_no_wrong_value(finger: Finger, seed: int) -> None:
    truth = finger.show(*range(8, len(finger.frames)))
    state = finger.see(_PICTURES["corrupt"](finger.frames[-1].image, np.random.default_rng(seed)))
    if state.status & (Status.PINS_LOST | Status.TRACKER_LOST):
        assert not measured(state)
    else:
        assert state.displacement_mm == pytest.approx(truth.displacement_mm, abs=0.4)
        assert state.shear_x_mm == pytest.approx(truth.shear_x_mm, abs=0.4)


def test_pins_are_searched_for_after_a_gap(finger: Finger) -> None:
    pressed = finger.frames[25].image
    true = finger.see(pressed).displacement_mm
    finger.see(pressed)
    full_searches_n = finger.loop.statistics().full_searches_n
    finger.see(pressed, skip=2)  # images that were dropped are no gap
    assert finger.loop.statistics().full_searches_n == full_searches_n
    state = finger.see(pressed, skip=11)  # 0.12 s
    assert finger.loop.statistics().full_searches_n == full_searches_n + 1
    assert not finger.loop._detector.quiet  # no time at rest for the drift
    assert state.displacement_mm == pytest.approx(true, abs=0.05)


def test_pins_are_not_followed_from_an_image_that_was_frozen(finger: Finger) -> None:
    finger.show(7)
    full_searches_n = finger.loop.statistics().full_searches_n
    finger.camera.frame_condition = "frozen"
    state = finger.show(7, 7, 20)
    assert Status.CAMERA_FAULT in state.status
    assert not measured(state)
    assert finger.loop.statistics().full_searches_n == full_searches_n
    finger.camera.frame_condition = ""
    state = finger.show(8, 9)
    assert finger.loop.statistics().full_searches_n == full_searches_n + 1
    assert measured(state)


@pytest.mark.parametrize("k", [12, 18, 25])
def test_a_camera_knocked_under_a_touch_is_distinguished_from_shear(finger: Finger, k: int) -> None:
    assert finger.show(*range(8, k + 1)).status == Status.TOUCHED
    shifted = _PICTURES["shift"](finger.frames[k].image, None)
    for _ in range(2):
        assert finger.see(shifted).status & ~Status.SATURATED == Status.TOUCHED | Status.CAMERA_MOVED
    assert finger.show(k).status == Status.TOUCHED  # and moved back


def test_a_camera_that_was_knocked_untouched_may_come_back_under_a_touch(finger: Finger) -> None:
    shifted = _PICTURES["shift"](finger.frames[7].image, None)
    for _ in range(3):
        assert finger.see(shifted).status == Status.CAMERA_MOVED
    for frame in finger.frames[8:20]:
        moved = finger.see(_PICTURES["shift"](frame.image, None))
    assert moved.status & ~Status.SATURATED == Status.TOUCHED | Status.CAMERA_MOVED
    assert finger.see(finger.frames[20].image).status == Status.TOUCHED


@pytest.mark.parametrize("kind", ["black", "dim", "bright", "blur", "shift", "cover"])
def test_image_faults_are_announced_with_their_image_and_cleared(finger: Finger, kind: str) -> None:
    random = np.random.default_rng(0)
    finger.show(7)
    states = [finger.see(_PICTURES[kind](finger.frames[7].image, random)) for _ in range(5)]  # 50 ms
    (code,) = EXPECTED[kind] & finger.faults
    assert STATUS[code] in states[-1].status
    assert finger.show(*[7] * 10).status == Status(0)
    assert not finger.faults


@pytest.mark.parametrize("kind", ["black", "bright", "cover", "blur"])
def test_a_touch_that_is_hidden_is_never_reported_as_none(finger: Finger, kind: str) -> None:
    """From the first image of a fault on: no value without a bit that forbids its use."""
    random = np.random.default_rng(0)
    pressed = finger.frames[25].image
    finger.see(pressed)
    untrusted = Status.CAMERA_FAULT | Status.IMAGE_FAULT | Status.PINS_LOST | Status.TRACKER_LOST
    for _ in range(3):
        state = finger.see(_PICTURES[kind](pressed, random))
        if not state.status & untrusted:
            assert state.displacement_mm == pytest.approx(3.0, abs=0.4)


@pytest.mark.parametrize(
    ("condition", "kind"), [("lost", "lost"), ("stalled", "stall"), ("frozen", "freeze")]
)
def test_the_condition_of_the_camera_is_reported(finger: Finger, condition: str, kind: str) -> None:
    finger.camera.condition = condition
    state = finger.show(20)
    assert finger.faults == EXPECTED[kind]
    assert Status.CAMERA_FAULT in state.status
    assert not measured(state)
    finger.camera.condition = ""
    assert measured(finger.show(21))
    assert not finger.faults
    finger.camera.recorded = True
    assert finger.show(25).status == Status.TOUCHED | Status.NOT_LIVE


def test_a_clock_step_is_flagged_in_one_sample(finger: Finger) -> None:
    rest = finger.frames[7].image
    seen = [
        Status.CLOCK_STEP in finger.see(rest, jump_ns=jump).status
        for jump in (0, 5_000_000_000, 0, -3_000_000_000, 0)
    ]
    assert seen == [False, True, False, True, False]


@pytest.mark.parametrize("clock", [Clock.DEVICE, Clock.DRIVER, Clock.HOST])
def test_a_delay_is_no_clock_step(frames: list[Frame], calibration: Calibration, clock: Clock) -> None:
    """A process that is not scheduled for a while looks at an image late, and then at a new one."""
    finger = Finger(frames, calibration, clock=clock)
    for late_n in (70, 0, 3, 120, 0):
        state = finger.see(frames[7].image, skip=150, late_n=late_n)
        assert Status.CLOCK_STEP not in state.status
    assert FaultCode.CLOCK_STEP not in finger.faults
    assert Status.CLOCK_STEP in finger.see(frames[7].image, jump_ns=600_000_000).status


def test_a_clock_that_drifts_does_not_step(frames: list[Frame], calibration: Calibration) -> None:
    for ppm in (-150, 150):
        finger = Finger(frames, calibration)
        for _ in range(6):
            state = finger.see(frames[7].image, skip=29_999, jump_ns=ppm * 300_000)  # 300 s: 45 ms
            assert Status.CLOCK_STEP not in state.status
        assert Status.CLOCK_STEP in finger.see(frames[7].image, jump_ns=600_000_000).status
        assert Status.CLOCK_STEP in finger.see(frames[7].image, jump_ns=-600_000_000).status


def test_skipped_frames_are_flagged_in_the_next_sample(finger: Finger) -> None:
    rest = finger.frames[7].image
    seen = [Status.FRAMES_DROPPED in finger.see(rest, skip=skip).status for skip in (0, 3, 0)]
    assert seen == [False, True, False]
    finger.camera.dropped_n = 2  # taken from the queue by newer ones
    assert Status.FRAMES_DROPPED in finger.see(rest).status
    assert finger.loop.statistics().lost_by_camera_n == 3
    finger.camera.dropped_n = 4  # these make a gap in the numbers, and count once
    assert Status.FRAMES_DROPPED in finger.see(rest, skip=4).status
    assert finger.loop.statistics().lost_by_camera_n == 3


def test_overload(frames: list[Frame], calibration: Calibration) -> None:
    finger = Finger(frames, calibration, limits=LimitsTable(load_pitches=0.05))
    assert Status.OVERLOAD in finger.show(25).status
    assert finger.faults == {FaultCode.OVERLOAD}
    finger.show(7)
    assert not finger.faults


def test_samples_have_the_smoothed_values_and_the_flags_as_they_are(
    frames: list[Frame], calibration: Calibration
) -> None:
    """The result that recorder and page get is the one that is sent; a gap begins anew."""
    smoothed = FeaturesTable(smooth_ms=100)
    plain, smooth = Finger(frames, calibration), Finger(frames, calibration, features=smoothed)
    seen: list[tuple[Result, State]] = []
    smooth.loop.result_callbacks.append(lambda result, state: seen.append((result, state)))
    for number in (*range(8, len(frames)), 8, 8, 25, 25):
        read, sent = plain.see(frames[number].image), smooth.see(frames[number].image)
        assert (sent.status, sent.contact_n) == (read.status, read.contact_n)
        if not read.contact_n:
            assert sent.displacement_mm == read.displacement_mm
    for result, state in seen:
        assert state.displacement_mm == pytest.approx(result.reading.values["displacement_mm"], abs=0.01)
    pressed, half = frames[25].image, frames[12].image
    smooth.see(pressed), plain.see(pressed)
    apart_mm = [abs(smooth.see(half).displacement_mm - plain.see(half).displacement_mm) for _ in range(3)]
    assert min(apart_mm) > 0.05
    after_gap = [finger.see(half, skip=20).displacement_mm for finger in (smooth, plain)]
    assert after_gap[0] == after_gap[1]


def test_no_calibration_is_a_fault_until_there_is_one(frames: list[Frame], calibration: Calibration) -> None:
    finger = Finger(frames, None)
    assert Status.UNCALIBRATED in finger.show(7).status
    assert finger.faults == {FaultCode.CALIBRATION_MISSING}
    request = finger.loop.measurement.tare.ask(calibration=calibration)
    state = finger.show(*range(8), 0)
    assert request.done.result(0).state is RestFrameState.ACCEPTED
    assert not finger.faults
    assert state.status == Status(0)


def test_heat_and_disk_reach_the_samples(frames: list[Frame], calibration: Calibration) -> None:
    registry = FaultRegistry()
    now: dict[str, Any] = {"degc": 91.0, "disk": "no space left"}
    monitor = BoardMonitor(registry, lambda: now["degc"], [lambda: now["disk"]])
    camera, sink, k = Camera(), MemorySink(), 0
    loop = Loop(camera, [sink], calibration, faults=registry, board=monitor, clock_ns=lambda: k * PERIOD_NS)
    monitor.check()
    for k in range(9):
        state = loop.step(Frame(frames[k % 8].image, k * PERIOD_NS, k, Clock.DEVICE))
    assert state.status == Status.OVER_TEMPERATURE | Status.STORAGE_FAULT
    assert state.temperature_degc == 91.0
    now.update(degc=40.0, disk="")
    monitor.check()
    k = 9
    assert loop.step(Frame(frames[7].image, k * PERIOD_NS, k, Clock.DEVICE)).status == Status(0)


def test_brightness_of_a_waiting_image_is_reported_during_a_search(finger: Finger) -> None:
    finger.see(finger.frames[9].image)
    dark = Frame(np.zeros_like(finger.frames[9].image), finger.now_ns, finger.n + 1, Clock.DEVICE)
    finger.camera.waiting_frame = dark
    begun_ns = finger.now_ns
    finger.loop._detector.slow(begun_ns)  # it does not take long yet
    assert finger.faults == set()
    finger.now_ns += 40_000_000
    finger.loop._detector.slow(begun_ns)
    assert finger.faults == {FaultCode.TRACKER_LOST, FaultCode.IMAGE_DARK}
    finger.see(finger.frames[10].image)
    assert finger.faults == set()


def test_without_images_samples_go_on_with_the_reason(frames: list[Frame], calibration: Calibration) -> None:
    awake = Finger(frames, calibration, clock_ns=time.monotonic_ns)
    before = len(awake.sink.states)
    thread = threading.Thread(target=awake.loop.run)
    thread.start()
    for _ in range(20):  # a slow camera is no fault
        assert awake.camera.waiting.acquire(timeout=SOON_S)
    assert awake.loop.post(lambda: 42).result(SOON_S) == 42  # commands run without images
    assert len(awake.sink.states) == before
    awake.camera.condition = "lost"
    until(lambda: len(awake.sink.states) >= before + 3)
    awake.loop.stop()
    thread.join(SOON_S)
    assert not thread.is_alive()
    assert not awake.camera.ended  # a stop, from a signal handler, closes nothing
    beats = list(awake.sink.states)[before:]
    assert all(Status.CAMERA_FAULT in s.status and not measured(s) for s in beats)
    assert [s.sample for s in beats] == list(range(beats[0].sample, beats[0].sample + len(beats)))
    steps_us = np.diff([s.capture_time_us for s in beats])
    assert steps_us.min() >= 0.9e6 * PARAMS.check_s  # the slow rate, on the camera's clock
    assert beats[0].capture_time_us >= awake.n * PERIOD_NS // 1000


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((1, 1), np.uint8),
        np.zeros((0, 320), np.uint8),
        np.full((320, 320), 255, np.uint8),
        np.random.default_rng(0).integers(0, 255, (320, 320), dtype=np.uint8),
        np.zeros((200, 100), np.uint8),
        np.full((320, 320), 60_000, np.uint16),
    ],
    ids=["one pixel", "empty", "white", "noise", "small", "16 bits"],
)
def test_no_image_ends_the_loop(finger: Finger, image: Image) -> None:
    with np.errstate(all="ignore"):
        state = finger.see(image)
    assert not measured(state)
    assert state.status & (Status.TRACKER_LOST | Status.PINS_LOST | Status.IMAGE_FAULT)
    assert finger.show(*[7] * 10).status == Status(0)


def test_a_smaller_image_in_mid_stream_is_reported_and_loses_one_frame(finger: Finger) -> None:
    smaller: Image = finger.frames[7].image[:160, :160].copy()
    for _ in range(5):
        assert not measured(finger.see(smaller))
    assert "160x160 px, the rest frame 320x320" in finger.registry.active[FaultCode.TRACKER_LOST]
    assert measured(finger.show(*[20] * 10))
    assert not finger.faults


def test_a_failing_viewer_is_disconnected(finger: Finger) -> None:
    reported: list[int] = []

    def bad(result: object, state: State) -> None:
        raise RuntimeError("of its own making")

    finger.loop.result_callbacks += [bad, lambda result, state: reported.append(state.sample)]
    finger.show(7, 7)
    assert len(reported) == 2
    assert bad not in finger.loop.result_callbacks


def test_a_failing_recorder_ends_only_the_recording(finger: Finger) -> None:
    def broken(name: str, *_: object) -> bool:
        raise OSError("gone")

    finger.loop.session.begin(broken)
    assert measured(finger.see(finger.frames[20].image))
    assert finger.loop.session.put is None
    assert finger.faults == {FaultCode.DISK_FULL}


def test_drift_is_learnt_at_rest(frames: list[Frame], calibration: Calibration) -> None:
    finger = Finger(frames, calibration)
    rest = frames[7].image
    way = np.array([[1.0, 0, 0.25], [0, 1.0, 0]])
    moved = np.asarray(cv2.warpAffine(rest, way, (320, 320), borderMode=cv2.BORDER_REPLICATE), np.uint8)
    for _ in range(1000):  # 10 s at 100 frames/s
        finger.see(moved)
    assert 0.005 < finger.loop.statistics().drift_px <= 0.3


def test_the_service_manager_gets_ready_watchdog_and_stopping(data_dir: Path, tmp_path: Path) -> None:
    """And SIGTERM is a clean end: status 0, the closing statistics printed."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(SOON_S)
        messages = iter(lambda: manager.recv(1000), b"")
        received = (message for message in messages if not message.startswith(b"STATUS="))
        environment = {**os.environ, "NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "400000"}
        command = [sys.executable, "-m", "edge", "replay", str(data_dir / "press.mcap"), "--loop", "--json"]
        with subprocess.Popen(
            [*command, "--sink", "memory:"], env=environment, stdout=subprocess.PIPE, text=True
        ) as process:
            assert next(received) == b"READY=1"
            assert next(received) == b"WATCHDOG=1"
            assert next(received) == b"WATCHDOG=1"  # a tenth of a second later: images flow
            process.send_signal(signal.SIGTERM)
            assert next(message for message in received if message != b"WATCHDOG=1") == b"STOPPING=1"
            out, _ = process.communicate(timeout=SOON_S)
    assert process.returncode == 0
    assert json.loads(out.splitlines()[-1])["frames_n"] > 0
