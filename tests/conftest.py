"""Shared fixtures: where the published recordings are, and the bundled ones."""

import os
import signal
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from tests.support import kernels

kernels.install()

from edge.sources.live import ThreadedSource  # noqa: E402  (with the kernels that were installed)
from hostlink.interrupt import ENDING  # noqa: E402

# A background job begins with SIGINT and SIGQUIT ignored, one under nohup with SIGHUP. Programs that
# tests end by a signal would inherit this.
for number in ENDING:
    signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)
# No times: a busy machine is slow.
settings.register_profile("voronoi-touch", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("voronoi-touch")

ROOT = Path(__file__).resolve().parent.parent
#: Tests of the stages that compute: there a warning of NumPy (division by zero, invalid value) is a failure.
#: Uncompiled kernels compute with NumPy's numbers, which warn where C does not.
COMPUTING = [
    ROOT / "tests" / "edge" / stage
    for stage in ("calibration", "cells", "features", "geometry", "pins", "tracking")
    if os.environ.get("VORONOI_TOUCH_KERNELS") != "python"
]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.path.parent in COMPUTING:
            item.add_marker(pytest.mark.filterwarnings("error::RuntimeWarning"))


@pytest.fixture(scope="session", autouse=True)
def _sources_are_closed() -> Iterator[None]:
    """No source is left open: a thread that decodes an image when the interpreter ends aborts it."""
    yield
    left = [thread.name for thread in threading.enumerate() if _is_of_a_source(thread)]
    assert not left, f"sources that no test closed: {', '.join(left)}"


def _is_of_a_source(thread: threading.Thread) -> bool:
    return isinstance(getattr(getattr(thread, "_target", None), "__self__", None), ThreadedSource)


@pytest.fixture(scope="session")
def real_dir() -> Path:
    """Folder of the published recordings; the test is skipped where they are not."""
    folder = Path(os.environ.get("VORONOI_TOUCH_REAL", ROOT.parent / "shared" / "real"))
    if not (folder / "README.md").is_file():
        pytest.skip(f"no recordings at {folder}; set VORONOI_TOUCH_REAL to their folder")
    return folder


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the bundled recordings."""
    return ROOT / "tests" / "data"
