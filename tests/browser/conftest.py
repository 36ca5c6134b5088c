"""One browser for all tests of pages; they are skipped if there is none."""

from collections.abc import Iterator
from contextlib import closing

import pytest

from tests.browser.chrome import Chrome, chromium


@pytest.fixture(scope="session")
def chrome() -> Iterator[Chrome]:
    if chromium() is None:
        pytest.skip("no Chromium: apt-get install --no-install-recommends chromium")
    with closing(Chrome()) as running:
        yield running
