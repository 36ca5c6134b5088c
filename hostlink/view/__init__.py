"""The fingers of a hand in a browser, from decoded samples alone: `python -m hostlink view ADDRESS`."""

from __future__ import annotations

from hostlink.view.hand import HandView

__all__ = ["HandView"]
