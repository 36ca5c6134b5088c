"""Pages in this machine's Chromium, headless, by Playwright, which waits for conditions.

The browser's profile is empty, and names other than this machine's are not resolved. A condition is written
as a function (`() => ...`), because the pages' Content-Security-Policy forbids to compile one again.
"""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager

from playwright.sync_api import BrowserContext, Page, sync_playwright

from tests.support.waiting import SOON_S

NAMES = ("chromium", "chromium-browser", "google-chrome")
NO_NAMES = "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1, EXCLUDE localhost"


def chromium() -> str | None:
    """The browser's path; None: not installed."""
    return next(filter(None, map(shutil.which, NAMES)), None)


@contextmanager
def browser() -> Iterator[BrowserContext]:
    """A browser with a screen of 1280x800 px."""
    with sync_playwright() as playwright:
        running = playwright.chromium.launch(
            executable_path=chromium(), args=[NO_NAMES], timeout=SOON_S * 1e3
        )
        context = running.new_context(viewport={"width": 1280, "height": 800})
        context.set_default_timeout(SOON_S * 1e3)
        yield context
        running.close()


def opened(context: BrowserContext, url: str) -> Page:
    """A new page, loading `url`."""
    page = context.new_page()
    page.goto(url)
    return page


def errors(page: Page) -> list[str]:
    """Exceptions, and error lines of the console."""
    lines = [line.text for line in page.console_messages() if line.type == "error"]
    return lines + [error.message for error in page.page_errors()]
