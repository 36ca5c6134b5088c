"""A finger's camera, seen through its live page (`voronoi-touch-edge run --view`): image, pins and cells.

    page --websocket, only while somebody watches--> Picture --> on_picture

Rules
- A finger carries no code for other viewers: the page's packets hold all that they show.
- While nothing is wanted there is no connection, and the page makes nothing.
- A page that cannot be reached or goes away is tried again every `RETRY_S`, and reported once.
"""

from __future__ import annotations

import asyncio
import json
import logging
import os
import re
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import accumulate, pairwise
from math import isfinite
from typing import Any, Final
from urllib.parse import parse_qs, urlsplit

from hostlink.errors import UsageError
from hostlink.extras import require
from hostlink.web import TOKEN_VARIABLE, unpack_packet
from hostlink.web.limits import SparseLog, WebLimits
from hostlink.wire.canid import NODES_MAX

__all__ = ["CaptureClock", "PageAddress", "PageCamera", "Picture", "parse_page"]

log = logging.getLogger(__name__)

RETRY_S: Final = 1.0
SILENT_S: Final = 10.0  # a page that sends nothing for this long has gone; it sends 4 packets a second
PACKET_MAX: Final = 8 << 20  # bytes; a page's picture has at most 720 px a side
_PIXEL_CENTRE = 0.5  # places on a page: pixel centres on integers; here: the corner of the first pixel is 0
_WRAP_US: Final = 1 << 32  # of a sample's capture time
_EXAMPLE = "http://127.0.0.1:8765"

Place = tuple[float, float]
Rgba = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class PageAddress:
    """finger  node number
    url     of the page, without its token
    token   "": none
    """

    finger: int
    url: str
    token: str


def parse_page(text: str) -> PageAddress:
    """`[FINGER=]URL`, the URL as `voronoi-touch-edge run --view` prints it; without FINGER it is finger 1.

    Raises  UsageError
    """
    found = re.fullmatch(r"(?:([1-9]\d{0,2})=)?(https?://\S+)", text)
    try:
        finger, parts = int(found[1] or 1) if found else 0, urlsplit(found[2] if found else "")
        known = bool(parts.hostname) and parts.port != 0 and 1 <= finger <= NODES_MAX
    except ValueError:  # no such port
        known = False
    if not known:
        raise UsageError(
            f"--view {text}: not the page of a finger; give its address, e.g. {_EXAMPLE}, "
            f"or 2={_EXAMPLE} for finger 2"
        )
    token = parse_qs(parts.fragment).get("token", [os.environ.get(TOKEN_VARIABLE, "")])[0]
    return PageAddress(finger, f"{parts.scheme}://{parts.netloc}/", token)


class Picture:
    """One image as a page shows it.

    capture_us  when it was taken, on the finger's clock
    jpeg        the image, perhaps smaller than the camera's
    """

    def __init__(self, header: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
        """Raises LookupError, TypeError, ValueError, ArithmeticError: these are not a page's image."""
        self._arrays = arrays
        self.capture_us = int(header["capture_us"])
        self.jpeg: bytes = arrays["image"]
        (shown_x, shown_y), (x, y) = header["image_px"], header["size_px"]
        self._scale = shown_x / x, shown_y / y
        if not all(map(isfinite, self._scale)):
            raise ValueError("an image of no size")

    def pins(self) -> list[Place]:
        """Places of the pins seen, px of `jpeg` from the corner of its first pixel."""
        return [(x, y) for x, y in self._places("pins") if isfinite(x) and isfinite(y)]

    def cells(self) -> list[tuple[list[Place], Rgba]]:
        """Corners of each cell, like `pins`, and its colour, 0..1; its opacity shows the area's change."""
        corners, rgba = self._places("corners"), self._arrays.get("rgba", ())
        ends = accumulate(self._arrays.get("corners_n", ()), initial=0)
        return [
            (corners[begin:end], (rgba[4 * i], rgba[4 * i + 1], rgba[4 * i + 2], rgba[4 * i + 3]))
            for i, (begin, end) in enumerate(pairwise(ends))
            if end > begin
        ]

    def _places(self, name: str) -> list[Place]:
        scale_x, scale_y = self._scale
        flat = iter(self._arrays.get(name, ()))
        return [
            ((x + _PIXEL_CENTRE) * scale_x, (y + _PIXEL_CENTRE) * scale_y)
            for x, y in zip(flat, flat, strict=True)
        ]


class CaptureClock:
    """Pictures of a finger on the host's clock, by the stamps of its samples."""

    def __init__(self) -> None:
        self._stamped: tuple[int, int] | None = None

    def note(self, capture_us: int, at_ns: int) -> None:
        """A sample's capture time on the finger's clock and on the host's."""
        self._stamped = capture_us, at_ns

    def at_ns(self, capture_us: int) -> int:
        """When a picture was taken; the present if no sample has come yet."""
        if self._stamped is None:
            return time.time_ns()
        sample_us, at_ns = self._stamped
        later_us = (capture_us - sample_us + _WRAP_US // 2) % _WRAP_US - _WRAP_US // 2
        return at_ns + later_us * 1000


class PageCamera:
    """Reads a page in its own thread.

    on_picture  called in that thread with each picture; until it returns, the page makes no more than one
    Raises      UsageError: the extra is not installed
    """

    def __init__(self, address: PageAddress, on_picture: Callable[[Picture], None]) -> None:
        self._aiohttp = require("aiohttp", "view")
        self._address, self._on_picture = address, on_picture
        self._wants: frozenset[str] = frozenset()
        self._socket: Any = None
        self._following: asyncio.Task[None] | None = None
        self._reported = ""
        self._failures = SparseLog(log, WebLimits().log_s)
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="page camera", daemon=True)
        self._thread.start()

    def want(self, wants: frozenset[str]) -> None:
        """The pictures' contents: "image", "cells"; empty: no pictures. From any thread."""
        asyncio.run_coroutine_threadsafe(self._change(wants), self._loop)

    def close(self) -> None:
        """End the connection and the thread."""
        asyncio.run_coroutine_threadsafe(self._change(frozenset()), self._loop).result()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    async def _change(self, wants: frozenset[str]) -> None:
        if wants == self._wants:
            return
        self._wants = wants
        if wants and self._following is None:
            self._following = self._loop.create_task(self._follow())
        elif wants and self._socket is not None and not self._socket.closed:
            await self._socket.send_json({"want": sorted(wants)})
        elif not wants and self._following is not None:
            following, self._following = self._following, None
            following.cancel()
            await asyncio.wait([following])

    async def _follow(self) -> None:
        while True:
            try:
                why = await self._visit()
            except (self._aiohttp.ClientError, OSError, TimeoutError) as error:
                why = str(error) or type(error).__name__
            except Exception as error:  # whatever a page sends, the camera comes back
                log.debug("a message of the page", exc_info=error)
                why = "not the page of a finger; give the address that `voronoi-touch-edge run --view` prints"
            if why != self._reported:
                self._reported = why
                self._failures.write(f"--view {self._address.url}: {why}; trying again")
            await asyncio.sleep(RETRY_S)

    async def _visit(self) -> str:
        """Read the page until it ends; returns why.

        Raises  errors of the network, or any other: it is another page
        """
        binary, text = self._aiohttp.WSMsgType.BINARY, self._aiohttp.WSMsgType.TEXT
        async with (
            self._aiohttp.ClientSession() as session,
            session.ws_connect(self._address.url + "live", max_msg_size=PACKET_MAX) as socket,
        ):
            self._socket, got_n = socket, 0
            await socket.send_json({"token": self._address.token, "want": sorted(self._wants)})
            while (message := await socket.receive(SILENT_S)).type in (binary, text):
                if message.type is text:
                    json.loads(message.data)["hello"]["source"]  # the page of a hand has none
                    continue
                got_n += 1
                header, arrays = unpack_packet(message.data)
                if "image" in arrays:  # the camera may not have given one yet
                    self._on_picture(Picture(header, arrays))
                    self._reported = ""
                await socket.send_json({"got": got_n})
            return message.extra or "the page has ended"
