"""`edge render`: the video holds the recording, frame by frame, with the pipeline's results."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from edge.calibration import Calibration
from edge.cli import render
from edge.cli.render import render_recording
from edge.pins import take_rest
from edge.runtime.loop import Loop
from edge.types import Frame
from edge.view.panels import View, draw_camera
from hostlink.wire import State
from tests.support.finger import Finger


def frames_of(path: Path) -> list[np.ndarray]:
    video = cv2.VideoCapture(str(path))
    frames = []
    while (read := video.read())[0]:
        frames.append(read[1])
    video.release()
    return frames


def red_n(image: np.ndarray) -> int:
    b, g, r = (image[..., k].astype(int) for k in range(3))
    return int(((r > 180) & (g < 110) & (b < 110)).sum())


def test_every_frame_is_in_the_video(
    data_dir: Path, tmp_path: Path, frames: list[Frame], calibration: Calibration
) -> None:
    recording, video = str(data_dir / "press.mcap"), tmp_path / "a.mkv"
    made = render_recording(recording, video, calibration, rate_hz=25, height=320)
    shown = frames_of(video)
    assert made == {"frames_n": len(frames), "pins_n": 331, "rate_hz": 25, "without_values": {}}
    assert len(shown) == len(frames)
    touch_panels = [picture[:320, :320] for picture in shown]  # the left panel
    assert red_n(touch_panels[0]) == 0
    assert red_n(touch_panels[-1]) > 200
    # The right panel is the camera's own image: as recorded, except for the rings and the scale.
    camera = cv2.cvtColor(shown[-1][:320, 324 : 324 + 320], cv2.COLOR_BGR2GRAY)
    rest = take_rest([frame.image for frame in frames[:8]])
    view = View.of(rest.xy_img, rest.pattern.pitch_px, 320)
    drawn = [draw_camera(view, frame.image)[..., 0].ravel() for frame in (frames[0], frames[-1])]
    alike = [np.corrcoef(camera.ravel(), image)[0, 1] for image in drawn]
    assert alike[1] > max(0.8, alike[0])
    assert cv2.VideoCapture(str(video)).get(cv2.CAP_PROP_FPS) == pytest.approx(25)


def test_render_shows_the_values_that_the_running_finger_sends(
    data_dir: Path, tmp_path: Path, frames: list[Frame], calibration: Calibration,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    shown: list[State] = []

    class Shown(Loop):
        def step(self, frame: Frame) -> State:
            shown.append(super().step(frame))
            return shown[-1]

    monkeypatch.setattr(render, "Loop", Shown)
    render_recording(str(data_dir / "press.mcap"), tmp_path / "a.mkv", calibration, height=120)
    finger = Finger([], calibration)
    for frame, now in zip(frames, shown, strict=True):
        sent = finger.loop.step(frame)
        if np.isfinite(sent.displacement_mm):
            assert now.displacement_mm == sent.displacement_mm
            assert now.shear_x_mm == sent.shear_x_mm
            assert now.contacts == sent.contacts
    assert np.isfinite(shown[0].displacement_mm)
    assert np.isfinite(sent.displacement_mm)
