"""Make the pictures of the pages again: `python -m tests.browser.pictures [FOLDER]`.

They show the bundled recordings, played back and forth, and a hand of simulated samples. Latencies
and rates are this machine's, so it should be idle. In full colour: 256 colours leave steps in colour bar and
image.
"""

import io
import sys
import threading
from pathlib import Path
from typing import Self

from PIL import Image

import hostlink
from hostlink.view import HandView
from hostlink.web import parse_listen
from tests.browser.chrome import Chrome, Page
from tests.browser.test_hand_page import BUS, TOKEN, Hand
from tests.support.viewing import Live
from tests.support.waiting import SOON_S

DATA = Path(__file__).resolve().parent.parent / "data"
FULL_S = 11.0  # the charts are full
LIVE = "document.body.dataset.state === 'live'"
SIZE_MAX = 350_000


def save(page: Page, path: Path) -> None:
    """The current page."""
    raw = page.screenshot(path).read_bytes()
    with Image.open(io.BytesIO(raw)) as shot:
        shot.convert("RGB").save(path, optimize=True)
    assert page.errors == []
    print(f"{path.name:20} {path.stat().st_size / 1e3:6.0f} kB")
    assert path.stat().st_size < SIZE_MAX


class Played:
    """A recording played back and forth, until it is to stand at its end."""

    def __init__(self, recording: str, calibration: str) -> None:
        self.live = Live(DATA / recording, DATA / calibration)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def _run(self) -> None:
        while True:
            for frame in (0, -1):
                self.live.show(frame)
                if self._stop.wait(0.6):
                    self.live.show(-1)
                    return

    def __enter__(self) -> Self:
        self.live.__enter__()
        self._thread.start()
        return self

    def stand(self) -> None:
        self._stop.set()
        self._thread.join(SOON_S)

    def __exit__(self, *error: object) -> None:
        self.stand()
        self.live.__exit__(None, None, None)


def edge_pages(chrome: Chrome, folder: Path) -> None:
    with Played("press_shear.mcap", "hex127_flat.json") as played:
        page = chrome.open(played.live.url)
        page.until(LIVE)
        page.wait_s(FULL_S)
        played.stand()
        page.until("document.getElementById('felt_about').textContent.includes('contact')")
        page.wait_s(0.5)
        save(page, folder / "page_desktop.png")
        page.close()
    with Played("two_contacts.mcap", "rings331_ball.json") as played:
        phone = chrome.open(played.live.url, phone=True)
        page = chrome.open(played.live.url)
        page.until(LIVE)
        page.press("c")
        page.press("s")
        page.wait_s(FULL_S)
        played.stand()
        page.until("document.getElementById('felt_about').textContent.includes('2 contacts')")
        page.wait_s(0.5)
        save(page, folder / "page_safe_colours.png")
        page.press("c")  # the browser keeps it: restore it for the others
        phone.wait_s(0.5)
        save(phone, folder / "page_phone.png")
        page.close()
        phone.close()


def hand_page(chrome: Chrome, folder: Path) -> None:
    hand = Hand(moving=True)
    with hostlink.connect(BUS) as connection:
        view = HandView(connection, parse_listen("127.0.0.1:0", TOKEN))
        view.start()
        page = chrome.open(view.server.url)
        page.until("document.querySelectorAll('.finger canvas').length >= 4")
        page.wait_s(FULL_S)
        save(page, folder / "page_hand.png")
        page.close()
        view.close()
    hand.close()


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else DATA / "pictures"
    folder.mkdir(parents=True, exist_ok=True)
    with Chrome() as chrome:
        edge_pages(chrome, folder)
        hand_page(chrome, folder)


if __name__ == "__main__":
    main()
