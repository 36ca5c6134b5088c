"""Make README's picture of the live page again: `python -m tests.browser.pictures [FILE.png]`.

It shows a bundled recording, played back and forth. Latency and rate are this machine's: let it be idle.
The picture has all colours: 256 leave steps in colour bar and image.
"""

import base64
import io
import sys
import threading
from contextlib import closing
from pathlib import Path

from PIL import Image

from tests.browser.chrome import Chrome
from tests.support.viewing import Live

DATA = Path(__file__).resolve().parent.parent / "data"
FULL_S = 11.0  # the charts are full
STEP_S = 0.6


def main() -> None:
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else DATA / "pictures" / "page_desktop.png"
    pause = threading.Event()
    with closing(Chrome()) as chrome, Live(DATA / "press_shear.mcap", DATA / "hex127_flat.json") as live:
        page = chrome.open(live.url)
        for n in range(round(FULL_S / STEP_S)):
            live.show(n % 2 - 1)
            pause.wait(STEP_S)
        live.show(-1)
        page.until("document.getElementById('felt_about').textContent.includes('contact')")
        raw = base64.b64decode(page.call("Page.captureScreenshot", {"format": "png"})["data"])
        assert page.errors == []
        page.close()
    with Image.open(io.BytesIO(raw)) as shot:
        shot.convert("RGB").save(path, optimize=True)


if __name__ == "__main__":
    main()
