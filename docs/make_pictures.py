"""Make README's pictures again: `python -m docs.make_pictures [page|touch]`.

touch is what `render` makes of the example recording, as a GIF. page is the live page of `edge replay
example:press --loop --view` while the tip is twisted; latency and rate are this machine's: let it be idle.
It has all colours: 256 leave steps in colour bar and image.
"""

import io
import signal
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from edge.calibration import Calibration
from edge.cli.render import render_recording
from edge.examples import example_file
from tests.browser.pages import browser, errors, opened

PICTURES = Path(__file__).resolve().parents[1] / "tests" / "data" / "pictures"
EACH = 3  # pictures of the recording that one of the GIF stands for
FULL_S = 11.0  # the charts are full
REPLAY = (sys.executable, "-m", "edge", "replay", "example:press", "--loop", "--view-at", "127.0.0.1:0")


def moving(path: Path) -> None:
    """Write the GIF, with the colours of all its pictures in one palette."""
    with tempfile.TemporaryDirectory() as folder:
        video = Path(folder) / "touch.mkv"
        calibration = Calibration.load(example_file("example:press", ".json"))
        made = render_recording("example:press", video, calibration, height=300)
        capture = cv2.VideoCapture(str(video))
        pictures = [capture.read()[1][..., ::-1] for _ in range(made["frames_n"])][::EACH]
    colours = Image.fromarray(np.vstack(pictures[::5])).quantize(96, Image.Quantize.MAXCOVERAGE)
    images = [Image.fromarray(p).quantize(palette=colours, dither=Image.Dither.NONE) for p in pictures]
    shown_ms = round(1000 * EACH / made["rate_hz"])
    images[0].save(path, save_all=True, append_images=images[1:], duration=shown_ms, loop=0, optimize=True)


def page(path: Path) -> None:
    with browser() as context, subprocess.Popen(REPLAY, stderr=subprocess.PIPE, text=True) as replay:
        assert replay.stderr is not None
        try:
            shown = opened(context, replay.stderr.readline().removeprefix("live page: ").strip())
            threading.Event().wait(FULL_S)
            twisted = "/Torsion\\s*°\\s*[3456]/.test(document.getElementById('numbers').innerText)"
            shown.wait_for_function(f"() => {twisted}")
            raw = shown.screenshot()
            assert errors(shown) == []
        finally:
            replay.send_signal(signal.SIGINT)
    with Image.open(io.BytesIO(raw)) as shot:
        shot.convert("RGB").save(path, optimize=True)


def main() -> None:
    if "touch" in (sys.argv[1:] or ["touch"]):
        moving(PICTURES / "touch.gif")
    if "page" in (sys.argv[1:] or ["page"]):
        page(PICTURES / "page_desktop.png")


if __name__ == "__main__":
    main()
