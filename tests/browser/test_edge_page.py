"""The finger's page in a real browser: checked by its pixels and text."""

import base64
import math
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from playwright.sync_api import BrowserContext, Page, ViewportSize

from edge.recording.reader import RecordingSource
from tests.browser.pages import errors, opened
from tests.support.viewing import TOKEN, Live
from tests.support.waiting import SOON_S, present, until

PRESSED = -1
PRELOADED = 14  # 1.5 mm: a forced tare accepts it; pressed deeper, the pins look like another tip's
LIVE = "() => document.body.dataset.state === 'live'"
STATE = "document.getElementById('state').textContent"


@pytest.fixture(scope="module")
def live(data_dir: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    folder = tmp_path_factory.mktemp("recordings")
    with Live(data_dir / "press.mcap", data_dir / "rings331_ball.json", recordings=folder) as running:
        yield running


@pytest.fixture
def page(live: Live, context: BrowserContext) -> Iterator[Page]:
    live.show(0)
    with closing(opened(context, live.url)) as page:
        page.wait_for_function(LIVE)
        page.wait_for_function("() => Number(document.body.dataset.packets) > 0")  # the first picture came
        yield page
        assert errors(page) == []


def pixels(page: Page) -> np.ndarray:
    """(h, w, 3) of the canvas of touch, once it has been drawn again."""
    size, data = page.evaluate(
        """new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => {
            const canvas = document.getElementById("touch");
            const g = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d");
            g.fillStyle = "#fff";
            g.fillRect(0, 0, canvas.width, canvas.height);
            g.drawImage(canvas, 0, 0);
            const image = g.getImageData(0, 0, canvas.width, canvas.height);
            let text = "";
            for (let i = 0; i < image.data.length; i += 4)
                text += String.fromCharCode(image.data[i], image.data[i + 1], image.data[i + 2]);
            done([[canvas.height, canvas.width], btoa(text)]);
        })))"""
    )
    return np.frombuffer(base64.b64decode(data), np.uint8).reshape(*size, 3)


def centre_of(mask: np.ndarray) -> np.ndarray:
    """Middle (x, y) of the marked pixels."""
    rows, columns = np.nonzero(mask)
    return np.array([columns.mean(), rows.mean()])


def press(live: Live, page: Page, frame: int = PRESSED) -> None:
    live.show(frame)
    shown(page, "1 contact")


def red(image: np.ndarray) -> np.ndarray:
    """Pixels of cells that are compressed for more than half of the scale."""
    r, g, b = (image[..., k].astype(int) for k in range(3))
    return (r > 190) & (g < 120) & (b < 125)


def until_red(page: Page, colour: Callable[[np.ndarray], np.ndarray] = red) -> np.ndarray:
    """The picture once it shows pressed cells: a busy machine withholds the values of a late image."""
    images: list[np.ndarray] = []

    def shows() -> bool:
        images[:] = [pixels(page)]
        return bool(colour(images[0]).sum() > 100)

    until(shows, "pressed cells in the picture")
    return images[0]


def orange(image: np.ndarray) -> np.ndarray:
    r, g, b = (image[..., k].astype(int) for k in range(3))
    return (r > 220) & (g > 130) & (g < 200) & (b < 100)


def on_canvas(live: Live, xy_img: Any, width: int) -> np.ndarray:
    """Place of the image on the canvas, which shows the square round the pins with two pitches of margin."""
    rest = present(live.loop.measurement.pipeline).rest
    low, high = rest.xy_img.min(axis=0), rest.xy_img.max(axis=0)
    side = float((high - low).max()) + 4 * rest.pattern.pitch_px
    place: np.ndarray = (np.array(xy_img) - ((low + high) / 2 - side / 2) + 0.5) * width / side
    return place


def shown(page: Page, message: str) -> None:
    page.wait_for_function(f"() => document.body.innerText.includes({message!r})")


def test_red_where_the_simulator_pressed(live: Live, page: Page) -> None:
    untouched = pixels(page)
    assert untouched.std() > 10, "nothing is drawn"
    assert not red(untouched).any()
    press(live, page)
    image = until_red(page)
    width = image.shape[1]
    where = on_canvas(live, present(live.source.frames[PRESSED].truth)["places_img"][0], width)
    pitch = on_canvas(live, [0, 0], width) - on_canvas(live, [-11.8, 0], width)
    assert red(image).sum() > 0.3 * pitch[0] ** 2, "about a cell and more"
    assert np.hypot(*(centre_of(red(image)) - where)) < 1.5 * pitch[0]
    # Left and right of the pressed place nothing is red.
    assert not red(image)[:, : int(where[0] - 4 * pitch[0])].any()


def test_safe_colours(live: Live, page: Page) -> None:
    press(live, page)
    page.keyboard.press("c")
    page.wait_for_function("() => document.getElementById('safe').ariaPressed === 'true'")
    assert not red(until_red(page, orange)).any()
    page.keyboard.press("c")
    page.wait_for_function("() => document.getElementById('safe').ariaPressed === 'false'")
    until_red(page)


def outlines_n(image: np.ndarray) -> int:
    """How many pixels have the colour of the cells' outlines."""
    return int((image == (190, 190, 190)).all(axis=2).sum())


def test_surface(live: Live, page: Page) -> None:
    press(live, page)
    outlines = outlines_n(until_red(page))
    page.keyboard.press("s")

    def is_surface() -> bool:
        image = pixels(page)
        return bool(red(image).any()) and outlines > 5 * outlines_n(image)

    live.until(is_surface, "a surface, which has no outlines of cells")


def test_numbers_are_the_calibrated_ones(live: Live, page: Page) -> None:
    press(live, page)
    numbers = "document.getElementById('numbers').innerText"

    def depth_mm() -> float:
        found = re.search(r"Depth\s*mm\s*([-\u2212\d.]+)", page.evaluate(numbers))
        return float(found[1]) if found else math.nan

    until(lambda: abs(depth_mm() - 3.0) < 0.3, "the depth of the picture shown")  # numbers lag the picture
    text = page.evaluate(numbers)
    assert re.search(r"Pins held\s*33[01]\s*of 331", text)
    titles = page.evaluate("[...document.querySelectorAll('.chart:not([hidden]) h2')].map(e => e.innerText)")
    shown_charts = ", ".join(" ".join(t.split()) for t in titles)
    assert shown_charts == "Depth mm, Normal force N, Shear mm x y, Torsion °, Rate Hz, Latency ms"


def test_charts_move(live: Live, page: Page) -> None:
    live.show(0)
    chart = "document.querySelector('.chart canvas')"
    ink = (
        f"(() => {{ const c = {chart};"
        "const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;"
        "let top = c.height; for (let i = 0; i < d.length; i += 4)"
        "if (d[i] < 40 && d[i + 2] > 120 && d[i + 3] > 200) { top = Math.floor(i / 4 / c.width); break }"
        "return top })()"
    )
    page.wait_for_function(f"() => {chart}.width && {ink}")  # a chart is laid out after the first packet
    low = page.evaluate(ink)
    live.show(PRESSED)
    page.wait_for_function(f"() => {ink} < {low} - 20")


def test_tare_works_and_shows(live: Live, page: Page) -> None:
    press(live, page, PRELOADED)
    until_red(page)
    page.keyboard.press("t")
    shown(page, "something touches the tip")
    tares_n = live.loop.measurement.tares_n
    page.click("#toast button")  # tare anyway: then the pressed tip is the rest
    shown(page, "rest frame taken")
    assert live.loop.measurement.tares_n == tares_n + 1
    shown(page, "untouched")
    page.wait_for_function("() => !document.getElementById('felt_about').textContent.includes('contact')")
    live.until(lambda: not red(pixels(page)).any(), "cells that are no longer pressed")
    live.show(0)
    live.loop.measurement.tare.ask().done.result(20)
    live.until(lambda: live.loop.measurement.tares_n == tares_n + 2, "the rest frame of the untouched tip")
    page.wait_for_function("() => document.getElementById('toast').hidden")
    page.keyboard.press("t")  # untouched: no confirmation is needed
    shown(page, "rest frame taken")
    press(live, page)
    until_red(page)


def test_record_button(live: Live, page: Page) -> None:
    page.keyboard.press("r")
    page.wait_for_function("() => /Stop \\d\\d/.test(document.getElementById('record').textContent)")
    page.keyboard.press("r")
    page.wait_for_function("() => /[1-9]\\d* frames/.test(document.getElementById('toast').textContent)")
    message = page.evaluate("document.getElementById('toast').textContent")
    frames_n = len(list(RecordingSource(live.recordings / message.split(":")[0])))
    assert f"{frames_n} frames" in message
    assert "lost" not in message


def test_read_only_without_the_token(live: Live, context: BrowserContext) -> None:
    with closing(opened(context, live.url.partition("#")[0])) as page:
        page.wait_for_function(LIVE)
        assert page.evaluate("document.getElementById('tare').disabled")
        tares_n = live.loop.measurement.tares_n
        page.keyboard.press("t")
        page.click("#tare", force=True)
        page.wait_for_function("() => document.getElementById('tare').title.includes('token')")
        assert live.loop.measurement.tares_n == tares_n
    with closing(opened(context, live.url.replace(TOKEN, "not-the-token"))) as wrong:
        shown(wrong, "the token is missing or wrong")
        assert wrong.evaluate("document.body.dataset.state") == "refused"


def test_a_stalled_camera_shows(live: Live, page: Page) -> None:
    live.hold()
    page.wait_for_function("() => document.body.dataset.state === 'stale'")
    shown(page, "nothing new for")
    shown(page, "camera is there but sends no images")
    live.go_on()
    page.wait_for_function(LIVE)
    page.wait_for_function("() => document.getElementById('faults').children.length === 0")


def test_hold_keeps_the_picture(live: Live, page: Page) -> None:
    page.keyboard.press(" ")
    page.wait_for_function("() => document.getElementById('hold').ariaPressed === 'true'")
    before = pixels(page)
    live.show(PRESSED)
    assert (pixels(page) == before).all()
    page.keyboard.press(" ")
    shown(page, "1 contact")


def test_phone(live: Live, context: BrowserContext) -> None:
    live.show(PRESSED)
    screen = ViewportSize(width=390, height=844)  # the commonest of the last years
    browser = present(context.browser)
    view = browser.new_context(viewport=screen, device_scale_factor=3, is_mobile=True, has_touch=True)
    with closing(view), closing(opened(view, live.url)) as page:
        page.wait_for_function(LIVE)
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth"), "it scrolls sideways"
        boxes = page.evaluate(
            "[...document.querySelectorAll('nav button')].map(b => { const r = b.getBoundingClientRect();"
            "return [r.left, r.right, r.height, r.bottom] })"
        )
        for left, right, height, bottom in boxes:
            assert left >= 0
            assert right <= 390
            assert bottom <= 844
            assert height >= 44, "a thumb needs 44 px"
        until_red(page)
        assert errors(page) == []


def test_no_connection_leaves_this_machine(live: Live, page: Page) -> None:
    sockets: list[str] = []
    page.on("websocket", lambda socket: sockets.append(socket.url))
    page.reload()
    page.wait_for_function("() => Number(document.body.dataset.packets) > 30")
    addresses = [request.url for request in page.requests()]
    own = live.worker.url.partition("#")[0]
    assert {"touch.js", "kit.js", "kit.css", "touch.css"} <= {a.rsplit("/")[-1] for a in addresses}
    assert all(address.startswith(own) for address in addresses), addresses
    assert sockets == [own.replace("http", "ws") + "live"]


# ---- the program itself: a recording replayed, killed, started again -------------------------------------


def replay(data_dir: Path, port: int = 0) -> tuple[subprocess.Popen[str], str]:
    """`python -m edge replay --view` as a user starts it, and the address of its page."""
    process = subprocess.Popen(
        [
            *(sys.executable, "-m", "edge", "replay", str(data_dir / "press.mcap"), "--sink", "memory:"),
            *("--calibration", str(data_dir / "rings331_ball.json"), "--loop", "--speed", "0.5"),
            *("--view-at", f"127.0.0.1:{port}", "--view-token", TOKEN),
        ],
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )
    line = next(line for line in present(process.stderr) if line.startswith("live page: "))
    return process, line.removeprefix("live page: ").strip()


def ended(process: subprocess.Popen[str], by: signal.Signals) -> int:
    """Its exit code."""
    process.send_signal(by)
    process.communicate(timeout=SOON_S)
    return process.returncode


def test_disconnect_and_reconnect_are_shown(data_dir: Path, context: BrowserContext) -> None:
    process, url = replay(data_dir)
    with closing(opened(context, url)) as page:
        page.wait_for_function(LIVE)
        shown(page, "press.mcap")
        until_red(page)
        ended(process, signal.SIGKILL)
        page.wait_for_function("() => document.body.dataset.state === 'disconnected'")
        assert re.search(r"trying again in \d+ s", page.evaluate(STATE))
        assert pixels(page).std() > 10, "the last picture stays"
        again, _ = replay(data_dir, urlsplit(url).port or 0)
        page.wait_for_function(LIVE)
        until_red(page)
        assert ended(again, signal.SIGTERM) == 0
        page.wait_for_function("() => document.body.dataset.state === 'disconnected'")
