"""Recordings that every installation has to try things with, made by `tests/data/make.py`.

example:press    as a source, a recording; its calibration is used where none is given
example:sim      after --calibration: a calibration, here that of the simulator's own tip
"""

from pathlib import Path

from edge.errors import SourceError

SCHEME = "example:"


def example_file(address: str, suffix: str) -> Path:
    """The file of `example:NAME`. Raises SourceError: there is none of this kind."""
    name = address.removeprefix(SCHEME).partition("?")[0]
    known = {path.stem: path for path in sorted(Path(__file__).parent.glob(f"*{suffix}"))}
    if name not in known:
        raise SourceError(f"{address}: no such example; one of {', '.join(SCHEME + name for name in known)}")
    return known[name]


def example_calibration(address: str) -> Path | None:
    """The calibration of a source that is an example; None: it is none."""
    return example_file(address, ".json") if address.startswith(SCHEME) else None
