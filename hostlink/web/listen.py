"""Where a page is served, and who may see it.

Rules
- Loopback by default: only users of this machine may watch.
- An address that others can reach needs a token, for watching too.
- Commands (tare, record) always need the token.
"""

from __future__ import annotations

import ipaddress
import os
import socket
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from hostlink.input_file import open_input

__all__ = ["DEFAULT", "TOKEN_VARIABLE", "Listen", "WebError", "find_token", "parse_listen"]

DEFAULT = "127.0.0.1:8765"
PORT = 8765
TOKEN_MIN = 8  # characters; generated ones have 22
TOKEN_VARIABLE = "VORONOI_TOUCH_VIEW_TOKEN"
_FILE_MAX = 1024  # bytes of a token's file that are read


class WebError(ValueError):
    """The page cannot be served; one line: what, where, what would be right."""


@dataclass(frozen=True, slots=True)
class Listen:
    """host   name or number to bind to
    port   0: a free one
    token  what a viewer must present for commands, and for watching unless bound to loopback; "": read-only
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


def is_own_host(host: str) -> bool:
    """Whether a request's `Host` is this machine's own name, and no other that leads here (DNS rebinding)."""
    try:
        return is_loopback(urlsplit(f"//{host}").hostname or "")
    except ValueError:
        return False


def find_token(given: str | None, path: Path | None, option: str) -> str | None:
    """The token: given, in a file, or in the environment; a command line is seen by all users of a machine.

    path    its first line is the token
    option  name of the option for the file, for messages
    Raises  WebError: given twice, or no token in the file
    """
    if path is None:
        return given or os.environ.get(TOKEN_VARIABLE) or None
    if given is not None:
        raise WebError(f"{option}: the token is given twice; give it once")
    try:
        with open_input(path) as file:
            token = file.readline(_FILE_MAX).decode().strip()
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "not text"
        raise WebError(f"{option} {path}: {why}; give a file whose first line is the token") from None
    if not token.isprintable():
        raise WebError(f"{option} {path}: not text; give a file whose first line is the token")
    if not token:
        raise WebError(f"{option} {path}: its first line is empty; write the token there")
    return token


def parse_listen(text: str, token: str | None = None) -> Listen:
    """`HOST:PORT`, `HOST`, `:PORT` or `PORT`; "" is the default.

    token   None: read-only; "auto": make one; else the token itself
    Raises  WebError: no such address, a short token, or one that others can reach without a token
    """
    host, port = _split(text.strip() or DEFAULT)
    if token == "auto":
        import secrets  # loads cryptography that an address alone does not need

        token = secrets.token_urlsafe(16)
    elif token is not None and len(token) < TOKEN_MIN:
        raise WebError(f"token: shorter than {TOKEN_MIN} characters; give a longer one, or auto")
    if not is_loopback(host):
        _check_host(text, host)
    if not is_loopback(host) and not token:
        raise WebError(
            f"{text}: others can reach this address; give a token too (auto makes one), or 127.0.0.1"
        )
    return Listen(host, port, token or "")


def _check_host(text: str, host: str) -> None:
    """Checked before the message about other machines that can reach it."""
    try:
        socket.getaddrinfo(host, None)
    except (OSError, UnicodeError):
        raise WebError(f"{text}: no host {host!r} is known; give HOST:PORT, e.g. {DEFAULT}") from None


def _split(text: str) -> tuple[str, int]:
    if text.isdecimal():
        host, port_text = "", text
    elif text.startswith("["):
        host, _, port_text = text[1:].partition("]")
        port_text = port_text.removeprefix(":")
    elif text.count(":") > 1:  # a bare IPv6 number
        host, port_text = text, ""
    else:
        host, _, port_text = text.partition(":")
    port_text = port_text or str(PORT)
    if not port_text.isdecimal() or len(port_text) > 5 or int(port_text) > 65535:
        raise WebError(f"{text}: {port_text!r} is no port; give HOST:PORT, e.g. {DEFAULT}")
    return host or "127.0.0.1", int(port_text)
