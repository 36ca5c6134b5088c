"""Settings that a host may change over the link, and that survive a restart.

A JSON file beside the calibration, replaced atomically: after a power cut it is the old one or the new
one, never half of one. A file that cannot be read costs the settings, never the finger: defaults, and a
line in the log. What may be set, its limits and defaults: `stored` rows of `hostlink.wire.objects`.
"""

from __future__ import annotations

import json
import logging
import os
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from hostlink.wire import OBJECTS

__all__ = ["Settings", "SettingsFile"]

log = logging.getLogger(__name__)

TOLD_S = 1.0

_STORED = {o.name: o for o in OBJECTS if o.stored and o.type != "domain"}


def _default(name: str) -> float:
    value = _STORED[name].default
    assert isinstance(value, int | float), name
    return value


@dataclass(frozen=True, slots=True)
class Settings:
    """One set of settings; names, units and limits are the object table's."""

    heartbeat_ms: int = int(_default("heartbeat_ms"))
    rate_hz: float = _default("rate_hz")
    divider: int = int(_default("divider"))
    features: int = int(_default("features"))
    detail_divider: int = int(_default("detail_divider"))


class SettingsFile:
    """Where settings live. `path` None: in memory only."""

    def __init__(self, path: Path | None = None, defaults: Settings | None = None) -> None:
        self._path = path
        self._defaults = defaults or Settings()
        self._failed: tuple[str, float] | None = None
        self.values = self.load()

    def load(self) -> Settings:
        """What the file says; defaults where it says nothing usable."""
        if self._path is None or not self._path.exists():
            return self._defaults
        try:
            table = json.loads(self._path.read_text(encoding="utf-8"))
            checked: dict[str, Any] = {name: _checked(name, value) for name, value in table.items()}
            return replace(self._defaults, **checked)
        except (OSError, ValueError, TypeError, AttributeError, KeyError) as error:
            log.warning("%s: settings cannot be used (%s); starting with defaults", self._path, error)
            return self._defaults

    def change(self, **changes: float) -> Settings:
        """Change and store. Raises OSError: not stored, and nothing changed."""
        changed: dict[str, Any] = {**changes}
        values = replace(self.values, **changed)
        self._store(values)
        self.values = values
        return values

    def restore_defaults(self) -> Settings:
        """Back to defaults, in the file too. Raises OSError."""
        self._store(self._defaults)
        self.values = self._defaults
        return self.values

    def trouble(self) -> str:
        """Empty, or why the last settings could not be stored, for a second after that."""
        words, at_s = self._failed or ("", 0.0)
        return words if words and time.monotonic() - at_s < TOLD_S else ""

    def _store(self, values: Settings) -> None:
        try:
            self._write(values)
        except OSError as error:
            self._failed = (f"{self._path}: {error.strerror}", time.monotonic())
            raise
        self._failed = None

    def _write(self, values: Settings) -> None:
        if self._path is None:
            return
        self._path.parent.mkdir(parents=True, exist_ok=True)
        fresh = self._path.with_name(self._path.name + ".new")
        with fresh.open("w", encoding="utf-8") as file:
            json.dump(asdict(values), file, indent=2)
            file.flush()
            os.fsync(file.fileno())
        fresh.replace(self._path)


def _checked(name: str, value: object) -> float:
    obj = _STORED[name]
    if isinstance(value, bool) or not isinstance(value, int if obj.type != "real32" else int | float):
        raise TypeError(f"{name} is {value!r}, not a number ({obj.type})")
    if obj.low is not None and obj.high is not None and not obj.low <= value <= obj.high:
        raise ValueError(f"{name} is {value}, possible is {obj.low:g}..{obj.high:g}")
    return value
