"""Where a page is served, and who may see it.

Rules
- Loopback unless told otherwise: whoever can log in on this machine may look, nobody else.
- An address that others can reach needs a token, and then even looking needs it.
- Doing anything (tare, record) needs the token everywhere.
"""

from __future__ import annotations

import ipaddress
import secrets
import socket
from dataclasses import dataclass

__all__ = ["DEFAULT", "Listen", "WebError", "parse_listen"]

DEFAULT = "127.0.0.1:8765"
PORT = 8765
TOKEN_MIN = 8  # characters; generated ones have 22


class WebError(ValueError):
    """The page cannot be served so; one line: what, where, what would be right."""


@dataclass(frozen=True, slots=True)
class Listen:
    """host   name or number to bind to
    port   0: a free one
    token  what a viewer must present to command, and to look unless bound to loopback; "": read-only
    """

    host: str
    port: int
    token: str = ""

    @property
    def loopback(self) -> bool:
        return is_loopback(self.host)

    def __str__(self) -> str:
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"


def is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def parse_listen(text: str, token: str | None = None) -> Listen:
    """`HOST:PORT`, `HOST`, `:PORT` or `PORT`; "" is the default.

    token   None: read-only; "auto": make one; else the token itself
    Raises  WebError: no such address, a short token, or one that others can reach without a token
    """
    host, port = _split(text.strip() or DEFAULT)
    if token == "auto":
        token = secrets.token_urlsafe(16)
    elif token is not None and len(token) < TOKEN_MIN:
        raise WebError(f"token: {len(token)} characters; give at least {TOKEN_MIN}, or auto")
    if not is_loopback(host):
        _check_host(text, host)
    if not is_loopback(host) and not token:
        raise WebError(
            f"view {text}: others can reach this address; give a token too (auto makes one), or 127.0.0.1"
        )
    return Listen(host, port, token or "")


def _check_host(text: str, host: str) -> None:
    """Before anything is said of others who can reach it."""
    try:
        socket.getaddrinfo(host, None)
    except (OSError, UnicodeError):
        raise WebError(f"view {text}: no host {host!r} is known; give HOST:PORT, e.g. {DEFAULT}") from None


def _split(text: str) -> tuple[str, int]:
    if text.isdigit():
        host, port_text = "", text
    elif text.startswith("["):
        host, _, port_text = text[1:].partition("]")
        port_text = port_text.removeprefix(":")
    elif text.count(":") > 1:  # a bare IPv6 number
        host, port_text = text, ""
    else:
        host, _, port_text = text.partition(":")
    port_text = port_text or str(PORT)
    if not port_text.isdigit() or int(port_text) > 65535:
        raise WebError(f"view {text}: {port_text!r} is no port; give HOST:PORT, e.g. {DEFAULT}")
    return host or "127.0.0.1", int(port_text)
