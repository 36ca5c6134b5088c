"""Settings that a host may change over the link; a JSON file keeps them over a restart.

A file that cannot be used does not stop the finger: it starts with defaults, and logs why. What may be set,
its limits and defaults: `stored` rows of `hostlink.wire.objects`.
"""

import logging
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import msgspec

from edge import limits
from edge.params import PARAMS
from hostlink.output_file import OutputError, writing
from hostlink.wire import OBJECTS

log = logging.getLogger(__name__)

_STORED = {o.name: o for o in OBJECTS if o.stored and o.type != "domain"}


def _default(name: str) -> Any:
    return _STORED[name].default


@dataclass(frozen=True, slots=True)
class NodeSettings:
    """One set of settings; names, units and limits are the object table's."""

    heartbeat_ms: int = _default("heartbeat_ms")
    rate_hz: float = _default("rate_hz")
    divider: int = _default("divider")
    features: int = _default("features")
    detail_divider: int = _default("detail_divider")


class SettingsFile:
    """Loads and stores the settings; path None: in memory only."""

    def __init__(self, path: Path | None = None, defaults: NodeSettings | None = None) -> None:
        self._path, self.is_stored = path, path is not None
        self._defaults = defaults or NodeSettings()
        self._failed: tuple[str, float] | None = None
        self.values = self.load()

    def load(self) -> NodeSettings:
        """The file's settings; defaults if it cannot be used."""
        if self._path is None:
            return self._defaults
        try:
            raw = limits.read_bounded(self._path, limits.FILE_BYTES)
            return _changed(self._defaults, limits.decode_json(raw, dict[str, int | float]))
        except FileNotFoundError:
            pass
        except (OSError, ValueError) as error:
            log.warning("%s: settings cannot be used (%s); starting with defaults", self._path, error)
        return self._defaults

    def change(self, **changes: float) -> None:
        """Change and store. Raises ValueError: out of limits; OutputError: not stored; nothing is changed."""
        self._use(_changed(self.values, changes))

    def restore_defaults(self) -> None:
        """Back to defaults, in the file too. Raises OutputError."""
        self._use(self._defaults)

    def trouble(self) -> str:
        """Empty, or why the last settings could not be stored, for a second after that."""
        message, at_s = self._failed or ("", 0.0)
        return message if message and time.monotonic() - at_s < PARAMS.patience_s else ""

    def _use(self, values: NodeSettings) -> None:
        path = self._path
        try:
            if path is not None:
                path.parent.mkdir(parents=True, exist_ok=True)
                with writing(path, overwrite=True, through_link=False) as unfinished:
                    unfinished.write_bytes(msgspec.json.format(msgspec.json.encode(asdict(values))) + b"\n")
        except (OutputError, OSError) as error:
            why = f"{path}: cannot be written: {error.strerror}" if isinstance(error, OSError) else str(error)
            self._failed = (why, time.monotonic())
            raise OutputError(why) from None
        self._failed, self.values = None, values


def _changed(values: NodeSettings, changes: Mapping[str, Any]) -> NodeSettings:
    """Raises ValueError: out of limits, or no such setting."""
    for name, value in changes.items():
        _check(name, value)
    return replace(values, **changes)


def _check(name: str, value: float) -> None:
    """Raises ValueError: this setting may not have the value, or there is no such setting."""
    obj = _STORED.get(name)
    if obj is None:
        raise ValueError(f"no setting is called {limits.quote(name)}; known: {', '.join(_STORED)}")
    if isinstance(value, bool) or (obj.type != "real32" and not isinstance(value, int)):
        raise ValueError(f"{name} is {value!r}, not a whole number")
    if isinstance(value, int) and value.bit_length() > 64:  # too long to be printed
        raise ValueError(f"{name} is a number of {value.bit_length()} bits")
    if obj.low is not None and obj.high is not None and not obj.low <= value <= obj.high:
        raise ValueError(f"{name} is {value:g}, possible is {obj.low:g} to {obj.high:g}")
    if name == "rate_hz" and 0 < value < limits.RATE_MIN_HZ:
        raise ValueError(
            f"rate_hz is {value:g}, possible is 0 (every image) or {limits.RATE_MIN_HZ:g} to {obj.high:g}"
        )
