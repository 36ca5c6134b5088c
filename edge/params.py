"""Chosen numbers that several stages share; the evidence for each is in docs/tuning.md, "Tracking".

Nothing is imported here: the program reads it before it limits the threads of NumPy.
"""

from __future__ import annotations

__all__ = ["ASTRAY_REL"]

#: Share of the pins that may be missing, or beyond a limit, for reasons of their own.
ASTRAY_REL = 0.05
