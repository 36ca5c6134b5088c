"""The errors of hostlink. Every message is one line: what is wrong, where, what would be right.

LinkError                (hostlink.wire.errors)
├── WireError
│   ├── CorruptFrame         one damaged frame; the decoder counts it and never lets it out
│   ├── VersionMismatch      the two ends were built from different tables
│   └── ObjectAborted        the node refused an object access
├── UsageError           the user's mistake: one line, exit code 2
│   ├── ConnectError         no such interface or port, or it cannot be opened
│   └── LogError             a log that cannot be read, or a format that would lose data
├── RestFrameRefused     the sensor refused a new rest frame, and kept the previous one
├── LinkTimeout          the sensor did not answer in time
└── LinkDown             the medium failed while a request was under way
"""

from __future__ import annotations

from hostlink.wire.errors import CorruptFrame, LinkError, ObjectAborted, VersionMismatch, WireError
from hostlink.wire.objects import RestFrameReason

__all__ = [
    "ConnectError",
    "CorruptFrame",
    "LinkDown",
    "LinkError",
    "LinkTimeout",
    "LogError",
    "ObjectAborted",
    "RestFrameRefused",
    "UsageError",
    "VersionMismatch",
    "WireError",
]


class UsageError(LinkError):
    """Input that the user can correct."""


class ConnectError(UsageError):
    """The interface or port cannot be used."""


class LogError(UsageError):
    """The log cannot be read or written."""


class RestFrameRefused(LinkError):
    """The sensor refused a new rest frame, and kept the previous one."""

    def __init__(self, message: str, reason: RestFrameReason) -> None:
        super().__init__(message)
        self.reason = reason


class LinkTimeout(LinkError):
    """The sensor did not answer in time."""


class LinkDown(LinkError):
    """The bus or line failed."""
