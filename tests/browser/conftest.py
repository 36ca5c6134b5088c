"""One browser for all tests of pages; they are skipped if there is none."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import BrowserContext

from tests.browser.pages import browser, chromium


@pytest.fixture(scope="package")  # no longer: Playwright keeps other tests from running asyncio
def context() -> Iterator[BrowserContext]:
    if chromium() is None:
        pytest.skip("no Chromium: apt-get install --no-install-recommends chromium")
    with browser() as made:
        yield made
